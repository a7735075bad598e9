"""Verdicts on takes: good ones pass, and each fault that a person can put right is named."""

from dataclasses import replace

import numpy as np
import pytest

from gestured.core.frames import Frame
from gestured.lab.recordings.quality import Captured, faults, gaps, saturated
from gestured.simulator import GESTURES, Participant, SimulatedSensor, generator, gesture_take


def performed(gesture: str, person: int, sensor: SimulatedSensor | None = None) -> Captured:
    """A simulated take with the onset and release that the simulator says."""
    sensor = sensor or SimulatedSensor.nominal(day=person)
    rng = generator(5, person, GESTURES.index(gesture))
    made = gesture_take(gesture, Participant(person), sensor, rng, "normal", 1)
    onset, release = np.searchsorted(made.times, [made.events[0].onset_s, made.events[0].offset_s])
    frames = [Frame(float(t), values) for t, values in zip(made.times, made.frames, strict=True)]
    return Captured(tuple(frames), int(onset), max(int(onset), int(release) - 1), sensor.noise * sensor.gain)


@pytest.mark.parametrize("gesture", GESTURES)
def test_ordinary_gestures_are_good(gesture: str) -> None:
    for person in range(900, 906):
        nominal = replace(SimulatedSensor.nominal(day=person), loss=0.0, late=0.0, duplicates=0.0, jitter_s=0.0)
        assert faults(performed(gesture, person, nominal), gesture) == []


@pytest.mark.parametrize("unit", [1.0, 1 / 1024], ids=["counts", "fractions"])
def test_a_sensor_that_ends_below_the_pressure_is_told(unit: float) -> None:
    told = 0
    for person in range(900, 920):
        nominal = replace(SimulatedSensor.nominal(day=person), loss=0.0, late=0.0)
        low = replace(nominal, saturation=int((nominal.offset + 0.4) * nominal.gain))
        take = performed("swipe_left", person, low)
        scaled = [replace(frame, values=frame.values.astype(float) * unit) for frame in take.frames]
        take = replace(take, frames=tuple(scaled))
        told += any("saturated" in fault for fault in faults(take, "swipe_left"))
    assert told >= 18


def test_a_coarse_sensor_is_not_called_saturated() -> None:
    assert not saturated(np.minimum(np.arange(400).reshape(-1, 4, 4) % 30, 20).astype(float))


def test_a_stroke_of_two_frames_is_too_short_and_a_tap_is_not() -> None:
    take = performed("one_tap", 900, replace(SimulatedSensor.nominal(day=900), loss=0.0, late=0.0, jitter_s=0.0))
    short = replace(take, release=take.onset + 1)
    assert faults(short, "one_tap") == []
    (fault,) = faults(short, "swipe_up")
    assert fault == "too short: 2 touched frames, expected 3 or more"


def test_lost_frames_are_counted_by_the_counter_or_by_gaps() -> None:
    whole = performed("swipe_up", 900, replace(SimulatedSensor.nominal(day=900), loss=0.0, late=0.0, jitter_s=0.0))
    frames = list(whole.frames)
    del frames[whole.onset + 1]
    gap = replace(whole, frames=tuple(frames), release=whole.release - 1)
    count = whole.release - whole.onset + 1
    assert faults(gap, "swipe_up") == [f"lost frames: 1 of {count}"]
    frames[whole.onset + 1] = replace(frames[whole.onset + 1], lost=3)
    assert faults(replace(gap, frames=tuple(frames)), "swipe_up") == [f"lost frames: 3 of {count + 2}"]


def test_jitter_is_no_gap() -> None:
    times = np.arange(50) / 15 + np.random.default_rng(0).uniform(-0.01, 0.01, 50)
    assert gaps(times).sum() == 0
    assert gaps(np.delete(times, [20, 21, 30])).sum() == 3


def test_the_front_ends_reason_is_passed_on() -> None:
    take = replace(performed("one_tap", 900), trouble="held too long")
    assert "held too long" in faults(take, "one_tap")
