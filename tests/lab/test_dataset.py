"""What is learned from: cut as the daemon cuts, kept once made, and nobody on two sides of a split."""

import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gestured
from gestured.core.errors import GesturedError
from gestured.core.events import Event
from gestured.core.facts import Decided
from gestured.core.frames import Frame, Segment
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab import dataset
from gestured.lab.dataset import (
    OTHER_TRIALS,
    STREAMS,
    TRIALS,
    Truth,
    cuts,
    from_take,
    in_processes,
    matched,
    recorded,
    simulated,
    with_idle,
)
from gestured.lab.samples import WINDOW, Sample, Samples, collect, join
from gestured.record.recordings import Recordings
from gestured.simulator import GESTURES, Participant, SimulatedSensor, Take, generator, gesture_take, session
from tests.core.test_sensor import Fake


def take_of(kind: str, person: int = 70) -> Take:
    return gesture_take(kind, Participant(person), SimulatedSensor.nominal(day=person), generator(person, 3))


def decided(found: list[Event | Decided]) -> list[Segment]:
    return [one.segment for one in found if isinstance(one, Decided)]


def test_what_is_learned_from_is_what_the_daemon_would_have_classified() -> None:
    take = session(Participant(71), SimulatedSensor.nominal(day=71), generator(71, 4), 40.0)
    heard: list[Segment] = []
    sure = Fake()
    sensor = Sensor("armrest", Scene(sure.gestures, take.frames.shape[1:]), sure)
    for t, values in zip(take.times, take.frames, strict=True):
        heard += decided(sensor.push(Frame(float(t), values)))
    heard += decided(sensor.flush(float(take.times[-1]) + 2))
    found = cuts(take.frames, take.times)
    assert len(found) == len(heard) > 5
    for ours, theirs in zip(found, heard, strict=True):
        assert np.array_equal(WINDOW.apply(ours), WINDOW.apply(theirs))
        assert (ours.onset, ours.offset, ours.noise) == (theirs.onset, theirs.offset, theirs.noise)


def test_a_session_gives_each_performance_its_own_name() -> None:
    kinds = ["swipe_up", "one_tap", "long_press", "circle_clockwise", "double_tap"]
    take = session(Participant(72), SimulatedSensor.nominal(day=72), generator(72, 4), 40.0, kinds=kinds)
    assert [kind for _, _, kind, *_ in from_take(take)] == kinds
    labels = [label for _, label, *_ in from_take(take)]
    assert labels == ["swipe_up", "one_tap", "none", "circle_clockwise", "double_tap"]


def test_a_recording_that_ends_with_a_tap_gives_it_up_to_the_end() -> None:
    take = take_of("one_tap")
    (event,) = take.events
    end = int(np.searchsorted(take.times, event.offset_s)) + 3
    whole, short = cuts(take.frames, take.times), cuts(take.frames[:end], take.times[:end])
    assert [(s.onset, s.offset) for s in short] == [(s.onset, s.offset) for s in whole]
    assert len(short) == 1


def segment(onset: float, offset: float) -> Segment:
    """Touched from onset to offset, at 15 Hz."""
    count = round((offset - onset) * 15) + 1
    frames = np.zeros((count + 2, 9, 9), np.float32)
    frames[1:-1, 4, 4] = 100
    return Segment(frames, onset + (np.arange(count + 2) - 1) / 15, 1, count, 2.0)


def named(found: Segment, *performed: Truth) -> list[str]:
    return [label for _, label, *_ in matched([found], performed)]


def test_a_segment_is_named_after_what_it_holds() -> None:
    swipe = Truth("swipe_up", "swipe_up", 1, 10.0, 11.0)
    palm = Truth("none", "palm", 1, 12.0, 13.0)
    assert named(segment(10.0, 11.0), swipe, palm) == ["swipe_up"]
    assert named(segment(12.2, 12.8), swipe, palm) == ["none"]
    assert named(segment(10.0, 10.2), swipe) == []  # a piece of a gesture is no example of it
    assert named(segment(20.0, 21.0), swipe, palm) == []  # nobody knows what that was
    assert named(segment(12.0, 12.1), palm) == ["none"]  # a piece of a non-gesture is none as well
    (found,) = matched([segment(10.0, 11.0)], [swipe])
    assert found.strength == pytest.approx(50)


# --- the streams ---


@pytest.mark.parametrize(("stream", "plan"), [("cohort", TRIALS), ("others", OTHER_TRIALS)])
def test_a_sample_carries_the_participant_of_its_plan(stream: str, plan: tuple[Any, ...]) -> None:
    for index in range(0, len(plan), 331):
        trial = plan[index]
        number, kind = (trial.participant, trial.gesture) if stream == "cohort" else trial[:2]
        for _, label, found, person, *_ in STREAMS[stream](0, index):
            assert (person % 1000, found) == (number, kind)
            assert label == (kind if kind in GESTURES else "none")


