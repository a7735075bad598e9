"""`gestured-lab collect`, `import`, `inspect` and `forget`: their flags, and who runs them."""

import argparse
from collections.abc import Callable
from pathlib import Path

from gestured.client.address import host_port
from gestured.core.wire import is_sensor
from gestured.lab.recordings.protocol import pseudonym
from gestured.simulator import GESTURES

FOLDER = Path("recordings")
Add = Callable[[str, str, str], argparse.ArgumentParser]


def add(command: Add) -> None:
    """Add the four subcommands; `command` takes a name, what it does and an example."""
    collect = command("collect", "lead a participant through the protocol, and record the sensor that sends over OSC",
                      "gestured-lab collect --participant 07 --listen 0.0.0.0:9000")  # fmt: skip
    collect.add_argument("--participant", type=pseudonym, required=True, metavar="NAME",
                         help="pseudonym: 1 to 32 of A-Z a-z 0-9 _ -")  # fmt: skip
    collect.add_argument("--out", type=Path, default=FOLDER, help=f"folder for NAME.npz ({FOLDER})")
    collect.add_argument("--listen", type=host_port, default=("127.0.0.1", 9000), metavar="HOST:PORT",
                         help="where the sensor sends to (127.0.0.1:9000)")  # fmt: skip
    collect.add_argument("--sensor", type=_sensor, metavar="NAME", help="which sensor (the first that sends)")
    collect.add_argument("--rows", type=_side, default=9, metavar="N", help="rows of its grid (9)")
    collect.add_argument("--columns", type=_side, default=9, metavar="N", help="columns of its grid (9)")
    collect.add_argument("--rate", type=_rate, default=15.0, metavar="HZ", help="frames a second, nominally (15)")
    collect.add_argument("--seed", type=int, default=0, metavar="N", help="another order of the trials (0)")
    collect.add_argument("--gestures", type=_gestures, default=GESTURES, metavar="A,B", help="only these (all ten)")
    collect.add_argument("--repeats", type=_count, default=1, metavar="N", help="times that each trial is done (1)")
    collect.add_argument("--countdown", type=_seconds, default=3, metavar="S", help="seconds before each gesture (3)")


def run(args: argparse.Namespace) -> int:
    """Run one of the four."""
    if args.command == "collect":
        from gestured.lab.recordings import collect

        return collect.run(args)
    raise AssertionError(args.command)


COMMANDS = ("collect",)


def _sensor(text: str) -> str:
    if not is_sensor(text):
        raise argparse.ArgumentTypeError(f"{text!r}: expected 1 to 64 of A-Z a-z 0-9 _ -")
    return text


def _gestures(text: str) -> tuple[str, ...]:
    found = tuple(text.split(","))
    unknown = [name for name in found if name not in GESTURES]
    if unknown:
        raise argparse.ArgumentTypeError(f"{unknown[0]!r}: expected some of {', '.join(GESTURES)}, with commas")
    return tuple(dict.fromkeys(found))


def _within(low: float, high: float, whole: bool) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            value = int(text) if whole else float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            kind = "a whole number" if whole else "a number"
            raise argparse.ArgumentTypeError(f"{text!r}: expected {kind} from {low:g} to {high:g}")
        return value

    return parse


_side = _within(2, 64, whole=True)
_rate = _within(5, 1000, whole=False)
_count = _within(1, 100, whole=True)
_seconds = _within(0, 60, whole=True)
