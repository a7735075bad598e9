"""The flags of `gestured-lab collect`, `import` and `forget`."""

import argparse
import difflib
from collections.abc import Callable
from datetime import date
from pathlib import Path

from gestured.client.pad.server import DEFAULT
from gestured.client.program import Parser
from gestured.client.values import bind_address, host_port, npz, number, rows_by_columns, sensor_name, some_of
from gestured.core.address import Address
from gestured.core.own import is_name
from gestured.lab.recordings.protocol import pseudonym
from gestured.record.check import SESSION
from gestured.record.judge import UNNAMED
from gestured.simulator import GESTURES, NON_GESTURES, NONE

FOLDER = Path("recordings")
SEED = number(0, 10**9, whole=True)
NO_NAMES = (SESSION, UNNAMED)  # labels in recordings that name no gesture, besides those that `is_name` refuses
IMPORT = """\
Make recordings of CSV files. What cannot be used is told and
counted: the file, the line, the field, and what was expected.

A file has a row for each frame: time, then rows x columns values, row by row,
the top row first; with commas, or semicolons and decimal commas; a heading or
none. With a gesture as --label the file holds one performance of it, whose
touched frames are marked as the daemon would see them."""
Add = Callable[[str, str, str], Parser]


def add_recordings(command: Add) -> None:
    """Add the three subcommands; `command` takes a subcommand's name, its help and an example."""
    collect = command("collect", "lead a participant through the protocol, and record the sensor that sends over OSC",
                      "gestured-lab collect --participant 07 --listen 0.0.0.0:9000")  # fmt: skip
    collect.takes("--participant", "NAME", "pseudonym: 1 to 32 of A-Z a-z 0-9 _ -", type=pseudonym, required=True)
    collect.add_argument("--out", type=Path, default=FOLDER, help=f"folder for NAME.npz ({FOLDER})")
    text = "where the sensor sends to (127.0.0.1:9000)"
    collect.takes("--listen", "HOST:PORT", text, type=host_port, default=Address("127.0.0.1", 9000))
    collect.takes("--sensor", "NAME", "which sensor (the first that sends)", type=sensor_name)
    collect.takes("--grid", "RxC", "its rows and columns (9x9)", type=rows_by_columns, default=(9, 9))
    collect.takes("--seed", "N", "another order of the trials (0)", type=SEED, default=0)
    collect.takes("--gestures", "A,B", "only these, or names of your own (all ten)", type=_gestures, default=GESTURES)
    text = "non-gestures, each once beside the gestures (none; with --pad a few)"
    collect.takes("--non-gestures", "A,B", text, type=some_of(NON_GESTURES))
    text = f"the sensor is a pad on a page that is served here ({DEFAULT})"
    collect.takes("--pad", "HOST:PORT", text, type=bind_address, nargs="?", const=DEFAULT)
    collect.takes("--model", "MODEL", "says at once where a gesture looks like another (cnn_lstm)", default="cnn_lstm")
    collect.takes("--repeats", "N", "times that each trial is done (1)", type=_count, default=1)
    collect.takes("--countdown", "S", "seconds before each gesture (3)", type=_seconds, default=3)

    bring = command("import", "make recordings of CSV files",
                    "gestured-lab import --participant 07 --label one_tap a.csv --out b.npz")  # fmt: skip
    bring.formatter_class = argparse.RawDescriptionHelpFormatter
    bring.description = IMPORT
    bring.takes("files", "FILE", "one recording each", type=Path, nargs="+")
    bring.takes("--out", "F.npz", "a new file for all of them", type=npz, required=True)
    bring.takes("--grid", "RxC", "rows and columns (9x9)", type=rows_by_columns, default=(9, 9))
    bring.add_argument("--time-unit", choices=("s", "ms", "us"), default="s", help="of the first column (s)")
    text = "what was performed: a gesture, a name of your own, none, or session (session)"
    bring.takes("--label", "LABEL", text, type=_label, default=SESSION)
    bring.takes("--participant", "NAME", "whose recordings they are, a pseudonym", type=pseudonym, required=True)
    bring.takes("--consent", "YYYY-MM-DD", "the day of the participant's consent", type=_day)
    forget = command("forget", "remove a participant from files of recordings, and say which models learned from them",
                     "gestured-lab forget 07 recordings --dry-run")  # fmt: skip
    forget.takes("participant", "NAME", "as the recordings name the participant")
    forget.takes("paths", "DIR|FILE", "files, and folders of .npz files", type=Path, nargs="+")
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
