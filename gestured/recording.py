"""Read and write recordings: the contract's .npz, without pickles, readable with NumPy alone.

A file may be damaged or hostile: its members are measured before they are unpacked, and every field is held
against the contract. What is wrong is one `RecordingError`: file, field, recording, and what was expected.
"""

import math
import os
import re
import stat
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.core.frames import Frame, Touch

MAX_BYTES = 2 << 30  # unpacked
FINGERS = 3
LABEL = re.compile(r"[a-z0-9_]{1,64}")
EVENTS = ("event_recording", "event_labels", "event_kinds", "event_onsets", "event_offsets")


@dataclass(frozen=True, eq=False)
class Recordings:
    """G recordings of one grid, N frames in all; `len` is G. Fields as in the contract; None is not known."""

    frames: NDArray[Any]  # (N, R, C) raw counts
    times: NDArray[np.float64]  # (N,) s, strictly increasing within a recording
    offsets: NDArray[np.int64]  # (G+1,) recording g is frames[offsets[g]:offsets[g+1]]
    labels: NDArray[np.str_]  # (G,) a gesture, "none" or "session"
    subjects: NDArray[Any]  # (G,) numbers or names
    speeds: NDArray[Any] | None = None  # (G,) numbers or names
    inclinations: NDArray[Any] | None = None  # (G,) numbers or names
    kinds: NDArray[np.str_] | None = None  # (G,) the finer name
    onsets: NDArray[np.integer[Any]] | None = None  # (G,) frame within the recording: first touched
    releases: NDArray[np.integer[Any]] | None = None  # (G,) last touched
    touches: NDArray[np.float32] | None = None  # (N, 3, 2) x, y; NaN for no finger
    touch_ids: NDArray[np.int32] | None = None  # (N, 3), -1 for no finger
    event_recording: NDArray[np.integer[Any]] | None = None  # (E,) what was performed, in which recording
    event_labels: NDArray[np.str_] | None = None  # (E,)
    event_kinds: NDArray[np.str_] | None = None  # (E,)
    event_onsets: NDArray[np.float64] | None = None  # (E,) s on the recording's times
    event_offsets: NDArray[np.float64] | None = None  # (E,) s

    def __len__(self) -> int:
        return len(self.labels)

    def __iter__(self) -> Iterator[tuple[NDArray[Any], NDArray[np.float64], str]]:
        """Frames (T, R, C), times (T,) and label of each recording."""
        return ((self.frames_of(i), self.times_of(i), str(self.labels[i])) for i in range(len(self)))

    def frames_of(self, i: int) -> NDArray[Any]:
        """(T, R, C) raw counts of recording i; IndexError where there is none."""
        return self.frames[self._span(i)]

    def times_of(self, i: int) -> NDArray[np.float64]:
        """(T,) seconds of recording i; IndexError where there is none."""
        return self.times[self._span(i)]

    def stream(self, i: int) -> Iterator[Frame]:
        """Recording i as the front end takes it, with its touches."""
        span = self._span(i)
        for n in range(span.start, span.stop):
            touches: tuple[Touch, ...] = ()
            if self.touches is not None and self.touch_ids is not None:
                touches = tuple(
                    Touch(int(k), float(x), float(y))
                    for k, (x, y) in zip(self.touch_ids[n], self.touches[n], strict=True)
                    if k >= 0
                )
            yield Frame(float(self.times[n]), self.frames[n], touches)

    def take(self, which: NDArray[Any] | Sequence[int]) -> "Recordings":
        """The recordings of a mask (G,) or of a list of indices, in that order, with their events."""
        chosen = np.asarray(which)
        if chosen.dtype == bool and chosen.shape != (len(self),):
            raise ValueError(
                f"a mask must have one value per recording: expected ({len(self)},), {chosen.shape}"
            )
        index = np.arange(len(self))[chosen.astype(np.int64) if not chosen.size else chosen]
        rows = _joined([np.arange(*self.offsets[[g, g + 1]]) for g in index])
        lengths = np.diff(self.offsets)[index]
        changed: dict[str, Any] = {"offsets": np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)}
        if self.event_recording is not None:
            of = [np.flatnonzero(self.event_recording == g) for g in index]
            events = _joined(of)
            changed["event_recording"] = np.repeat(np.arange(len(index)), [len(e) for e in of]).astype(
                np.int32
            )
        for field, value in _present(self):
            if field not in changed:
                by = rows if field in _FRAMEWISE else events if field in EVENTS else index
                changed[field] = value[by]
        return replace(self, **changed)

    def _span(self, i: int) -> slice:
        if not -len(self) <= i < len(self):
            raise IndexError(f"recording {i} of {len(self)}")
        return slice(int(self.offsets[i % len(self)]), int(self.offsets[i % len(self) + 1]))


