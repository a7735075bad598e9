"""What the contract says of a recording's fields, held against them."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.model.metadata import GESTURE_NAME
from gestured.record.recordings import Recordings

SESSION = "session"  # the label of a recording that holds many gestures, and marks for each
FINGERS = 3
MAX_FRAMES = 1 << 24  # of a file: twelve days at 15 Hz; checking their times takes a multiple of their size
RECORDINGS = 1 << 20  # of a file, and as many events; each of their texts is checked alone
CHARACTERS = 1024  # of one text
DAY = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}")
# What a field may hold: i and u integers, f floats, U text.
PER_RECORDING = {
    "labels": "U", "subjects": "iufU", "speeds": "iufU", "inclinations": "iufU", "kinds": "U", "consents": "U",
    "onsets": "iu", "releases": "iu",
}  # fmt: skip
EVENT_FIELDS = {
    "event_recording": "iu", "event_labels": "U", "event_kinds": "U", "event_onsets": "f", "event_offsets": "f",
}  # fmt: skip


class Wrong(Exception):
    """What is wrong with a field; the file's name is added outside."""

    def __init__(self, text: str, field: str = "") -> None:
        super().__init__(text)
        self.field = field


def check(r: Recordings) -> None:
    """Everything the contract says of the fields; raises Wrong."""
    check_all_but_frames(r)
    check_frames(r)


def check_all_but_frames(r: Recordings) -> None:
    """Everything but what the frames hold; raises Wrong."""
    structure(r)
    _values(r)


def check_frames(r: Recordings) -> None:
    """What the frames hold; raises Wrong."""
    if r.frames.dtype.kind == "f" and r.frames.size:
        low, high = r.frames.min(axis=(1, 2)), r.frames.max(axis=(1, 2))  # NaN is both
        owner = np.repeat(np.arange(len(r)), np.diff(r.offsets))
        _first("frames", np.isfinite(low) & np.isfinite(high), "finite values", owner)


def structure(r: Recordings) -> None:
    """What must hold for the fields to be told apart, recording by recording: types, shapes, who owns what.

    Raises Wrong with the field.
    """
    shapes(r)
    n, ends = len(r.frames), r.offsets
    if ends[0] != 0 or ends[-1] != n:
        text = f"offsets: expected int64 from 0 to {n} (the number of frames), found {ends[0]} to {ends[-1]}"
        raise Wrong(text, "offsets")
    _first("offsets", ends[1:] >= ends[:-1], "at least one frame")
    if r.event_recording is not None:
        g = len(ends) - 1
        _first("event_recording", (r.event_recording >= 0) & (r.event_recording < g), f"0 to {g - 1}", of="event")


def shapes(r: Recordings) -> None:
    """Types, shapes and numbers: what can be told before anything is unpacked. Raises Wrong with the field."""
    _shape("frames", r.frames, "iuf", (None, None, None))
    n, rows, columns = r.frames.shape
    if not (rows and columns):
        raise Wrong(f"frames: expected (N, R, C), found {r.frames.shape}", "frames")
    _at_most("frames", n, MAX_FRAMES)
    _shape("offsets", r.offsets, "i", (None,))
    g = len(r.offsets) - 1
    if r.offsets.dtype != np.int64 or g < 0:
        text = f"offsets: expected int64 from 0 to {n} (the number of frames), found {r.offsets.dtype}"
        raise Wrong(text, "offsets")
    _at_most("offsets", g, RECORDINGS)
    _shape("times", r.times, "f", (n,))
    if r.times.dtype != np.float64:
        raise Wrong(f"times: expected float64, found {r.times.dtype}", "times")
    for field, kinds in PER_RECORDING.items():
        value = getattr(r, field)
        if value is not None:
            _shape(field, value, kinds, (g,))
    if r.touches is not None or r.touch_ids is not None:
        if r.touches is None or r.touch_ids is None:
            raise Wrong("touches: expected together with touch_ids", "touches")
        _shape("touches", r.touches, "f", (n, FINGERS, 2))
        _shape("touch_ids", r.touch_ids, "i", (n, FINGERS))
        if r.touches.dtype != np.float32 or r.touch_ids.dtype != np.int32:
            raise Wrong("touches: expected float32, and int32 for touch_ids", "touches")
    present = [field for field in EVENT_FIELDS if getattr(r, field) is not None]
    if present:
        if len(present) < len(EVENT_FIELDS):
            raise Wrong(f"{present[0]}: expected together with all of {', '.join(EVENT_FIELDS)}", present[0])
        assert r.event_recording is not None
        e = len(r.event_recording)
        _at_most("event_recording", e, RECORDINGS)
        for field, kinds in EVENT_FIELDS.items():
            _shape(field, getattr(r, field), kinds, (e,))
            if kinds == "f" and getattr(r, field).dtype != np.float64:
                raise Wrong(f"{field}: expected float64, found {getattr(r, field).dtype}", field)


