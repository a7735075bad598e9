"""`gesturectl flag`: keep what the flight recorder holds as a tape, after a wrong answer."""

import argparse
from datetime import datetime
from itertools import chain, count
from pathlib import Path

from gestured.client.control import Control
from gestured.client.lines import Unreachable
from gestured.client.program import Commands
from gestured.client.say import tell
from gestured.control.address import add_sockets, connect
from gestured.control.record import Keeper
from gestured.core.errors import GesturedError
from gestured.record.tape_writer import Writer

LIMIT_BYTES = 2 << 30  # more than the flight recorder may hold


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "flag",
        help="keep the last 30 seconds after a wrong gesture",
        description="Keep what the daemon's flight recorder holds, the packets of the last 30 seconds with the\n"
        "events and the model's sha256, as a recording. The daemon must run with --flight-recorder.",
        epilog='examples:\n  gesturectl flag\n  gesturectl flag wrong.mcap --note "a tap, taken for a swipe"',
    )
    parser.takes("file", "FILE", "default: flag-DATE-TIME.mcap", type=Path, nargs="?")
    parser.takes("--note", "TEXT", "what was wrong; kept with it", default="")
    add_sockets(parser)
    parser.runs(run, "print what was kept as JSON")


def run(args: argparse.Namespace) -> int:
    """Fetch what the flight recorder holds, write it, and print how much it is."""
    path = args.file or flag_path(Path())
    with connect(args) as control:
        keeper = flag(control, path, args.note)
    kept = {"file": str(path), "packets": keeper.packets, "events": keeper.events, "model": keeper.scene["model"]}
    tell(args.json, kept, f"{path}: {keeper.packets} packets, {keeper.events} events")
    return 0


def flag_path(folder: Path) -> Path:
    """The path of a new file in `folder` that is named after the local time."""
    stem = f"flag-{datetime.now():%Y%m%d-%H%M%S}"
    names = chain([stem], (f"{stem}-{n}" for n in count(2)))
    return next(path for name in names if not (path := folder / f"{name}.mcap").exists())


def flag(control: Control, path: Path, note: str) -> Keeper:
    """Fetch what the flight recorder holds, and write it. Raises Refused if it is off, Unreachable, GesturedError."""
    scene = control.ask("flight")
    with Writer(path, scene | {"note": note}, LIMIT_BYTES) as tape, control.reading():
        keeper = Keeper(tape, scene)
        try:
            for line in control.lines():
                if line["type"] == "end":
                    return keeper
                keeper.keep(line)
        except KeyboardInterrupt:
            raise GesturedError(f"ended before all was written; {path} is not complete") from None
    raise Unreachable(f"the daemon closed the connection; {path} is not complete")
