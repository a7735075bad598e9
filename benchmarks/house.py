"""How large the code is, and how many calls an idle frame makes (`python -m benchmarks.house`).

Lines are counted as by `cat` and `wc -l` over the .py files of a folder. Classes are those of the modules that
`core/hub.py` imports, directly or not. Calls are the `call` events of `sys.setprofile` from `Hub.receive` on, for one
packet of 81 floats of a settled sensor that nobody touches, in a scene without options.
"""

import ast
import signal
import statistics
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import numpy as np
from numpy.typing import NDArray
from pythonosc.osc_message_builder import OscMessageBuilder

from gestured.core.hub import Hub
from gestured.core.scene import Scene
from gestured.record.replay import Mute

ROOT = Path(__file__).parents[1]
PARTS = ("gestured", "gestured/core", "gestured/model", "gestured/record", "gestured/simulator", "gestured/client",
         "gestured/daemon", "gestured/control", "gestured/bridge", "gestured/lab", "tests", "experiments")  # fmt: skip
GRID = (9, 9)
PACKETS = 300  # packets of the sensor, whose noise is known before the last of them
COUNTED = 30  # packets at the end whose calls are counted


def lines(part: str) -> tuple[int, int]:
    """How many lines and modules a folder has; a package's own __init__ counts for its lines alone."""
    files = list((ROOT / part).rglob("*.py"))
    return sum(len(file.read_bytes().splitlines()) for file in files), sum(f.name != "__init__.py" for f in files)


def hub_imports() -> set[Path]:
    """The files of `core/hub.py` and of the modules that it imports, directly or not."""
    seen: set[Path] = set()
    todo = [ROOT / "gestured/core/hub.py"]
    while todo:
        file = todo.pop()
        if file not in seen:
            seen.add(file)
            todo += _imports(file)
    return seen


def _imports(file: Path) -> Iterator[Path]:
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("gestured."):
            for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names)):
                path = ROOT / (name.replace(".", "/") + ".py")
                if path.exists():
                    yield path


def classes() -> int:
    """How many classes `core/hub.py` and the modules that it imports define."""
    trees = (ast.parse(file.read_text()) for file in hub_imports())
    return sum(isinstance(node, ast.ClassDef) for tree in trees for node in ast.walk(tree))


def packet(values: NDArray[np.float64]) -> bytes:
    """The OSC message of one frame, as floats."""
    message = OscMessageBuilder("/armrest/pressure")
    for value in values.ravel():
        message.add_arg(float(value), "f")
    return message.build().dgram


def idle_calls() -> list[int]:
    """The number of Python calls for each of the last COUNTED idle frames."""
    hub, rng = Hub(Scene(("one_tap",), GRID), Mute(("one_tap",))), np.random.default_rng(0)
    counts: list[int] = []
    calls = 0

    def see(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event == "call"

    for n in range(PACKETS):
        waiting = [(packet(rng.normal(100.0, 2.0, GRID)), ("127.0.0.1", 9))]
        calls = 0
        sys.setprofile(see)
        hub.receive(waiting, n / 15)
        sys.setprofile(None)
        counts.append(calls)
        hub.tick(n / 15)
    return counts[-COUNTED:]


def main() -> None:
    """Print lines and modules of each folder, and both counts."""
    print(f"{'folder':<22}{'lines':>8}{'modules':>9}")
    for part in PARTS:
        if (ROOT / part).is_dir():
            count, modules = lines(part)
            print(f"{part:<22}{count:>8}{modules:>9}")
    print(f"classes in what core/hub.py imports: {classes()}")
    print(f"Python calls of an idle frame: {statistics.median_low(idle_calls())}")


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends the program without a traceback
    main()
