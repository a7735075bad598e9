"""Other people's files -> recordings: CSV with one row a frame, and the text files of CapFingerId.

A line that is no frame is left out and told; its frame counts as lost, which the times show. Where that is more than
half of a file, its form is another one, and the file is refused.
"""

import math
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import TextIOWrapper
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.lab.recordings.protocol import PSEUDONYM
from gestured.lab.recordings.safe import LeftOut
from gestured.lab.recordings.store import compact, touched
from gestured.record.check import SESSION
from gestured.record.files import open_regular
from gestured.record.recordings import Recordings

UNNAMED = "other"  # something was performed, and nobody knows exactly what
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
CAPFINGERID = (27, 15)  # electrodes of the Nexus 5's panel
PAUSE = "PAUSE"
LINE = 256 << 10  # characters of a line; 64 x 64 numbers with all their digits have half as many
NUMBERS = 1 << 27  # of all frames of a file: a gibibyte in memory
BAD_LINES = 10_000  # lines of a file that are left out and named; with more it is no file of this kind
LARGEST_COUNT = 1e30  # of any number; sums and differences of such counts still fit into a float32
WORD = 40  # characters of a hand, a finger or a task


@dataclass(frozen=True, slots=True)
class Csv:
    """What a CSV file does not say itself.

    It holds one recording, a row for each frame: time, then rows x columns values, row by row, the top row first;
    commas between them, a heading or none.
    """

    rows: int
    columns: int
    unit: str  # of the time: a key of UNITS
    label: str  # a gesture, "none" or "session"
    participant: str
    consent: str  # YYYY-MM-DD, or empty


SourceRow = tuple[int, float, list[float], str]  # line, time in s, values, what else the row says


class _Refused(Exception):
    """Why a line is no frame: (field, text)."""


def read_csv(path: Path, form: Csv) -> tuple[Recordings, list[LeftOut]]:
    """One recording; RecordingError where the file does not hold one."""
    left: list[LeftOut] = []

    def rows() -> Iterator[SourceRow]:
        for number, text in _lines(path):
            cells = text.split(",")
            if number == 1 and _number(cells[0]) is None:
                continue  # a heading
            try:
                time_s, *values = _numbers(cells, 1 + form.rows * form.columns)
            except _Refused as refused:
                _leave(left, path, number, refused)
                continue
            yield number, time_s * UNITS[form.unit], values, ""

    frames, times, _ = _frames(path, rows(), (form.rows, form.columns), left)
    whole = Recordings(
        frames=frames,
        times=times,
        offsets=np.array([0, len(times)], np.int64),
        labels=np.array([form.label]),
        subjects=np.array([form.participant]),
        kinds=np.array([form.label]),
        consents=np.array([form.consent]),
    )
    if form.label == SESSION:
        return whole, left
    contact = touched(frames, times)
    if contact is None:
        raise RecordingError(f"{path}: frames: expected one {form.label} with untouched frames before or after it")
    return replace(whole, onsets=np.array(contact[:1]), releases=np.array(contact[1:])), left