def _values(r: Recordings) -> None:
    """What the fields hold, once their structure is known to be right."""
    ends = r.offsets
    lengths = np.diff(ends)
    _first("offsets", lengths > 0, "at least one frame")
    owner = np.repeat(np.arange(len(lengths)), lengths)
    _first("times", np.isfinite(r.times), "finite seconds", owner)
    later = (np.diff(r.times) > 0) | (np.diff(owner) > 0)
    _first("times", later, "strictly increasing seconds", owner[1:])
    _labels("labels", r.labels)
    for field in ("subjects", "speeds", "inclinations", "kinds", "consents"):
        value = getattr(r, field)
        if value is not None:
            _text(field, value)
    if r.consents is not None:
        dated = np.array([not day or DAY.fullmatch(day) is not None for day in r.consents.tolist()], bool)
        _first("consents", dated, "a day such as 2026-01-31, or nothing")
    for field in ("onsets", "releases"):
        value = getattr(r, field)
        if value is not None:
            _first(field, (value >= 0) & (value < lengths), "a frame within the recording")
    if r.onsets is not None and r.releases is not None:
        _first("releases", r.releases >= r.onsets, "no frame before the onset")
    _touches(r, owner)
    _events(r)


def _touches(r: Recordings, owner: NDArray[np.int64]) -> None:
    if r.touches is None or r.touch_ids is None:
        return
    absent = r.touch_ids == -1
    _first("touch_ids", (absent | (r.touch_ids >= 0)).all(axis=1), "-1 for no finger, else 0 and up", owner)
    known = np.isfinite(r.touches).all(axis=2)
    nothing = np.isnan(r.touches).all(axis=2)
    _first(
        "touches",
        np.all(np.where(absent, nothing, known), axis=1),
        "NaN where the id is -1, else finite positions",
        owner,
    )


def _events(r: Recordings) -> None:
    if r.event_recording is None:
        return
    assert r.event_labels is not None and r.event_kinds is not None
    assert r.event_onsets is not None and r.event_offsets is not None
    _labels("event_labels", r.event_labels, of="event")
    _text("event_kinds", r.event_kinds)
    start = r.times[r.offsets[:-1]][r.event_recording]
    end = r.times[r.offsets[1:] - 1][r.event_recording]
    inside = (r.event_onsets >= start) & (r.event_onsets <= end)
    _first("event_onsets", inside, "a time within the recording", of="event")
    ordered = (r.event_offsets >= r.event_onsets) & (r.event_offsets <= end)
    _first("event_offsets", ordered, "a time from the onset to the recording's end", of="event")


def _shape(field: str, value: NDArray[Any], kinds: str, shape: tuple[int | None, ...]) -> None:
    names = {"i": "integers", "u": "unsigned integers", "f": "floats", "U": "text"}
    if value.dtype.kind not in kinds:
        raise Wrong(f"{field}: expected {' or '.join(names[k] for k in kinds)}, found {value.dtype}", field)
    if value.dtype.kind == "U" and value.dtype.itemsize > 4 * CHARACTERS:
        raise Wrong(f"{field}: expected text of at most {CHARACTERS} characters, found {value.dtype}", field)
    if len(value.shape) != len(shape) or any(
        want is not None and want != have for want, have in zip(shape, value.shape, strict=True)
    ):
        expected = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise Wrong(f"{field}: expected the shape {expected}, found {value.shape}", field)


def _at_most(field: str, count: int, limit: int) -> None:
    if count > limit:
        raise Wrong(f"{field}: expected at most {limit}, found {count}", field)


def _first(
    field: str,
    right: NDArray[Any],
    expected: str,
    owner: NDArray[np.int64] | None = None,
    *,
    of: str = "recording",
) -> None:
    """Raises for the first that is not right; `owner` leads from frames to recordings."""
    if not right.all():
        wrong = int(np.argmin(right))
        raise Wrong(f"{field} of {of} {wrong if owner is None else owner[wrong]}: expected {expected}", field)


def _labels(field: str, value: NDArray[np.str_], *, of: str = "recording") -> None:
    _text(field, value)
    right = np.array([GESTURE_NAME.fullmatch(label) is not None for label in value.tolist()], bool)
    _first(field, right, "1 to 64 of a-z, 0-9 and _", of=of)


def _text(field: str, value: NDArray[Any]) -> None:
    """Python would make broken strings of numbers that are no characters."""
    if value.dtype.kind == "U" and value.size:
        codes = np.ascontiguousarray(value).view(np.uint32)
        if ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any():
            raise Wrong(f"{field}: holds what is no text", field)
