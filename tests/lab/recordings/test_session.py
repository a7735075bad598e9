"""How a session answers to takes and keys, with a scripted person and a sensor that feels what the test says."""

import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from gestured.lab.recordings import collect as module
from gestured.lab.recordings.collect import Session
from gestured.lab.recordings.protocol import left, order
from gestured.lab.recordings.quality import Captured
from gestured.lab.recordings.store import join_recordings
from gestured.lab.recordings.terminal import Terminal
from gestured.record.arrays import read, write
from tests.lab.recordings.test_quality import performed

TRIALS = order("07", 0, ["one_tap"], 1)
GOOD = replace(performed("one_tap", 900), trouble="")


class Script(Terminal):
    """Types each key when its cue is shown after the one before."""

    def __init__(self, *steps: tuple[str, str]) -> None:
        self.steps, self.shown, self.since = list(steps), "", ""
        self._fd, self._pipe = os.pipe()

    def say(self, text: str, end: str = "\n") -> None:
        self.shown += text + end
        self.since += text + end

    def key(self) -> str | None:
        if not self.steps:
            return "q"
        cue, typed = self.steps[0]
        if cue not in self.since:
            return None
        del self.steps[0]
        self.since = ""
        return typed

    def line(self, prompt: str) -> str:
        return "yes"


class FakeSensor:
    """Feels the next of `takes` at each `begin`; None is nothing."""

    def __init__(self, *takes: Captured | None) -> None:
        self.takes = list(takes)
        self.where, self.name, self.rate_hz, self.silent = "127.0.0.1:9000", "armrest", 15.0, False
        self.grid, self.touched = (9, 9), False
        self.not_yet: Iterator[bool] = iter(())  # what it answers before it is ready
        self.felt: Captured | None = None
        self._fd, self._pipe = os.pipe()
        self.socket = SimpleNamespace(fileno=lambda: self._fd)

    @property
    def ready(self) -> bool:
        return next(self.not_yet, True)

    def pump(self) -> None:
        pass

    def begin(self) -> None:
        self.felt = self.takes.pop(0) if len(self.takes) > 1 else self.takes[0]

    @property
    def onset(self) -> float | None:
        return None if self.felt is None else 0.0

    def quiet(self, seconds: float) -> bool:
        return True

    def take(self) -> Captured | None:
        return self.felt


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(module, "GESTURE_TIMEOUT_S", 0.01)
    yield


def run(path: Path, sensor: FakeSensor, *steps: tuple[str, str]) -> Script:
    script = Script(*steps)
    Session("07", path, None, sensor, script, 0).run(TRIALS)  # type: ignore[arg-type]
    assert script.steps == []
    return script


def test_a_whole_protocol_ends_with_thanks(tmp_path: Path) -> None:
    blocks = [("in place", "\n"), *[("Enter keep", "\n")] * 3] * 3
    script = run(tmp_path / "07.npz", FakeSensor(GOOD), *blocks)
    assert script.shown.endswith("All 9 are done. Thank you.\n")
    kept = read(tmp_path / "07.npz")
    assert kept.speeds is not None and kept.inclinations is not None
    found = list(zip(kept.labels.tolist(), kept.speeds.tolist(), kept.inclinations.tolist(), strict=True))
    assert found == [trial[:3] for trial in TRIALS] and kept.sensors is None


def test_a_non_gesture_is_none_with_its_kind_and_never_doubted(tmp_path: Path) -> None:
    """What a model takes for a gesture is the non-gesture that is worth most."""
    taken_for_one = replace(GOOD, looks="swipe_left", sure=0.99)
    trials = [trial for trial in order("07", 0, [], 1, ["scribble"]) if trial.inclination == 0]
    script = Script(("in place", "\n"), ("Enter keep", "\n"))
    Session("07", tmp_path / "07.npz", None, FakeSensor(taken_for_one), script, 0).run(trials)  # type: ignore[arg-type]
    kept = read(tmp_path / "07.npz")
    assert (kept.labels.tolist(), kept.kinds.tolist()) == (["none"], ["scribble"])
    assert left(trials, kept) == []


@pytest.mark.parametrize("forgotten", [True, False])
def test_what_another_program_does_to_the_file_meanwhile_holds(forgotten: bool, tmp_path: Path) -> None:
    """A recording that was forgotten does not come back, and one that another session has kept is not lost."""
    path = tmp_path / "07.npz"

    class Meanwhile(FakeSensor):
        def begin(self) -> None:
            super().begin()
            if len(self.takes) == 2:  # one has been kept
                again = read(path)
                path.unlink() if forgotten else write(path, join_recordings([again, again]))

    steps = ("in place", "\n"), ("Enter keep", "\n"), ("Enter keep", "\n")
    script = run(path, Meanwhile(*[GOOD] * 4), *steps)
    assert len(read(path)) == (1 if forgotten else 3)
    assert "kept, 1 in" in script.shown