_FIELDS = tuple(field.name for field in fields(Recordings))
_REQUIRED = _FIELDS[:5]
_FRAMEWISE = ("frames", "times", "touches", "touch_ids")


def read(path: str | Path) -> Recordings:
    """Read and check a file; RecordingError for what is no recording. It ignores unknown members."""
    try:
        found = _load(path)
        _check(found)
    except _Wrong as error:
        raise RecordingError(f"{path}: {error}") from None
    return found


def write(path: str | Path, recordings: Recordings) -> None:
    """Check and write: all or nothing, the same bytes for the same recordings. Raises RecordingError."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        _check(recordings)
        try:
            with temporary.open("wb") as file:
                _pack(file, recordings)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except _Wrong as error:
        raise RecordingError(f"{path}: not written: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {_brief(error)}") from None


def concatenate(parts: Sequence[Recordings]) -> Recordings:
    """All recordings in one, in order; fields that not every part has are left out. Raises RecordingError."""
    grids = {part.frames.shape[1:] for part in parts}
    if len(grids) != 1:
        raise RecordingError(f"cannot be joined: expected recordings of one grid, found {sorted(grids)}")
    joined: dict[str, Any] = {}
    for field in _FIELDS:
        arrays = [getattr(part, field) for part in parts]
        if any(array is None for array in arrays):
            continue
        if field == "offsets":
            ends = np.cumsum([0] + [len(part.frames) for part in parts])
            arrays = [arrays[0][:1], *(a[1:] + end for a, end in zip(arrays, ends, strict=False))]
        if field == "event_recording":
            starts = np.cumsum([0] + [len(part) for part in parts])
            arrays = [(a + start).astype(np.int32) for a, start in zip(arrays, starts, strict=False)]
        if len({array.dtype.kind == "U" for array in arrays}) > 1:
            arrays = [array.astype(str) for array in arrays]  # numbers here, names there
        joined[field] = np.concatenate(arrays)
    return Recordings(**joined)


class _Wrong(Exception):
    """What is wrong with a field; the file's name is added outside."""


def _brief(error: BaseException) -> str:
    return getattr(error, "strerror", None) or " ".join(str(error).split())[:200] or type(error).__name__


def _present(recordings: Recordings) -> Iterator[tuple[str, NDArray[Any]]]:
    return ((f, value) for f in _FIELDS if (value := getattr(recordings, f)) is not None)


def _joined(parts: list[NDArray[Any]]) -> NDArray[np.int64]:
    return np.concatenate([np.zeros(0, np.int64), *parts])


def _load(path: str | Path) -> Recordings:
    try:
        # Non-blocking: opening a FIFO must not wait for a writer.
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise _Wrong("is not a regular file")
            with zipfile.ZipFile(file) as archive:
                return Recordings(**_unpack(archive))
    except _Wrong:
        raise
    except Exception as error:  # of a damaged file zipfile and NumPy's header parser raise a dozen types
        raise _Wrong(f"cannot be read as a recording (.npz): {_brief(error)}") from None


