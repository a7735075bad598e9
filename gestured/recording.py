"""Read and write recordings: the contract's .npz, without pickles, readable with NumPy alone.

A file may be damaged or hostile: its members are measured before they are unpacked, and every field is held
against the contract (`recording_check`). What is wrong is one `RecordingError`: file, field, recording, and what was
expected.
"""

import math
import os
import stat
import zipfile
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.core.frames import Frame, Touch
from gestured.files import PRIVATE, atomic_write
from gestured.recording_check import EVENTS, Wrong, check

MAX_BYTES = 2 << 30  # unpacked


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
    consents: NDArray[np.str_] | None = None  # (G,) day of the participant's consent, YYYY-MM-DD; "" is not known

    def __len__(self) -> int:
        return len(self.labels)

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

    def take(self, chosen: Sequence[int] | NDArray[np.integer[Any]]) -> "Recordings":
        """The chosen recordings, each at most once, in that order, with their frames and events."""
        index = np.asarray(chosen, np.int64)
        lengths = np.diff(self.offsets)[index]
        spans = [np.arange(self.offsets[i], self.offsets[i + 1]) for i in index]
        of_frames = np.concatenate(spans) if spans else index
        place = np.full(len(self), -1, np.int64)
        place[index] = np.arange(len(index))
        events = slice(0) if self.event_recording is None else place[self.event_recording] >= 0
        rows = {"frames": of_frames, "times": of_frames, "touches": of_frames, "touch_ids": of_frames}
        taken = {field: value[events if field in EVENTS else rows.get(field, index)] for field, value in _present(self)}
        taken["offsets"] = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        if self.event_recording is not None:
            taken["event_recording"] = place[taken["event_recording"]]
        return Recordings(**taken)

    def _span(self, i: int) -> slice:
        if not -len(self) <= i < len(self):
            raise IndexError(f"recording {i} of {len(self)}")
        return slice(int(self.offsets[i % len(self)]), int(self.offsets[i % len(self) + 1]))


_FIELDS = tuple(field.name for field in fields(Recordings))
_REQUIRED = _FIELDS[:5]


def read(path: str | Path) -> Recordings:
    """Read and check a file; RecordingError for what is no recording. It ignores unknown members."""
    try:
        found = load(path)
        check(found)
    except Wrong as error:
        raise RecordingError(f"{path}: {error}") from None
    return found


def write(path: str | Path, recordings: Recordings) -> None:
    """Check and write: all or nothing, the same bytes for the same recordings. Raises RecordingError."""
    path = Path(path)
    try:
        check(recordings)
        with atomic_write(path) as file:
            _pack(file, recordings)
    except Wrong as error:
        raise RecordingError(f"{path}: not written: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {_brief(error)}") from None


def _brief(error: BaseException) -> str:
    return getattr(error, "strerror", None) or " ".join(str(error).split())[:200] or type(error).__name__


def _present(recordings: Recordings) -> Iterator[tuple[str, NDArray[Any]]]:
    return ((f, value) for f in _FIELDS if (value := getattr(recordings, f)) is not None)


def load(path: str | Path, without: Collection[str] = ()) -> Recordings:
    """A file's fields as they stand there, not held against the contract, `without` some; raises Wrong."""
    try:
        # Non-blocking: opening a FIFO must not wait for a writer.
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise Wrong("is not a regular file")
            with zipfile.ZipFile(file) as archive:
                return Recordings(**_unpack(archive, without))
    except Wrong:
        raise
    except Exception as error:  # of a damaged file zipfile and NumPy's header parser raise a dozen types
        raise Wrong(f"cannot be read as a recording (.npz): {_brief(error)}") from None


def _unpack(archive: zipfile.ZipFile, without: Collection[str]) -> dict[str, NDArray[Any]]:
    """The fields' arrays. Nothing is unpacked before all of it is known to fit."""
    members: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        field = info.filename.removesuffix(".npy")
        if field in _FIELDS and field not in without and info.filename.endswith(".npy"):
            if field in members:
                raise Wrong(f"{field}: is there twice", field)
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise Wrong(f"{field}: expected it stored or deflated", field)
            members[field] = info
    missing = [field for field in _REQUIRED if field not in members]
    if missing:
        raise Wrong(f"{missing[0]}: is missing, expected the fields {', '.join(_REQUIRED)}", missing[0])
    total = sum(info.file_size for info in members.values())
    if total > MAX_BYTES:
        raise Wrong(f"unpacks to {total} bytes, expected at most {MAX_BYTES}")
    arrays = {}
    for field, info in members.items():
        try:
            with archive.open(info) as member:
                arrays[field] = _array(member, info.file_size)
        except Wrong as error:
            raise Wrong(f"{field}: {error}", field) from None
        except Exception as error:  # see `load`
            raise Wrong(f"{field}: is damaged: {_brief(error)}", field) from None
    return arrays


def _array(member: IO[bytes], size: int) -> NDArray[Any]:
    version = np.lib.format.read_magic(member)
    if version not in ((1, 0), (2, 0)):
        raise Wrong(f"expected version 1 or 2 of NumPy's format, found {version}")
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = read_header(member)
    if dtype.kind not in "iufU":
        raise Wrong(f"expected numbers or text, found {dtype}")
    count = math.prod(shape)
    if count < 0 or dtype.itemsize == 0 or count * dtype.itemsize > size:
        raise Wrong(f"the shape {shape} does not fit into its {size} bytes")
    data = member.read(count * dtype.itemsize + 1)
    if len(data) != count * dtype.itemsize:
        raise Wrong(f"expected {count * dtype.itemsize} bytes for the shape {shape}, found {len(data)}")
    array = np.frombuffer(data, dtype) if count else np.empty(0, dtype)
    array = array.reshape(shape, order="F" if fortran else "C")
    return np.asarray(array, dtype.newbyteorder("="))


def _pack(file: IO[bytes], recordings: Recordings) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        for field, value in _present(recordings):
            info = zipfile.ZipInfo(f"{field}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = PRIVATE << 16
            with archive.open(info, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(value), allow_pickle=False)