def test_nothing_cannot_be_kept(tmp_path: Path) -> None:
    script = run(tmp_path / "07.npz", FakeSensor(None), ("in place", "\n"), ("nothing touched", "\n"))
    assert "Enter keep" not in script.shown
    assert "Ended with 0 recordings" in script.shown
    assert not (tmp_path / "07.npz").exists()


def test_what_is_no_single_gesture_cannot_be_kept(tmp_path: Path) -> None:
    twice = replace(GOOD, trouble="2 gestures were seen, expected one")
    script = run(tmp_path / "07.npz", FakeSensor(twice), ("in place", "\n"), ("NOT GOOD: 2 gestures", "\n"))
    assert "Enter keep" not in script.shown
    assert not (tmp_path / "07.npz").exists()


def test_a_take_that_is_not_good_may_be_kept_all_the_same(tmp_path: Path) -> None:
    frames = list(GOOD.frames)
    frames[GOOD.release] = replace(frames[GOOD.release], lost=2)
    bad = replace(GOOD, frames=tuple(frames), onset=GOOD.release - 1)
    script = run(tmp_path / "07.npz", FakeSensor(bad), ("in place", "\n"), ("lost frames: 2 of 4", "\n"))
    assert "Ended with 1 recordings" in script.shown
    assert len(read(tmp_path / "07.npz")) == 1


def test_the_last_one_that_is_discarded_comes_at_once(tmp_path: Path) -> None:
    keep, discard = ("Enter keep", "\n"), ("Enter keep", "d")
    script = run(tmp_path / "07.npz", FakeSensor(GOOD), ("in place", "\n"), keep, keep, discard, discard, keep)
    assert script.shown.count(f"3/9  {TRIALS[2]}") == 3
    assert "Ended with 3 recordings" in script.shown


def test_a_pause_while_the_verdict_is_shown_throws_the_take_away(tmp_path: Path) -> None:
    script = run(tmp_path / "07.npz", FakeSensor(GOOD), ("in place", "\n"), ("Enter keep", "p"), ("Paused", "\n"))
    assert script.shown.count(f"1/9  {TRIALS[0]}") == 2
    assert "Ended with 0 recordings" in script.shown


def test_a_pause_before_the_sensor_is_there_changes_nothing(tmp_path: Path) -> None:
    sensor = FakeSensor(GOOD)
    answers = iter([False, False, False])
    sensor.not_yet = answers
    script = run(tmp_path / "07.npz", sensor, ("Waiting for the sensor", "p"), ("in place", "\n"), ("Enter keep", "\n"))
    assert "Ended with 1 recordings" in script.shown


SWIPE = replace(GOOD, looks="swipe_right", sure=0.98)


def test_what_looks_like_another_gesture_is_kept_only_when_somebody_says_so(tmp_path: Path) -> None:
    asked = "that looked like swipe_right, 0.98: keep? [y/N]"
    script = run(tmp_path / "07.npz", FakeSensor(SWIPE), ("in place", "\n"), (asked, "\n"), (asked, "y"), (asked, "q"))
    assert "Enter keep" not in script.shown
    assert script.shown.count(f"1/9  {TRIALS[0]}") == 2  # the first one is performed again at once
    assert "Ended with 1 recordings" in script.shown


@pytest.mark.parametrize("take", [replace(SWIPE, sure=0.5), replace(GOOD, looks="one_tap", sure=0.99)])
def test_a_doubtful_model_or_one_that_agrees_says_nothing(tmp_path: Path, take: Captured) -> None:
    script = run(tmp_path / "07.npz", FakeSensor(take), ("in place", "\n"), ("Enter keep", "\n"))
    assert "looked like" not in script.shown


def test_the_peak_of_a_sensor_that_sends_fractions_is_told(tmp_path: Path) -> None:
    share = 0.62 / GOOD.peak()
    frames = tuple(
        replace(frame, values=share * values) for frame, values in zip(GOOD.frames, GOOD.values(), strict=True)
    )
    sensor = FakeSensor(replace(GOOD, frames=frames, noise=0.031))
    script = run(tmp_path / "07.npz", sensor, ("in place", "\n"), ("Enter keep", "d"))
    assert "peak 0.62 counts, 20 times the noise" in script.shown


def test_everything_fits_into_80_columns_and_the_measured_rate_is_shown(tmp_path: Path) -> None:
    frames = list(GOOD.frames)
    frames[GOOD.release] = replace(frames[GOOD.release], lost=2)
    bad = replace(SWIPE, frames=tuple(frames), trouble="12 gestures were seen, expected one: " + "x " * 40)
    sensor = FakeSensor(bad)
    sensor.rate_hz = 59.94
    script = run(tmp_path / "07.npz", sensor, ("in place", "\n"), ("NOT GOOD", "p"), ("Paused", "\n"))
    assert "9 x 9 at 59.9 Hz" in script.shown
    path = str(tmp_path)
    plain = re.sub("\x1b\\[[0-9;]*m", "", script.shown)
    assert max(len(line) for line in plain.splitlines() if path not in line) <= 80
