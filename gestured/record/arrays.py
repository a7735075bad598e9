"""Read and write recordings: the contract's .npz, without pickles, readable with NumPy alone.

A file may be damaged or hostile: its members are measured before they are unpacked (`npz`), and every field is held
against the contract (`recording_check`), the frames last. What is wrong is one `RecordingError`: file, field,
recording, and what was expected.
"""

import zipfile
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.core.frames import Frame, Touch
from gestured.record.check import EVENTS, Wrong, check, check_all_but_frames, check_frames, shapes, structure
from gestured.record.files import PRIVATE, atomic_write, open_regular
from gestured.record.npz import Archive, brief

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
_KNOWN = frozenset(_FIELDS)
_REQUIRED = _FIELDS[:5]


def read(path: str | Path) -> Recordings:
    """Read and check a file; RecordingError for what is no recording. It ignores unknown members."""
    try:
        found = load(path, look=check_all_but_frames)
        check_frames(found)
    except Wrong as error:
        raise RecordingError(f"{path}: {error}") from None
    return found


def write(path: str | Path, recordings: Recordings) -> None:
    """Check and write: all or nothing, the same bytes for the same recordings. Raises RecordingError."""
    path = Path(path)
    try:
        check(recordings)
        total = sum(value.nbytes for _, value in _present(recordings))
        if total > MAX_BYTES:
            raise Wrong(f"unpacks to {total} bytes, expected at most {MAX_BYTES}")
        with atomic_write(path) as file:
            _pack(file, recordings)
    except Wrong as error:
        raise RecordingError(f"{path}: not written: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {brief(error)}") from None


def _present(recordings: Recordings) -> Iterator[tuple[str, NDArray[Any]]]:
    return ((f, value) for f in _FIELDS if (value := getattr(recordings, f)) is not None)


def load(path: str | Path, without: Collection[str] = (), look: Callable[[Recordings], None] = structure) -> Recordings:
    """A file's fields as they stand there, `without` some; raises Wrong.

    They are held against nothing but `look`, which gets zeros for the frames: those are unpacked last.
    """
    try:
        with open_regular(path) as file:
            archive = Archive(file, _KNOWN.difference(without), MAX_BYTES)
            forms = {field: header.stand_in() for field, header in archive.headers.items()}
            missing = [field for field in _REQUIRED if field not in forms]
            if missing:
                raise Wrong(f"{missing[0]}: is missing, expected the fields {', '.join(_REQUIRED)}", missing[0])
            shapes(Recordings(**forms))
            fields = {field: archive.array(field) for field in forms if field != "frames"}
            look(Recordings(frames=forms["frames"], **fields))
            return Recordings(frames=archive.array("frames"), **fields)
    except Wrong:
        raise
    except Exception as error:  # of a damaged file zipfile raises a dozen types
        raise Wrong(f"cannot be read as a recording (.npz): {brief(error)}") from None


def _pack(file: IO[bytes], recordings: Recordings) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        for field, value in _present(recordings):
            info = zipfile.ZipInfo(f"{field}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = PRIVATE << 16
            with archive.open(info, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(value), allow_pickle=False)
