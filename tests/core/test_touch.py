"""Fingers that are followed while they touch: what is told of each, and that no answer depends on it."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.core.beside import touch
from gestured.core.beside.touch import Fingers as Following
from gestured.core.events import Cancelled, Event, Gate, Onset, Release, Touch
from gestured.core.facts import Fact, Fault, events_of
from gestured.core.frames import Frame
from gestured.core.hub import Hub
from gestured.core.scene import Scene, Setup
from gestured.core.sensor import Sensor
from gestured.core.where import zones_of
from gestured.simulator import SimulatedSensor
from gestured.simulator.live import LiveTextile
from gestured.simulator.people import Press
from tests import encoding
from tests.core.test_sensor import DOUBLE, SWIPE, Fake, recognizer, run, says
from tests.core.test_where import drawn
from tests.scenario import frames

Fingers = Sequence[tuple[float, float]]
Path = Callable[[float], Fingers]


def sensor(*, asked: bool = True, zones: dict[str, Any] | None = None, grid: tuple[int, int] = (9, 9)) -> Sensor:
    """A sensor that answers `left` to everything."""
    setup = {"armrest": Setup(zones=zones_of(zones or {}))}
    subject = recognizer(Fake(), grid=grid, sensors=setup, touch=True)
    subject.follow([], asked=asked)
    return subject


class Hand:
    """Fingers on a sensor of 15 Hz, or of another rate, whose counts are in another unit."""

    def __init__(self, subject: Sensor, rate_hz: float = 15.0, unit: float = 1.0) -> None:
        self.subject, self.rate_hz, self.unit, self.t = subject, rate_hz, unit, 0.0
        self.grid, self.width = subject.front_end.grid_sent, 0.8  # of a finger, in pitches
        self.below = 0.0  # counts by which all taxels lie below the idle sensor
        self._random = np.random.default_rng(0)
        self.told: list[Event] = []
        self.rests(2.0)

    def does(self, seconds: float, path: Path, peak: float = 400.0) -> list[Touch]:
        """Fingers along a path, by the share of the time that has passed; the touch events of that."""
        count, before = round(seconds * self.rate_hz), len(self.told)
        for k in range(count):
            self.t += 1 / self.rate_hz
            values = 300 - self.below + self._random.normal(0, 2, self.grid)
            values += drawn(*path(k / count), grid=self.grid, width=self.width, peak=peak)
            self.told += run(self.subject, [Frame(self.t, self.unit * values)])
        return [one for one in self.told[before:] if isinstance(one, Touch)]

    def rests(self, seconds: float) -> list[Touch]:
        """Nobody touches it."""
        return self.does(seconds, lambda share: [])


def line(begin: float, end: float, row: float = 4.0) -> Path:
    """One finger along a row."""
    return lambda share: [(row, begin + share * (end - begin))]


def checked(told: Sequence[Event]) -> None:
    """Each finger comes down once and is up once, within its contact; moves lie between, and sum up to its way."""
    down: dict[int, Touch] = {}
    contact, numbers = None, 0
    for one in told:
        if isinstance(one, Onset):
            contact, numbers = one.id, 0
        elif isinstance(one, Release):
            assert not down, "a finger is down after its contact"
            contact = None
        elif isinstance(one, Touch):
            assert one.id == contact and 0 <= one.x <= 1 and 0 <= one.y <= 1 and one.area >= 1
            if one.phase == "down":
                assert one.touch == numbers and (one.dx, one.dy) == (0, 0)
                numbers += 1
            else:
                before = down.pop(one.touch)
                assert (before.x + one.dx, before.y + one.dy) == pytest.approx((one.x, one.y), abs=1e-9)
                assert one.t >= before.t and one.zone == before.zone
            if one.phase != "up":
                down[one.touch] = one


def test_a_swipe_comes_down_moves_and_is_up_before_its_answer() -> None:
    hand = Hand(sensor())
    hand.does(0.5, line(1, 7))
    hand.rests(1.0)
    checked(hand.told)
    kinds = [one.phase if isinstance(one, Touch) else type(one).__name__ for one in hand.told]
    assert kinds[:2] == ["Onset", "down"] and kinds[-3:] == ["up", "Gesture", "Release"]
    moves = [one for one in hand.told if isinstance(one, Touch)]
    assert moves[0].x == pytest.approx(1 / 8, abs=0.05) and moves[-1].x == pytest.approx(7 / 8, abs=0.12)
    assert all(abs(one.y - 0.5) < 0.05 and one.pressure > 300 and 1 <= one.area <= 9 for one in moves)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_pressure_is_told_in_a_few_digits_whatever_the_sensor_counts_in(unit: float) -> None:
    hand = Hand(sensor(), unit=unit)
    for told, known in zip(hand.does(0.5, line(1, 7)), Hand(sensor()).does(0.5, line(1, 7)), strict=True):
        assert told.pressure / unit == pytest.approx(known.pressure, abs=0.02)  # a hundredth of the noise
        assert len(str(told.pressure)) <= 11


DEEDS: dict[str, tuple[float, Path]] = {  # seconds, and where fingers are meanwhile
    "tap": (0.15, line(4, 4)),
    "swipe": (0.4, line(1, 7)),
    "two": (0.4, lambda share: [(7 - 6 * share, 2), (7 - 6 * share, 6)]),
    "hold": (6.5, line(3, 3)),
    "palm": (0.5, lambda share: [(r, c) for r in range(2, 7) for c in range(2, 7)]),
    "border": (0.4, lambda share: [(-0.5, 9 * share)]),
    "corner": (0.4, line(0, 0, row=0)),
    "quiet": (0.7, lambda share: []),
}


@settings(max_examples=30)
@given(
    st.lists(st.sampled_from([*DEEDS, "silence", "restart"]), max_size=8),
    st.sampled_from([(9, 9), (2, 2), (12, 5)]),
    st.sampled_from([0.8, 0.1]),  # pitches: a fingertip, and a needle that presses one taxel alone
)
def test_each_finger_that_is_down_is_up_whatever_comes(deeds: list[str], grid: tuple[int, int], width: float) -> None:
    hand = Hand(sensor(grid=grid))
    hand.width = width
    for deed in deeds:
        if deed in DEEDS:
            hand.does(*DEEDS[deed])
        else:
            subject = hand.subject
            hand.told += events_of(subject.flush(hand.t) if deed == "silence" else subject.reset())
    hand.told += events_of(hand.subject.flush(hand.t))
    checked(hand.told)
    downs = [one for one in hand.told if isinstance(one, Touch) and one.phase == "down"]
    ups = [one for one in hand.told if isinstance(one, Touch) and one.phase == "up"]
    assert len(downs) == len(ups)


@pytest.mark.parametrize(
    "lines", [(SWIPE,), DOUBLE, ("press 4,4 0.8 for 7s",), ("press 4,2 0.8 and 4,6 0.8 for 300ms",)]
)
def test_answers_are_the_same_whether_or_not_somebody_follows(lines: tuple[str, ...]) -> None:
    stream = frames("quiet for 1500ms", *lines, "quiet for 1500ms", *lines, "quiet for 1500ms")
    told = [run(sensor(asked=asked), stream) for asked in (False, True)]
    assert not any(isinstance(one, Touch) for one in told[0]) and any(isinstance(one, Touch) for one in told[1])
    assert [one for one in told[1] if not isinstance(one, Touch)] == told[0]


def test_nothing_is_computed_where_nobody_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(touch, "spots", None)
    hand = Hand(sensor(asked=False))
    hand.does(0.5, line(1, 7))
    hand.rests(1.0)
    assert len(hand.told) == 3


def test_a_finger_that_holds_for_half_a_minute_and_then_moves_is_followed() -> None:
    hand = Hand(sensor())
    held = hand.does(30.0, line(3, 3))
    assert [one.phase for one in held if one.phase != "move"] == ["down", "up"]
    assert held[-1].reason == "learned" and 5.0 < held[-1].t - held[0].t < 7.0  # given up after 5 s, and still for one
    assert [one.reason for one in hand.told if isinstance(one, Cancelled)] == ["held"]
    moved = hand.does(3.0, line(3, 7))
    assert [one.phase for one in moved if one.phase != "move"] == ["down"]
    assert moved[-1].x == pytest.approx(7 / 8, abs=0.05) and sum(one.dx for one in moved) > 0.25
    assert [one.phase for one in hand.does(2.0, line(7, 7)) if one.phase != "move"] in ([], ["up"])
    hand.rests(1.0)
    checked(hand.told)


def test_a_finger_that_keeps_moving_is_one_touch_beyond_the_longest_gesture() -> None:
    hand = Hand(sensor())
    told = hand.does(20.0, lambda share: [(4, 4 + 3 * math.sin(40 * share))])
    told += hand.rests(1.0)
    assert [one.phase for one in told if one.phase != "move"] == ["down", "up"]
    truth = [4 + 3 * math.sin(40 * (one.t - told[0].t) / 20.0) for one in told]
    assert max(abs(8 * one.x - at) for one, at in zip(told, truth, strict=True)) < 0.5
    checked(hand.told)


def test_nothing_is_followed_in_frames_that_lie_below_the_idle_sensor_as_a_whole() -> None:
    hand = Hand(sensor())
    hand.below = 9.0  # less than is taken for a restart; what stands out from the rest is a contact
    hand.does(3.0, lambda share: [(4, 4 + 3 * math.sin(20 * share))], peak=12.0)
    hand.rests(1.0)
    assert any(isinstance(one, Onset) for one in hand.told)
    checked(hand.told)


def test_under_a_resting_arm_touches_belong_to_what_moves() -> None:
    """On the simulated textile, with its blur, lag and noise; the arm trembles."""
    pad = SimulatedSensor.nominal()
    textile, subject, (wide, high) = LiveTextile(pad, 1), sensor(), pad.extent
    t = np.arange(2.0, 30.0, 0.02)
    tremor = np.random.default_rng(1).normal(0, 0.02, t.size).cumsum()
    heavy = np.full(t.size, 4.0)
    arm = Press(t, wide / 2 + tremor, 0.95 * high + tremor, heavy, 0.45 * wide, 9.0, flatness=1.5, finger=False)
    t = np.arange(8.0, 28.0, 0.02)
    across, firm = wide * (0.5 - 0.25 * np.cos(4 * t)), np.ones(t.size)
    finger = Press(t, across, 0.3 * high * firm, firm, 5.5, 5.5)
    times = np.arange(1, 32 * 15) / 15
    told = run(subject, [Frame(t, textile.frame(t, [arm, finger])) for t in times])
    checked(told)
    touches = [one for one in told if isinstance(one, Touch)]
    rests, moves = ([one for one in touches if (one.t < 7) == early] for early in (True, False))
    assert [(one.phase, one.reason) for one in rests if one.phase != "move"] == [("down", None), ("up", "learned")]
    assert [(one.phase, one.reason) for one in moves if one.phase != "move"] == [("down", None), ("up", None)]
    assert len(moves) > 290
    for one in moves[2:-1]:
        true_x = float(np.interp(one.t - 0.05, finger.t, across)) / pad.pitch_mm - 0.5  # the textile lags
        true_y = 0.3 * high / pad.pitch_mm - 0.5
        assert math.dist((8 * one.x, 8 * one.y), (true_x, true_y)) < 0.7


def test_beside_a_finger_that_holds_touches_belong_to_the_one_that_moves() -> None:
    hand = Hand(sensor())
    told = hand.does(12.0, lambda share: [(1, 1), (7, 5 - 2 * math.cos(60 * share))])
    held, moves = ([one for one in told if one.touch == n] for n in sorted((0, 1), key=lambda n: -first(told, n).y))
    assert held[-1].reason == "learned" and 6.0 < held[-1].t - held[0].t < 8.0
    assert [one.phase for one in moves if one.phase != "move"] == ["down"] and moves[-1].t > held[-1].t + 4
    assert max(one.x for one in moves[-60:]) > 0.8 and min(one.x for one in moves[-60:]) < 0.45
    assert all(one.y < 0.25 for one in moves)


def first(told: list[Touch], number: int) -> Touch:
    return next(one for one in told if one.touch == number)


def test_two_fingers_are_followed_as_two_and_a_second_one_in_one_frame_is_none() -> None:
    hand = Hand(sensor(zones={"left": (0, 0, 0.5, 1), "right": (0.5, 0, 1, 1)}))
    told = hand.does(1.0, lambda share: [(7 - 5 * share, 2), (2 + 5 * share, 6)])
    assert [(one.touch, one.phase) for one in told if one.phase == "down"] == [(0, "down"), (1, "down")]
    ways = {n: [one for one in told if one.touch == n] for n in (0, 1)}
    assert {one.zone for one in ways[0]} | {one.zone for one in ways[1]} == {"left", "right"}
    for way in ways.values():
        left = way[0].zone == "left"
        assert all(one.x < 0.4 if left else one.x > 0.6 for one in way)
        assert all((b.dy > 0) == left for _, b in pairwise(way))
    hand.rests(1.0)
    hand.does(0.3, line(2, 2))
    told = hand.does(1 / 15, lambda share: [(4, 2), (4, 7)]) + hand.does(0.3, line(2, 2))
    assert {one.touch for one in told} == {0}
    checked(hand.told)


@pytest.mark.parametrize("rate_hz", [15.0, 61.0, 250.0])
def test_a_finger_has_at_most_sixty_moves_a_second(rate_hz: float) -> None:
    hand = Hand(sensor(), rate_hz)
    told = hand.does(1.0, line(1, 7))
    assert min(rate_hz, 60) / 2 < len(told) <= 61
    assert sum(one.dx for one in told) == pytest.approx(told[-1].x - told[0].x)


def test_a_gate_that_closes_ends_the_fingers_and_none_is_followed_until_the_next_contact() -> None:
    hand = Hand(sensor())
    hand.does(0.3, line(2, 3))
    closing = events_of(hand.subject.gate({"door": math.inf}, hand.t))
    assert [type(one) for one in closing] == [Touch, Gate]
    hand.told += closing
    assert hand.does(0.3, line(3, 4)) == []
    hand.told += events_of(hand.subject.gate({}, hand.t))
    assert hand.does(0.3, line(4, 5)) == hand.rests(1.0) == []
    assert hand.does(0.3, line(4, 5))[0].phase == "down"
    hand.rests(1.0)
    checked(hand.told)


def test_a_bug_in_the_path_of_a_sensor_ends_its_fingers_first(monkeypatch: pytest.MonkeyPatch) -> None:
    hub = Hub(Scene(("left",), (9, 9), touch=True), Fake([says(0.9)], ("left",)))
    hub.follow(None)
    facts: list[Fact] = []
    rng = np.random.default_rng(0)
    for k in range(36):
        values = 300 + rng.normal(0, 2, 81) + (drawn((4, 4)).ravel() if k >= 30 else 0)
        packet = encoding.message("/a/pressure", "f" * 81, values.tolist())
        with monkeypatch.context() as patch:
            if k == 35:
                patch.setattr(Following, "see", lambda self, front_end: 1 / 0)
            facts += hub.receive([(packet, ("x", 1))], k / 15)
    ended = [one for one in facts if isinstance(one, Fault | Touch | Cancelled | Release)][-4:]
    assert [type(one) for one in ended] == [Fault, Touch, Cancelled, Release]
    checked([one for one in facts if isinstance(one, Onset | Touch | Cancelled | Release)])
