"""Recordings: what is written is read again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gestured.core.frames import Touch
from gestured.record.arrays import read, write
from gestured.record.recordings import Recordings
from tests.small_recording import example, same, session

FRAMES = (np.uint8, np.uint16, np.int16, np.int32, np.float16, np.float32, np.float64, np.dtype(">u2"))


@st.composite
def any_recordings(draw: st.DrawFn) -> Recordings:
    lengths = draw(st.lists(st.integers(1, 5), max_size=5))
    n, g = sum(lengths), len(lengths)
    grid = draw(st.tuples(st.integers(2, 4), st.integers(2, 4)))
    dtype = np.dtype(draw(st.sampled_from(FRAMES)))
    width = 16 if dtype.itemsize == 2 else 32  # a float64 holds more than a sensor can send
    floats = st.floats(allow_nan=False, allow_infinity=False, width=width)  # type: ignore[arg-type]
    elements = floats if dtype.kind == "f" else hnp.from_dtype(dtype)
    frames = draw(hnp.arrays(dtype, (n, *grid), elements=elements))
    labels = st.text("abcxyz019_", min_size=1, max_size=64)
    text = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=5)
    starts = draw(hnp.arrays(np.float64, g, elements=st.floats(-1e6, 1e6)))
    return Recordings(
        frames=frames,
        times=np.concatenate([np.zeros(0), *(s + np.arange(t) / 7 for s, t in zip(starts, lengths, strict=True))]),
        offsets=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        labels=np.array(draw(st.lists(labels, min_size=g, max_size=g)), str),
        subjects=np.array(draw(st.lists(text, min_size=g, max_size=g)), str),
        speeds=draw(st.none() | hnp.arrays(np.float64, g)),
        kinds=draw(st.none() | st.lists(text, min_size=g, max_size=g).map(lambda x: np.array(x, str))),
    )


@settings(max_examples=50)
@given(any_recordings())
def test_what_is_written_is_read_again(tmp_path_factory: pytest.TempPathFactory, recordings: Recordings) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.npz"
    write(path, recordings)
    found = read(path)
    same(found, recordings)
    assert found.frames.dtype == recordings.frames.dtype.newbyteorder("=")


@pytest.mark.parametrize("recordings", [example(), session()])
def test_numpy_alone_reads_what_is_written(tmp_path: Path, recordings: Recordings) -> None:
    write(tmp_path / "r.npz", recordings)
    with np.load(tmp_path / "r.npz", allow_pickle=False) as found:
        same(recordings, Recordings(**found))
    same(recordings, read(tmp_path / "r.npz"))


def test_the_same_recordings_are_the_same_bytes(tmp_path: Path) -> None:
    write(tmp_path / "a.npz", session())
    write(tmp_path / "b.npz", read(tmp_path / "a.npz"))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_recordings_are_given_one_by_one() -> None:
    recordings = example()
    assert len(recordings) == 2
    np.testing.assert_array_equal(recordings.frames_of(1), recordings.frames[4:])
    np.testing.assert_array_equal(recordings.times_of(1), recordings.times[4:])
    assert [len(recordings.frames_of(i)) for i in (0, 1, -1, -2)] == [4, 6, 6, 4]
    with pytest.raises(IndexError):
        recordings.frames_of(2)
    with pytest.raises(IndexError):
        recordings.times_of(-3)


def test_stream_gives_what_the_front_end_takes() -> None:
    frames = list(example().stream(1))
    assert [frame.t for frame in frames] == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert [frame.touches for frame in frames] == [(), (Touch(7, 2.0, 1.5),), (), (), (), ()]
    np.testing.assert_array_equal(frames[0].values, example().frames[4])
    without = replace(example(), touches=None, touch_ids=None)
    assert all(frame.touches == () for frame in without.stream(1))