def read_capfingerid(path: Path) -> tuple[Recordings, list[LeftOut]]:
    """One session of one finger of one participant; RecordingError where the file does not hold one.

    A line is `participant;hand;finger;task;-1;` and, with commas, seconds and nanoseconds since the Unix epoch, 27 x 15
    counts row by row, and nothing after a last comma. The task (TAP, DRAG, SCROLL ...) is not a gesture: each stretch
    of one task is an event labelled `other`, of that kind. Frames that are there twice are taken once.
    """
    left: list[LeftOut] = []
    who: list[str] = []
    size = 2 + math.prod(CAPFINGERID)

    def rows() -> Iterator[SourceRow]:
        for number, text in _lines(path):
            try:
                head = text.split(";")
                if len(head) != 6:
                    raise _Refused("line", f"expected six parts with ; between them, found {len(head)}")
                if PSEUDONYM.fullmatch(head[0]) is None or (who and head[:3] != who):
                    expected = " ".join(who) or "1 to 32 of A-Z a-z 0-9 _ -"
                    raise _Refused("participant", f"expected {expected}, found {' '.join(head[:3])[:40]}")
                seconds, nanoseconds, *values = _numbers(head[5].removesuffix(",").split(","), size)
                if not 0 <= nanoseconds < 1e9:
                    raise _Refused("time", f"expected 0 to 999999999 nanoseconds, found {nanoseconds:g}")
                if max(map(len, head[1:4])) > WORD:
                    raise _Refused("finger", f"expected hand, finger and task of at most {WORD} characters each")
                who[:] = head[:3]
            except _Refused as refused:
                _leave(left, path, number, refused)
                continue
            yield number, seconds + nanoseconds * 1e-9, values, head[3]

    frames, times, tasks = _frames(path, rows(), CAPFINGERID, left)
    runs = _runs(tasks)
    return Recordings(
        frames=frames,
        times=times,
        offsets=np.array([0, len(times)], np.int64),
        labels=np.array([SESSION]),
        subjects=np.array(who[:1]),
        kinds=np.array([f"{who[2]} finger, {who[1]} hand"]),
        event_recording=np.zeros(len(runs), np.int64),
        event_labels=np.array([UNNAMED] * len(runs), dtype="U5"),
        event_kinds=np.array([tasks[first].lower() for first, _ in runs], dtype="U40"),
        event_onsets=np.array([times[first] for first, _ in runs], np.float64),
        event_offsets=np.array([times[last] for _, last in runs], np.float64),
    ), left


def _runs(tasks: list[str]) -> list[tuple[int, int]]:
    """(first, last) frame of each stretch of one task; pauses are none."""
    starts = [k for k, task in enumerate(tasks) if not k or task != tasks[k - 1]]
    ends = [*(start - 1 for start in starts[1:]), len(tasks) - 1]
    return [(first, last) for first, last in zip(starts, ends, strict=True) if tasks[first] != PAUSE]


def _frames(
    path: Path, rows: Iterator[SourceRow], grid: tuple[int, int], left: list[LeftOut]
) -> tuple[NDArray[np.generic], NDArray[np.float64], list[str]]:
    """(T, R, C) frames, (T,) seconds from the first one on, and what else each row says."""
    times: list[float] = []
    values = array("d")
    last: list[float] = []
    more: list[str] = []
    for line, t, counts, text in rows:
        if times and t == times[-1] and counts == last:
            continue  # the same frame again
        if times and t <= times[-1]:
            _leave(left, path, line, _Refused("time", f"expected later than {times[-1]:.6f} s, found {t:.6f} s"))
            continue
        if len(values) + len(counts) > NUMBERS:
            raise RecordingError(f"{path}: line {line}: expected at most {NUMBERS} numbers in a file; split it")
        times.append(t)
        values.extend(counts)
        last = counts
        more.append(text)
    if len(times) < 2 or len(left) > len(times):
        first = f"; {left[0].reason} (line {left[0].line})" if left else ""
        raise RecordingError(f"{path}: expected frames, found {len(times)} and {len(left)} lines that are none{first}")
    stamps = np.array(times)
    return compact(np.frombuffer(values).reshape(-1, *grid)), stamps - stamps[0], more


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines that are not empty, with their numbers from 1. RecordingError for one that no frame needs."""
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
    if len(cells) != count:
        raise _Refused("line", f"expected {count} numbers, found {len(cells)}")
    found = [_number(cell) for cell in cells]
    for k, value in enumerate(found, 1):
        if value is None or not abs(value) <= LARGEST_COUNT:
            raise _Refused(f"number {k}", f"expected a finite number, found {cells[k - 1][:20]!r}")
    return [value for value in found if value is not None]


def _leave(left: list[LeftOut], path: Path, line: int, refused: _Refused) -> None:
    """Leave a line out. RecordingError where so many are bad that nobody needs a list of them."""
    field, text = refused.args
    if len(left) >= BAD_LINES:
        raise RecordingError(
            f"{path}: expected frames, found more than {BAD_LINES} lines that are none; {field}: {text}"
        )
    left.append(LeftOut(path, None, field, f"{field}: {text}", line))
