"""`gestured-lab import`: CSV with one row for each frame -> one file of recordings.

A line that is no frame is left out and reported; the times show that a frame was lost. A file with more such lines than
frames has another form, and is refused.
"""

import argparse
import sys
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import TextIOWrapper
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gestured.client.say import say, tell
from gestured.client.values import each_once
from gestured.core.errors import GesturedError, RecordingError
from gestured.lab.recordings.store import compact, join_recordings, touched
from gestured.record.arrays import write
from gestured.record.check import SESSION, no_seconds
from gestured.record.files import open_regular
from gestured.record.recordings import Recordings

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
LINE = 256 << 10  # characters of a line; 64 x 64 numbers with all their digits have half as many
NUMBERS = 1 << 27  # numbers of all frames of a file: a gibibyte in memory
BAD_LINES = 10_000  # lines of a file that may be left out and named; a file with more has another form
LEFT_OUT_SHOWN = 10  # left-out lines that are printed; the rest is counted
LARGEST_COUNT = 1e30  # the largest number; sums and differences of such counts still fit into a float32


@dataclass(frozen=True, slots=True)
class Csv:
    """What is to be known of a CSV file beside its content.

    A file holds one recording, a row for each frame: time, then rows x columns values, row by row, the top row first;
    commas between them, or semicolons and decimal commas, a heading or none.
    """

    rows: int
    columns: int
    unit: str  # of the time: a key of UNITS
    label: str  # a gesture, "none" or "session"
    participant: str
    consent: str  # YYYY-MM-DD, or empty


def run(args: argparse.Namespace) -> int:
    """Import files; what cannot be used is reported and counted. Raises GesturedError if nothing can be written."""
    if args.out.exists():
        raise GesturedError(f"--out: {args.out} is there already; expected a new file")
    each_once(args.files)
    parts: list[Recordings] = []
    left: list[str] = []
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
        left += [f"{path}: line {line} is left out: {reason}" for line, reason in gone]
    more = [f"and {len(left) - LEFT_OUT_SHOWN} lines more"] if len(left) > LEFT_OUT_SHOWN else []
    for line in [*refused, *left[:LEFT_OUT_SHOWN], *more]:
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


def read_csv(path: Path, form: Csv) -> tuple[Recordings, list[tuple[int, str]]]:
    """One recording, and each left-out line with its reason. Raises RecordingError if the file holds no recording."""
    times: list[float] = []
    values = array("d")
    last: list[float] = []
    left: list[tuple[int, str]] = []
    for number, text in _lines(path):
        cells = text.replace(",", ".").split(";") if ";" in text else text.split(",")
        if number == 1 and _number(cells[0]) is None:
            continue  # a heading
        try:
            t, *counts = _numbers(cells, 1 + form.rows * form.columns)
            t *= UNITS[form.unit]
            if times and t == times[-1] and counts == last:
                continue  # the same frame again
            if times and t <= times[-1]:
                raise ValueError(f"time: expected later than {times[-1]:.6f} s, found {t:.6f} s")
        except ValueError as error:
            left.append((number, str(error)))
            if len(left) > BAD_LINES:
                break
            continue
        if len(values) + len(counts) > NUMBERS:
            raise RecordingError(f"{path}: line {number}: expected at most {NUMBERS} numbers in a file; split it")
        times.append(t)
        values.extend(counts)
        last = counts
    if len(times) < 2 or len(left) > min(len(times), BAD_LINES):
        first = f"; {left[0][1]} (line {left[0][0]})" if left else ""
        raise RecordingError(f"{path}: expected frames, found {len(times)} and {len(left)} lines that are none{first}")
    frames, stamps = compact(np.frombuffer(values).reshape(-1, form.rows, form.columns)), np.array(times)
    if wrong := no_seconds(stamps):
        raise RecordingError(f"{path}: time: {wrong}; see --time-unit")
    return _marked(frames, stamps, path, form), left


def _marked(frames: NDArray[np.generic], times: NDArray[np.float64], path: Path, form: Csv) -> Recordings:
    """One recording of (T, R, C) frames at (T,) s; that of a gesture has its first and last touched frame."""
    whole = Recordings(
        frames=frames,
        times=times - times[0],
        offsets=np.array([0, len(times)], np.int64),
        labels=np.array([form.label]),
        subjects=np.array([form.participant]),
        kinds=np.array([form.label]),
        consents=np.array([form.consent]),
    )
    if form.label == SESSION:
        return whole
    contact = touched(frames, times - times[0])
    if contact is None:
        raise RecordingError(f"{path}: frames: expected one {form.label} with untouched frames before or after it")
    return replace(whole, onsets=np.array(contact[:1]), releases=np.array(contact[1:]))


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines that are not empty, with their numbers from 1. Raises RecordingError if one is too long."""
    try:
        with TextIOWrapper(open_regular(path), encoding="utf-8-sig", errors="replace") as file:
            for number in count(1):
                line = file.readline(LINE + 1)
                if not line:
                    return
                if len(line) > LINE:
                    raise RecordingError(f"{path}: line {number}: expected at most {LINE} characters")
                if text := line.strip():
                    yield number, text
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _numbers(cells: list[str], count: int) -> list[float]:
    """The numbers of a row. Raises ValueError, which names the field, if it is no frame."""
    if len(cells) != count:
        raise ValueError(f"line: expected {count} numbers, found {len(cells)}")
    found = [_number(cell) for cell in cells]
    for k, value in enumerate(found, 1):
        if value is None or not abs(value) <= LARGEST_COUNT:
            raise ValueError(f"number {k}: expected a finite number, found {cells[k - 1][:20]!r}")
    return [value for value in found if value is not None]
