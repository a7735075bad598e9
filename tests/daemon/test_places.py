"""Whose a name is, for how long, and how its events are numbered when others come and go."""

import tracemalloc
from pathlib import Path

import pytest

from gestured.core.events import Cancelled, Gesture, Onset
from gestured.core.hub import FORGET_S
from gestured.core.scene import Scene
from gestured.core.sensor import HELD_S
from gestured.core.timing import Timing
from tests import encoding
from tests.daemon.harness import RATE_HZ, Frame, Hand, floats
from tests.daemon.parts import SOURCE, Parts


class Room(Parts):
    """A daemon's parts at a time that goes on."""

    def __init__(self, model: Path, **given: str) -> None:
        super().__init__(model, **given)
        self.now = 0.0
        self._hand = Hand()

    def dropped(self, reason: str) -> int:
        """Packets that were not used for this reason."""
        return self.metrics.dropped.values.get((reason,), 0)

    def take(self, packet: bytes, source: tuple[str, int] = SOURCE, later: float = 0.0) -> None:
        """One packet, and what comes of it."""
        self.desk.take(self.hub.receive([(packet, source)], self.now + later))

    def send(self, name: str, frames: list[Frame], source: tuple[str, int] = SOURCE) -> None:
        """Frames of a sensor at its pace."""
        for frame in frames:
            self.now += 1 / RATE_HZ
            self.take(floats(f"/{name}/pressure", frame, 0), source)
            self.hub.tick(self.now)

    def swipe(self, name: str, source: tuple[str, int] = SOURCE) -> None:
        """A sensor that comes, is swiped over, and is quiet."""
        self.send(name, self._hand.idle(2.0) + self._hand.swipe("left") + self._hand.idle(1.0), source)

    def wait(self, seconds: float) -> None:
        """Nobody says anything."""
        self.now += seconds
        self.hub.tick(self.now)


@pytest.fixture
def room(model: Path) -> Room:
    return Room(model, max_sensors="4")


def test_who_is_silent_for_long_loses_the_place_and_goes_on_counting_on_return(room: Room) -> None:
    for n in range(4):
        room.swipe(f"squatter{n}")
    room.wait(FORGET_S / 2)
    room.swipe("late")
    assert "late" not in room.hub.readings(room.now) and room.dropped("too_many_sensors") > 0
    room.wait(FORGET_S)
    for n in range(4):
        room.swipe(f"new{n}")
    room.wait(FORGET_S + 1)
    room.events.clear()
    room.swipe("squatter2")
    onset, gesture = (next(e for e in room.events if isinstance(e, kind)) for kind in (Onset, Gesture))
    assert (onset.id, gesture.id, gesture.sequence) == (2, 2, 2)


def test_a_sensor_that_sends_keeps_its_place(room: Room) -> None:
    for n in range(4):
        room.swipe(f"s{n}")
    for _ in range(4):
        room.wait(FORGET_S * 0.4)
        room.send("s0", Hand().idle(0.2))
    room.swipe("new")
    assert {"s0", "new"} <= set(room.hub.readings(room.now))


class Slow(Room):
    """A sensor with a clock of its own, which all but stands still once it is learned."""

    clock = 1.7e9  # s

    def feel(self, frame: Frame, pace_s: float, step_s: float) -> None:
        """One frame, so much later, and so much later by the sensor's clock."""
        self.now += pace_s
        self.clock += step_s
        self.take(encoding.bundle([floats("/arm/pressure", frame, 0)], self.clock))

    def touch(self, frames: int, pace_s: float) -> None:
        """Two quiet seconds, and then a touch."""
        for frame in self._hand.idle(2.0):
            self.feel(frame, pace_s, 1 / RATE_HZ)
        for n in range(frames):
            self.feel(self._hand.frame(4.0, 4.0 + n % 2), pace_s, 2e-6)


def test_a_contact_is_bounded_in_frames_whatever_the_sensors_clock_says(
    model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scene, "timing", Timing(limit_frames=300))  # 6000 take long
    room = Slow(model, clock="sensor")
    room.touch(310, 0.001)
    assert [e.reason for e in room.events if isinstance(e, Cancelled)] == ["held"]


def test_a_contact_is_bounded_in_the_time_of_arrival(model: Path) -> None:
    room = Slow(model, clock="sensor")
    room.touch(70, 1.0)
    assert [e.reason for e in room.events if isinstance(e, Cancelled)] == ["held"]
    assert room.now > HELD_S


def test_an_idle_sensor_whose_clock_stands_still_does_not_grow(model: Path) -> None:
    room = Slow(model, clock="sensor")
    room.touch(0, 0.067)
    frames = Hand().idle(40.0)
    tracemalloc.start()
    try:
        for frame in frames:
            room.feel(frame, 0.0, 2e-6)
        held = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert held < len(frames) * frame.nbytes / 2  # not even half of the frames