def same(a: Samples, b: Samples) -> None:
    for name in Samples.__slots__:
        x, y = getattr(a, name), getattr(b, name)
        assert (x.dtype, x.shape, x.tobytes()) == (y.dtype, y.shape, y.tobytes()), name


def test_what_is_simulated_once_is_not_simulated_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = simulated(tmp_path / "cache", "wide", 9, 6, jobs=1)
    same(made, collect(s for i in range(6) for s in STREAMS["wide"](9, i)))  # whoever makes them
    assert len(list((tmp_path / "cache").iterdir())) == 1

    def refuse(*_: object) -> None:
        raise InterruptedError("simulates")

    monkeypatch.setattr(multiprocessing, "get_context", refuse)
    again = simulated(tmp_path / "cache", "wide", 9, 6)
    same(made, again)
    assert again.digest() == made.digest()
    for stream, seed, count in (("wide", 8, 6), ("wide", 9, 7), ("others", 9, 6)):
        with pytest.raises(InterruptedError):
            simulated(tmp_path / "cache", stream, seed, count)


def short_day(seed: int, index: int) -> list[Sample]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dataset, "DAY_S", 90.0)
        return STREAMS["days"](seed, index)


def test_a_day_is_the_same_in_another_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one on any sensor, which is drawn apart from the day."""
    monkeypatch.setitem(STREAMS, "short", short_day)
    same(simulated(tmp_path, "short", 4, 1, jobs=1), collect(short_day(4, 0)))


def test_no_more_processes_start_than_there_are_pieces_of_work_and_what_they_make_comes_in_order() -> None:
    made = in_processes(abs, range(2), 5, "")
    assert (next(made), len(multiprocessing.active_children()), next(made)) == (0, 2, 1)


def test_ctrl_c_while_processes_start_makes_no_traceback(tmp_path: Path) -> None:
    """A terminal sends it to all of them, also before they have read what they are to do."""
    (tmp_path / "program.py").write_text(
        "import os, signal\n"
        "from gestured.lab.dataset import in_processes\n"
        "if __name__ == '__main__':\n"
        "    print(*in_processes(abs, [-1, -2], 2, ''))\n"
        "else:\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(gestured.__file__).parents[1])}
    done = subprocess.run([sys.executable, tmp_path / "program.py"], env=environment, capture_output=True, text=True)
    assert done.stdout == "1 2\n" and "Traceback" not in done.stderr


def test_ctrl_c_while_processes_start_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take a fifth of a second to start, and then work for hours."""
    spawn, start = type(multiprocessing.get_context("spawn")), multiprocessing.get_context("spawn").Pool

    def pool(_: object, jobs: int) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return start(jobs)

    monkeypatch.setattr(spawn, "Pool", pool)
    with pytest.raises(KeyboardInterrupt):
        list(in_processes(abs, range(2), 1, ""))
    assert multiprocessing.active_children() == []


def killed(number: int) -> int:
    """The work of a process that the system kills, as where memory runs out."""
    if number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_process_that_is_killed_ends_the_work() -> None:
    with pytest.raises(GesturedError, match="a process that --jobs started was killed"):
        list(in_processes(killed, range(3), 1, ""))
    assert multiprocessing.active_children() == []


def test_an_interrupted_simulation_is_not_taken_for_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> Iterator[list[Sample]]:
        yield STREAMS["wide"](9, 0)
        raise KeyboardInterrupt

    monkeypatch.setattr(dataset, "in_processes", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulated(tmp_path, "wide", 9, 3)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("damage", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: b"garbage"])
