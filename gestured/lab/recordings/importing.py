"""`gestured-lab import`: files of other forms -> one file of recordings."""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from gestured.client.say import say, tell
from gestured.core.errors import GesturedError, RecordingError
from gestured.lab.recordings.safe import LEFT_OUT_SHOWN, LeftOut
from gestured.lab.recordings.sources import Csv, read_capfingerid, read_csv
from gestured.lab.recordings.store import join_recordings
from gestured.record.arrays import write
from gestured.record.check import SESSION
from gestured.record.recordings import Recordings

CSV_ALONE = ("grid", "time_unit", "label", "participant", "consent")


def run(args: argparse.Namespace) -> int:
    """Import what can be; what cannot is told and counted. Nothing is written where nothing can be."""
    if args.out.exists():
        raise GesturedError(f"--out: {args.out} is there already; expected a new file")
    parts: list[Recordings] = []
    left: list[LeftOut] = []
    refused: list[str] = []
    read = _reader(args)
    for path in args.files:
        try:
            recordings, gone = read(path)
        except RecordingError as error:
            refused.append(str(error))
            continue
        if parts and recordings.frames.shape[1:] != parts[0].frames.shape[1:]:
            raise GesturedError(f"{path}: expected the grid of {args.files[0]}")
        parts.append(recordings)
        left += gone
    more = [f"and {len(left) - LEFT_OUT_SHOWN} lines more"] if len(left) > LEFT_OUT_SHOWN else []
    for line in [*refused, *map(str, left[:LEFT_OUT_SHOWN]), *more]:
        say(line, to=sys.stderr if args.json else sys.stdout)
    if not parts:
        raise GesturedError("nothing could be imported, so nothing was written")
    together = join_recordings(parts)
    write(args.out, together)
    found = {"recordings": len(together), "frames": len(together.frames), "lines_left_out": len(left),
             "files_left_out": len(refused)}  # fmt: skip
    words = f"{len(together)} recordings, {len(together.frames)} frames"
    tell(args.json, found, f"{args.out}: {words}; left out: {len(refused)} files, {len(left)} lines")
    return 0


def _reader(args: argparse.Namespace) -> Callable[[Path], tuple[Recordings, list[LeftOut]]]:
    if args.format == "capfingerid":
        given = [name for name in CSV_ALONE if getattr(args, name) is not None]
        if given:
            raise GesturedError(f"--{given[0].replace('_', '-')}: only for --format csv; CapFingerId says it itself")
        return read_capfingerid
    if args.participant is None:
        raise GesturedError("--participant: expected a pseudonym; a CSV file does not say whose it is")
    rows, columns = args.grid or (9, 9)
    form = Csv(rows, columns, args.time_unit or "s", args.label or SESSION,
               args.participant, args.consent or "")  # fmt: skip
    return partial(read_csv, form=form)
