"""The flags of `gestured-lab collect`, `import` and `forget`."""

import argparse
import difflib
from collections.abc import Callable
from datetime import date
from pathlib import Path

from gestured.client.pad.server import DEFAULT
from gestured.client.values import bind_address, host_port, npz, number, rows_by_columns, sensor_name, some_of
from gestured.core.address import Address
from gestured.core.own import is_name
from gestured.lab.recordings.protocol import pseudonym
from gestured.record.check import SESSION, UNNAMED
from gestured.simulator import GESTURES, NON_GESTURES, NONE

FOLDER = Path("recordings")
SEED = number(0, 10**9, whole=True)
NO_NAMES = (SESSION, UNNAMED)  # labels in recordings that name no gesture, besides those that `is_name` refuses
IMPORT = """\
Make recordings of CSV files. What cannot be used is told and
counted: the file, the line, the field, and what was expected.

A file has a row for each frame: time, then rows x columns values, row by row,
the top row first; with commas, a heading or none. With a gesture as --label the
file holds one performance of it, whose touched frames are marked as the daemon
would see them."""
Add = Callable[[str, str, str], argparse.ArgumentParser]


def add_recordings(command: Add) -> None:
    """Add the three subcommands; `command` takes a subcommand's name, its help and an example."""
    collect = command("collect", "lead a participant through the protocol, and record the sensor that sends over OSC",
                      "gestured-lab collect --participant 07 --listen 0.0.0.0:9000")  # fmt: skip
    collect.add_argument("--participant", type=pseudonym, required=True, metavar="NAME",
                         help="pseudonym: 1 to 32 of A-Z a-z 0-9 _ -")  # fmt: skip
    collect.add_argument("--out", type=Path, default=FOLDER, help=f"folder for NAME.npz ({FOLDER})")
    collect.add_argument("--listen", type=host_port, default=Address("127.0.0.1", 9000), metavar="HOST:PORT",
                         help="where the sensor sends to (127.0.0.1:9000)")  # fmt: skip
    collect.add_argument("--sensor", type=sensor_name, metavar="NAME", help="which sensor (the first that sends)")
    collect.add_argument(
        "--grid", type=rows_by_columns, default=(9, 9), metavar="RxC", help="its rows and columns (9x9)"
    )
    collect.add_argument("--seed", type=SEED, default=0, metavar="N", help="another order of the trials (0)")
    collect.add_argument("--gestures", type=_gestures, default=GESTURES, metavar="A,B",
                         help="only these, or names of your own (all ten)")  # fmt: skip
    collect.add_argument("--non-gestures", type=some_of(NON_GESTURES), metavar="A,B",
                         help="non-gestures, each once beside the gestures (none; with --pad a few)")  # fmt: skip
    collect.add_argument("--pad", type=bind_address, nargs="?", const=DEFAULT, metavar="HOST:PORT",
                         help=f"the sensor is a pad on a page that is served here ({DEFAULT})")  # fmt: skip
    collect.add_argument("--model", default="cnn_lstm", metavar="MODEL",
                         help="says at once where a gesture looks like another (cnn_lstm)")  # fmt: skip
    collect.add_argument("--repeats", type=_count, default=1, metavar="N", help="times that each trial is done (1)")
    collect.add_argument("--countdown", type=_seconds, default=3, metavar="S", help="seconds before each gesture (3)")

    bring = command("import", "make recordings of CSV files",
                    "gestured-lab import --participant 07 --label one_tap a.csv --out b.npz")  # fmt: skip
    bring.formatter_class = argparse.RawDescriptionHelpFormatter
    bring.description = IMPORT
    bring.add_argument("files", type=Path, nargs="+", metavar="FILE", help="one recording each")
    bring.add_argument("--out", type=npz, required=True, metavar="F.npz", help="a new file for all of them")
    bring.add_argument("--grid", type=rows_by_columns, default=(9, 9), metavar="RxC", help="rows and columns (9x9)")
    bring.add_argument("--time-unit", choices=("s", "ms", "us"), default="s", help="of the first column (s)")
    bring.add_argument("--label", type=_label, default=SESSION, metavar="LABEL",
                      help="what was performed: a gesture, a name of your own, none, or session (session)")  # fmt: skip
    bring.add_argument("--participant", type=pseudonym, required=True, metavar="NAME",
                       help="whose recordings they are, a pseudonym")  # fmt: skip
    bring.add_argument("--consent", type=_day, metavar="YYYY-MM-DD", help="the day of the participant's consent")
    forget = command("forget", "remove a participant from files of recordings, and say which models learned from them",
                     "gestured-lab forget 07 recordings --dry-run")  # fmt: skip
    forget.add_argument("participant", metavar="NAME", help="as the recordings name the participant")
    forget.add_argument("paths", type=Path, nargs="+", metavar="DIR|FILE", help="files, and folders of .npz files")
    forget.add_argument("--models", type=Path, default=Path("models"), help="folder of the models to ask (models)")
    forget.add_argument("--yes", action="store_true", help="do not ask")
    forget.add_argument("--dry-run", action="store_true", help="say what would be removed, and remove nothing")


def _gestures(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(_own(name) for name in text.split(",")))


def _label(text: str) -> str:
    return text if text in (NONE, SESSION) else _own(text)


def _own(text: str) -> str:
    """A gesture's name or an own name; a name that is nearly a gesture's counts as a typing error."""
    if text in GESTURES:
        return text
    meant = difflib.get_close_matches(text, GESTURES, n=1, cutoff=0.85)
    if meant or not is_name(text) or text in NO_NAMES:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected {meant[0]}, or a name of your own that is less like it"
            if meant
            else f"{text!r}: expected one of {', '.join(GESTURES)}, or a name of your own, 1 to 32 of a-z 0-9 _"
        )
    return text


def _day(text: str) -> str:
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a day such as 2026-01-31") from None


_count = number(1, 100, whole=True)
_seconds = number(0, 60, whole=True)