def _unpack(archive: zipfile.ZipFile) -> dict[str, NDArray[Any]]:
    """The fields' arrays. Nothing is unpacked before all of it is known to fit."""
    members: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        field = info.filename.removesuffix(".npy")
        if field in _FIELDS and info.filename.endswith(".npy"):
            if field in members:
                raise _Wrong(f"{field}: is there twice")
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise _Wrong(f"{field}: expected it stored or deflated")
            members[field] = info
    missing = [field for field in _REQUIRED if field not in members]
    if missing:
        raise _Wrong(f"{missing[0]}: is missing, expected the fields {', '.join(_REQUIRED)}")
    total = sum(info.file_size for info in members.values())
    if total > MAX_BYTES:
        raise _Wrong(f"unpacks to {total} bytes, expected at most {MAX_BYTES}")
    arrays = {}
    for field, info in members.items():
        try:
            with archive.open(info) as member:
                arrays[field] = _array(member, info.file_size)
        except _Wrong as error:
            raise _Wrong(f"{field}: {error}") from None
        except Exception as error:  # see _load
            raise _Wrong(f"{field}: is damaged: {_brief(error)}") from None
    return arrays


def _array(member: IO[bytes], size: int) -> NDArray[Any]:
    version = np.lib.format.read_magic(member)
    if version not in ((1, 0), (2, 0)):
        raise _Wrong(f"expected version 1 or 2 of NumPy's format, found {version}")
    read_header = (
        np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    )
    shape, fortran, dtype = read_header(member)
    if dtype.kind not in "iufU":
        raise _Wrong(f"expected numbers or text, found {dtype}")
    count = math.prod(shape)
    if count < 0 or dtype.itemsize == 0 or count * dtype.itemsize > size:
        raise _Wrong(f"the shape {shape} does not fit into its {size} bytes")
    data = member.read(count * dtype.itemsize + 1)
    if len(data) != count * dtype.itemsize:
        raise _Wrong(f"expected {count * dtype.itemsize} bytes for the shape {shape}, found {len(data)}")
    array = np.frombuffer(data, dtype) if count else np.empty(0, dtype)
    array = array.reshape(shape, order="F" if fortran else "C")
    return np.asarray(array, dtype.newbyteorder("="))


