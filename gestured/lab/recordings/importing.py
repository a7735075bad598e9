"""`gestured-lab import`: CSV files -> one file of recordings."""

import argparse
import sys

from gestured.client.say import say, tell
from gestured.core.errors import GesturedError, RecordingError
from gestured.lab.recordings.sources import Csv, LeftOut, read_csv
from gestured.lab.recordings.store import join_recordings
from gestured.record.arrays import write
from gestured.record.recordings import Recordings

LEFT_OUT_SHOWN = 10  # of the lines that were left out; the rest is counted


def run(args: argparse.Namespace) -> int:
    """Import what can be; what cannot is told and counted. Nothing is written where nothing can be."""
    if args.out.exists():
        raise GesturedError(f"--out: {args.out} is there already; expected a new file")
    parts: list[Recordings] = []
    left: list[LeftOut] = []
    refused: list[str] = []
    rows, columns = args.grid
    form = Csv(rows, columns, args.time_unit, args.label, args.participant, args.consent or "")
    for path in args.files:
        try:
            recordings, gone = read_csv(path, form)
        except RecordingError as error:
            refused.append(str(error))
            continue
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