def test_what_is_kept_and_damaged_is_made_again(
    damage: Callable[[bytes], bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset, "in_processes", lambda make, todo, *_: map(make, todo))
    made = simulated(tmp_path, "wide", 9, 1)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    same(simulated(tmp_path, "wide", 9, 1), made)
    assert path.read_bytes() == whole


# --- putting sets together ---


@pytest.fixture(scope="module")
def samples() -> Samples:
    kinds = ("one_tap", "swipe_left", "palm", "circle_clockwise")
    return collect(s for kind in kinds for s in from_take(take_of(kind)))


def test_taking_and_joining_lose_nothing(samples: Samples) -> None:
    n = len(samples)
    same(join([samples.take(np.arange(2)), samples.take(np.arange(2, n))]), samples)
    backwards = samples.take(np.arange(n)[::-1].copy())
    for i in range(n):
        assert np.array_equal(backwards.window(n - 1 - i), samples.window(i))
        assert backwards.labels[n - 1 - i] == samples.labels[i]
    assert len(samples.take(np.zeros(n, bool))) == 0


def test_the_digest_sees_every_change(samples: Samples) -> None:
    other = samples.take(np.arange(len(samples)))
    assert other.digest() == samples.digest()
    other.frames[0, 0, 0] += 1
    assert other.digest() != samples.digest()
    assert samples.take(np.arange(len(samples))[::-1].copy()).digest() != samples.digest()


# --- recordings ---


def test_idle_frames_are_put_around_a_cut_recording() -> None:
    take = take_of("swipe_up")
    cut, at = take.frames[15:35], take.times[15:35]
    frames, times, lead = with_idle(cut, at, 5, 15, 1)
    assert np.array_equal(frames[lead : lead + len(cut)], cut)
    assert np.array_equal(times[lead : lead + len(cut)], at)
    assert len(frames) == len(times) == len(cut) + 2 * lead
    assert lead / 15 > 1  # the front end needs a second to know the sensor
    assert bool((np.diff(times) > 0).all())
    quiet = {frame.tobytes() for frame in [*cut[:4], *cut[18:]]}
    assert {frame.tobytes() for frame in [*frames[:lead], *frames[lead + len(cut) :]]} <= quiet


def recordings() -> Recordings:
    """Gestures cut out of takes with hardly anything around them, and a session."""
    frames, times, offsets, onsets, releases = [], [], [0], [], []
    kinds = ["swipe_up", "one_tap", "circle_clockwise", "long_press"]
    for kind in kinds:
        take = take_of(kind)
        (event,) = take.events
        inside = np.flatnonzero((take.times >= event.onset_s) & (take.times <= event.offset_s))
        chosen = slice(inside[0] - 5, inside[-1] + 6)
        frames.append(take.frames[chosen])
        times.append(take.times[chosen])
        offsets.append(offsets[-1] + len(frames[-1]))
        onsets.append(5)
        releases.append(5 + len(inside) - 1)
    return Recordings(
        np.concatenate(frames), np.concatenate(times), np.array(offsets), np.array([*kinds[:3], "none"]),
        np.arange(4), kinds=np.array(kinds), onsets=np.array(onsets), releases=np.array(releases),
    )  # fmt: skip


def test_cut_recordings_are_learned_under_their_own_names() -> None:
    found = recorded(recordings())
    assert found.labels.tolist() == ["swipe_up", "one_tap", "circle_clockwise", "none"]
    assert found.kinds.tolist() == ["swipe_up", "one_tap", "circle_clockwise", "long_press"]
    assert found.people.tolist() == [0, 1, 2, 3]
    for i in range(len(found)):
        assert found.window(i).max() == pytest.approx(1.0, abs=1e-3)


def test_people_may_have_names_and_kinds_need_not_be_known() -> None:
    found = recorded(replace(recordings(), subjects=np.array(["carla", "anna", "berta", "anna"]), kinds=None))
    assert found.people.tolist() == [2, 0, 1, 0]
    assert found.kinds.tolist() == ["swipe_up", "one_tap", "circle_clockwise", "none"]


def test_a_single_frame_is_no_gesture() -> None:
    one = {"offsets": np.array([0, 1]), "labels": np.array(["one_tap"]), "subjects": np.array([1])}
    marks = {"onsets": np.array([0]), "releases": np.array([0])}
    assert len(recorded(Recordings(np.ones((1, 9, 9)), np.zeros(1), **one, **marks))) == 0


def test_a_tap_of_a_single_frame_is_learned_like_any_other() -> None:
    """At 15 Hz many are: first and last touched frame are one."""
    frames = np.random.default_rng(5).normal(100, 2, (20, 9, 9)).astype(np.float32)
    y, x = np.mgrid[:9, :9]
    frames[10] += 500 * np.exp(-((y - 4) ** 2 + (x - 5) ** 2) / 2)
    found = recorded(Recordings(
        frames, np.arange(20) / 15, np.array([0, 20]), np.array(["one_tap"]), np.array([1]),
        kinds=np.array(["one_tap"]), onsets=np.array([10]), releases=np.array([10]),
    ))  # fmt: skip
    assert found.labels.tolist() == ["one_tap"]


def test_recorded_sessions_leave_out_what_nobody_named() -> None:
    kinds = ["swipe_up", "one_tap", "swipe_left", "circle_clockwise"]
    take = session(Participant(73), SimulatedSensor.nominal(day=73), generator(73, 4), 40.0, kinds=kinds)
    labels = ["swipe_up", "other", "swipe_left", "circle_clockwise"]
    found = recorded(Recordings(
        take.frames, take.times, np.array([0, len(take.frames)]), np.array(["session"]), np.array([3]),
        event_recording=np.zeros(4, int), event_labels=np.array(labels), event_kinds=np.array(kinds),
        event_onsets=np.array([e.onset_s for e in take.events]),
        event_offsets=np.array([e.offset_s for e in take.events]),
    ))  # fmt: skip
    assert found.labels.tolist() == ["swipe_up", "swipe_left", "circle_clockwise"]
    assert set(found.people.tolist()) == {3}