def _pack(file: IO[bytes], recordings: Recordings) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        for field, value in _present(recordings):
            info = zipfile.ZipInfo(f"{field}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            with archive.open(info, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(value), allow_pickle=False)


def _check(r: Recordings) -> None:
    """Everything the contract says of the fields; raises _Wrong."""
    _shape("frames", r.frames, "iuf", (None, None, None))
    n, rows, columns = r.frames.shape
    if not (rows and columns):
        raise _Wrong(f"frames: expected (N, R, C), found {r.frames.shape}")
    _shape("offsets", r.offsets, "i", (None,))
    ends = r.offsets
    if r.offsets.dtype != np.int64 or not len(ends) or ends[0] != 0 or ends[-1] != n:
        raise _Wrong(f"offsets: expected int64 from 0 to {n} (the number of frames), found {r.offsets.dtype}")
    _first("offsets", ends[1:] > ends[:-1], "at least one frame")
    g = len(ends) - 1
    owner = np.repeat(np.arange(g), np.diff(ends))

    _shape("times", r.times, "f", (n,))
    if r.times.dtype != np.float64:
        raise _Wrong(f"times: expected float64, found {r.times.dtype}")
    _first("times", np.isfinite(r.times), "finite seconds", owner)
    later = (np.diff(r.times) > 0) | (np.diff(owner) > 0)
    _first("times", later, "strictly increasing seconds", owner[1:])
    if r.frames.dtype.kind == "f":
        _first("frames", np.isfinite(r.frames).all(axis=(1, 2)), "finite values", owner)

    _labels("labels", r.labels, g)
    for field in ("subjects", "speeds", "inclinations", "kinds"):
        value = getattr(r, field)
        if value is not None:
            _shape(field, value, "U" if field == "kinds" else "iufU", (g,))
            _text(field, value)
    for field in ("onsets", "releases"):
        value = getattr(r, field)
        if value is not None:
            _shape(field, value, "iu", (g,))
            _first(field, (value >= 0) & (value < np.diff(ends)), "a frame within the recording")
    if r.onsets is not None and r.releases is not None:
        _first("releases", r.releases >= r.onsets, "no frame before the onset")
    _check_touches(r, n, owner)
    _check_events(r, g)


def _check_touches(r: Recordings, n: int, owner: NDArray[np.int64]) -> None:
    if r.touches is None and r.touch_ids is None:
        return
    if r.touches is None or r.touch_ids is None:
        raise _Wrong("touches: expected together with touch_ids")
    _shape("touches", r.touches, "f", (n, FINGERS, 2))
    _shape("touch_ids", r.touch_ids, "i", (n, FINGERS))
    if r.touches.dtype != np.float32 or r.touch_ids.dtype != np.int32:
        raise _Wrong("touches: expected float32, and int32 for touch_ids")
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


def _check_events(r: Recordings, g: int) -> None:
    present = [field for field in EVENTS if getattr(r, field) is not None]
    if not present:
        return
    if len(present) < len(EVENTS):
        raise _Wrong(f"{present[0]}: expected together with all of {', '.join(EVENTS)}")
    assert r.event_recording is not None and r.event_labels is not None and r.event_kinds is not None
    assert r.event_onsets is not None and r.event_offsets is not None
    e = len(r.event_recording)
    _shape("event_recording", r.event_recording, "iu", (e,))
    _first("event_recording", (r.event_recording >= 0) & (r.event_recording < g), f"0 to {g - 1}", of="event")
    _labels("event_labels", r.event_labels, e, of="event")
    _shape("event_kinds", r.event_kinds, "U", (e,))
    _text("event_kinds", r.event_kinds)
    for field, value in (("event_onsets", r.event_onsets), ("event_offsets", r.event_offsets)):
        _shape(field, value, "f", (e,))
        if value.dtype != np.float64:
            raise _Wrong(f"{field}: expected float64, found {value.dtype}")
    start = r.times[r.offsets[:-1]][r.event_recording]
    end = r.times[r.offsets[1:] - 1][r.event_recording]
    inside = (r.event_onsets >= start) & (r.event_onsets <= end)
    _first("event_onsets", inside, "a time within the recording", of="event")
    ordered = (r.event_offsets >= r.event_onsets) & (r.event_offsets <= end)
    _first("event_offsets", ordered, "a time from the onset to the recording's end", of="event")


def _shape(field: str, value: NDArray[Any], kinds: str, shape: tuple[int | None, ...]) -> None:
    names = {"i": "integers", "u": "unsigned integers", "f": "floats", "U": "text"}
    if value.dtype.kind not in kinds:
        raise _Wrong(f"{field}: expected {' or '.join(names[k] for k in kinds)}, found {value.dtype}")
    if len(value.shape) != len(shape) or any(
        want is not None and want != have for want, have in zip(shape, value.shape, strict=True)
    ):
        expected = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise _Wrong(f"{field}: expected the shape {expected}, found {value.shape}")


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
        raise _Wrong(f"{field} of {of} {wrong if owner is None else owner[wrong]}: expected {expected}")


def _labels(field: str, value: NDArray[np.str_], count: int, *, of: str = "recording") -> None:
    _shape(field, value, "U", (count,))
    _text(field, value)
    right = np.array([LABEL.fullmatch(label) is not None for label in value.tolist()], bool)
    _first(field, right, "1 to 64 of a-z, 0-9 and _", of=of)


def _text(field: str, value: NDArray[Any]) -> None:
    """Python would make broken strings of numbers that are no characters."""
    if value.dtype.kind == "U" and value.size:
        codes = np.ascontiguousarray(value).view(np.uint32)
        if ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any():
            raise _Wrong(f"{field}: holds what is no text")
