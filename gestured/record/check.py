"""The check of a recording's fields against the contract."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.address import SIDES
from gestured.model.metadata import GESTURE_NAME
from gestured.record.recordings import EVENT, FINGERS, Recordings

SESSION = "session"  # the label of a recording that holds many gestures, and marks for each
MAX_FRAMES = 1 << 24  # of a file: twelve days at 15 Hz; to check their times takes a multiple of their memory
RECORDINGS = 1 << 20  # of a file, and as many events; bounded since each of their texts is checked alone
CHARACTERS = 1024  # of one text
RATES_HZ = 2.0, 2500.0  # frames a second; a sensor sends 5 to 1000, and another unit is a factor of 1000
LATEST_S = 1e11  # s, the latest time of a frame: the year 5138; times in ms since 1970 are larger, and so refused
LARGEST = float(np.finfo(np.float32).max)  # counts, as a sensor can send them
DAY = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}")
# The form of a field's values, and its shape: N frames of R x C taxels, G recordings, E performances.
INTEGERS, COUNTS, ANY, TEXT = "integers", "integers or floats", "numbers or text", "text"
FORMS: dict[str, tuple[str, tuple[str | int, ...]]] = {
    "frames": (COUNTS, ("N", "R", "C")),
    "times": ("float64", ("N",)),
    "offsets": ("int64", ("G + 1",)),
    "labels": (TEXT, ("G",)),
    "subjects": (ANY, ("G",)),
    "speeds": (ANY, ("G",)),
    "inclinations": (ANY, ("G",)),
    "kinds": (TEXT, ("G",)),
    "onsets": (INTEGERS, ("G",)),
    "releases": (INTEGERS, ("G",)),
    "touches": ("float32", ("N", FINGERS, 2)),
    "touch_ids": ("int32", ("N", FINGERS)),
    "event_recording": (INTEGERS, ("E",)),
    "event_labels": (TEXT, ("E",)),
    "event_kinds": (TEXT, ("E",)),
    "event_onsets": ("float64", ("E",)),
    "event_offsets": ("float64", ("E",)),
    "sensors": (TEXT, ("G",)),
    "consents": (TEXT, ("G",)),
}
DTYPE_KINDS = {INTEGERS: "iu", COUNTS: "iuf", ANY: "iufU", TEXT: "U"}  # NumPy's, by form; any other form is a dtype
EVENT_FIELDS = tuple(field for field in FORMS if field.startswith(EVENT))
MOST = {"frames": MAX_FRAMES, "offsets": RECORDINGS + 1, "event_recording": RECORDINGS}

Right = tuple[str, NDArray[Any], str, NDArray[np.int64] | None]  # field, which are right, expected, whose they are


class Wrong(Exception):
    """What is wrong with a recording; the text begins with the field, and the file's name is added outside."""


def check(r: Recordings) -> None:
    """Check the fields against all rules of the contract; raises Wrong."""
    _shapes(r)
    n, first, last = len(r.frames), r.offsets[0], r.offsets[-1]
    if (first, last) != (0, n):
        raise Wrong(f"offsets: expected from 0 to {n}, the number of frames, found {first} to {last}")
    for field, value in r.present():
        if value.dtype.kind == "U" and value.size:  # numbers that are no characters would make broken strings
            codes = np.ascontiguousarray(value).view(np.uint32)
            if ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any():
                raise Wrong(f"{field}: holds characters that are none")
    for rules in (_offsets, _values, _frames, _touches, _events):
        for field, right, expected, owner in rules(r):
            if not right.all():
                wrong = int(np.argmin(right))
                of = "event" if field in EVENT_FIELDS else "recording"
                raise Wrong(f"{field} of {of} {wrong if owner is None else owner[wrong]}: expected {expected}")


def no_seconds(times: NDArray[np.float64]) -> str:
    """What is wrong with the rate of frames at (T,) s, as where these are milliseconds; empty if nothing is."""
    steps = np.diff(times)
    # No pause lengthens the short steps, and frames that arrive together do not shorten the mean.
    if not len(steps) or (
        (rate := 1 / np.quantile(steps, 0.1)) >= RATES_HZ[0] and (rate := 1 / steps.mean()) <= RATES_HZ[1]
    ):
        return ""
    return f"expected {RATES_HZ[0]:g} to {RATES_HZ[1]:g} frames a second, found {rate:.3g}"


