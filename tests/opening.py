"""Each kind of file that somebody may hand us, opened as our programs open it; as a process of bounded memory, too.

    python -m tests.opening KIND PATH MIB

opens one file, or all of a folder, with so much address space beyond what the program itself takes, and prints what
was refused of the last one, and the memory that it took, as JSON.
"""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gestured.core.errors import GesturedError

ROOT = Path(__file__).parent.parent
Open = Callable[[Path], object]


def npz(path: Path) -> object:
    """As `replay` plays it."""
    from gestured.control.labelled import Labelled

    return Labelled(path, "arm").tape


def npz_alone(path: Path) -> object:
    """As whoever needs no more than the recordings reads it."""
    from gestured.record.arrays import read

    return read(path)


def mcap(path: Path) -> object:
    """As `replay --diff` and `export` read it, with a model that has no answers."""
    from gestured.control import export
    from gestured.control.diff import Recorded
    from gestured.record.check import check
    from gestured.record.replay import Mute, Replay

    recorded = Recorded(path)
    replay = Replay(recorded.tape, recorded.maker.scene, Mute(recorded.maker.scene.gestures))
    list(replay.events())
    _, _, differences = recorded.compare([], lambda sensor, t: True)
    words = [difference.words() for difference in differences]
    if replay.played:
        check(export.sessions_of(path)[1])
    return words


def csv(path: Path) -> object:
    """As `import` reads one gesture."""
    from gestured.lab.recordings.importing import Csv, read_csv

    return read_csv(path, Csv(3, 3, "s", "swipe_left", "07", ""))


def wide(path: Path) -> object:
    """As `import` reads a session of a large sensor."""
    from gestured.lab.recordings.importing import Csv, read_csv

    return read_csv(path, Csv(64, 64, "s", "session", "07", ""))


KINDS: dict[str, Open] = {
    "npz": npz, "npz_alone": npz_alone, "mcap": mcap, "csv": csv, "wide": wide,
}  # fmt: skip


NO_FILES = ("missing", "directory", "fifo", "zero", "empty", "text", "nul")


def no_file(kind: str, path: Path) -> Path:
    """The path of what is no file of ours, one of NO_FILES: `path` itself where anything at all can stand there."""
    if kind == "directory":
        path.mkdir()
    elif kind == "fifo":
        os.mkfifo(path)
    elif kind == "empty":
        path.touch()
    elif kind == "text":
        path.write_text("something else\n" * 1000)
    return {"zero": Path("/dev/zero"), "nul": Path(f"a\0b{path.suffix}")}.get(kind, path)


def refused(kind: str, path: Path) -> str:
    """What is said against a file in one sentence that names it, "" where it is taken; nothing else may be raised."""
    try:
        KINDS[kind](path)
    except GesturedError as error:
        assert str(path) in str(error) and "\n" not in str(error), str(error)
        return str(error)
    return ""


def in_bounds(kind: str, path: Path, mib: int) -> tuple[str, float]:
    """What a process says that has so many MiB for the file, and the MiB that it used."""
    command = [sys.executable, "-m", "tests.opening", kind, str(path), str(mib)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    found: dict[str, Any] = json.loads(done.stdout)
    return found["refused"], found["mib"]


def _kib(name: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(name)).split()[1])


def main() -> None:
    kind, path, mib = sys.argv[1:]
    missing = Path("/nowhere/at/all")
    refused(kind, missing)  # whatever is imported and started for it is there now
    if kind == "mcap":
        import mcap.stream_reader  # noqa: F401
    before, mapped = _kib("VmRSS"), _kib("VmSize")
    limit = 1024 * mapped + (int(mib) << 20)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    files = sorted(Path(path).iterdir()) if Path(path).is_dir() else [Path(path)]
    said = [refused(kind, file) for file in files][-1]
    print(json.dumps({"refused": said, "mib": round((_kib("VmHWM") - before) / 1024, 1)}))


if __name__ == "__main__":
    main()