def _shapes(r: Recordings) -> None:
    """Check types, shapes and sizes, on which all other rules rely; raises Wrong."""
    if r.frames.ndim != 3 or not all(SIDES[0] <= side <= SIDES[1] for side in r.frames.shape[1:]):
        sides = f"R and C from {SIDES[0]} to {SIDES[1]}"
        raise Wrong(f"frames: expected the shape (N, R, C), {sides}, found {r.frames.shape}")
    if r.offsets.ndim != 1 or not len(r.offsets):
        raise Wrong(f"offsets: expected the shape (G + 1), found {r.offsets.shape}")
    n, rows, columns = r.frames.shape
    e = 0 if r.event_recording is None else r.event_recording.size
    sizes = {"N": n, "R": rows, "C": columns, "G": len(r.offsets) - 1, "G + 1": len(r.offsets), "E": e}
    for field, value in r.present():
        form, names = FORMS[field]
        if value.dtype.kind not in DTYPE_KINDS.get(form, "") and value.dtype != form:
            raise Wrong(f"{field}: expected {form}, found {value.dtype}")
        if value.dtype.kind == "U" and value.dtype.itemsize > 4 * CHARACTERS:
            raise Wrong(f"{field}: expected text of at most {CHARACTERS} characters, found {value.dtype}")
        expected = tuple(name if isinstance(name, int) else sizes[name] for name in names)
        if value.shape != expected:
            raise Wrong(f"{field}: expected the shape {expected}, found {value.shape}")
        if len(value) > MOST.get(field, len(value)):
            raise Wrong(f"{field}: expected at most {MOST[field]}, found {len(value)}")
    for group in (("touches", "touch_ids"), EVENT_FIELDS):
        present = [field for field in group if getattr(r, field) is not None]
        if missing := [field for field in group if present and field not in present]:
            raise Wrong(f"{present[0]}: expected together with {', '.join(missing)}")


def _owner(r: Recordings) -> NDArray[np.int64]:
    """(N,) the recording of each frame."""
    return np.repeat(np.arange(len(r)), np.diff(r.offsets))


def _offsets(r: Recordings) -> Iterator[Right]:
    yield "offsets", np.diff(r.offsets) > 0, "at least one frame", None


def _frames(r: Recordings) -> Iterator[Right]:
    if r.frames.dtype.kind == "f" and r.frames.size:
        low, high = (ends(r.frames, axis=(1, 2)).astype(np.float64) for ends in (np.min, np.max))  # NaN if any is
        yield "frames", np.isfinite(low) & np.isfinite(high), "finite values", _owner(r)
        yield "frames", (low >= -LARGEST) & (high <= LARGEST), "values that a float32 holds", _owner(r)


def _values(r: Recordings) -> Iterator[Right]:
    lengths, owner = np.diff(r.offsets), _owner(r)
    yield "times", np.isfinite(r.times), "finite seconds", owner
    yield "times", np.abs(r.times) <= LATEST_S, f"seconds, at most {LATEST_S:g}", owner
    later = np.asarray((np.diff(r.times) > 0) | (np.diff(owner) > 0))
    yield "times", later, "strictly increasing seconds", owner[1:]
    yield "labels", _match(GESTURE_NAME, r.labels), "1 to 64 of a-z, 0-9 and _", None
    if r.consents is not None:
        dated = np.asarray(r.consents == "") | _match(DAY, r.consents)
        yield "consents", dated, "a day such as 2026-01-31, or nothing", None
    for field in ("onsets", "releases"):
        if (value := getattr(r, field)) is not None:
            yield field, (value >= 0) & (value < lengths), "a frame within the recording", None
    if r.onsets is not None and r.releases is not None:
        yield "releases", r.releases >= r.onsets, "no frame before the onset", None


def _touches(r: Recordings) -> Iterator[Right]:
    if r.touches is None or r.touch_ids is None:
        return
    owner, absent = _owner(r), r.touch_ids == -1
    yield "touch_ids", (absent | (r.touch_ids >= 0)).all(axis=1), "-1 for no finger, else 0 and up", owner
    known, nothing = np.isfinite(r.touches).all(axis=2), np.isnan(r.touches).all(axis=2)
    right = np.asarray(np.where(absent, nothing, known).all(axis=1))
    yield "touches", right, "NaN where the id is -1, else finite positions", owner


def _events(r: Recordings) -> Iterator[Right]:
    if r.event_recording is None or r.event_labels is None or r.event_onsets is None or r.event_offsets is None:
        return
    of, last = r.event_recording, len(r) - 1
    yield "event_recording", (of >= 0) & (of <= last), f"0 to {last}", None
    yield "event_labels", _match(GESTURE_NAME, r.event_labels), "1 to 64 of a-z, 0-9 and _", None
    start, end = r.times[r.offsets[:-1]][of], r.times[r.offsets[1:] - 1][of]
    onsets, offsets = r.event_onsets, r.event_offsets
    yield "event_onsets", (onsets >= start) & (onsets <= end), "a time within the recording", None
    yield "event_offsets", (offsets >= onsets) & (offsets <= end), "a time from the onset to the recording's end", None


def _match(pattern: re.Pattern[str], texts: NDArray[np.str_]) -> NDArray[np.bool_]:
    return np.array([pattern.fullmatch(text) is not None for text in texts.tolist()], bool)
