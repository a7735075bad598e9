"""A sensor over real UDP on the loopback: its takes hold what was sent, wherever else packets come from."""

import socket
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from gestured.client.sensor import Form
from gestured.control.play import frames
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.lab.recordings.live import LiveSensor
from gestured.model.opening import open_model
from gestured.simulator import Participant, SimulatedSensor, Take, generator, gesture_take, session
from tests.sockets import free_address

Send = Callable[..., None]


@pytest.fixture
def live() -> Iterator[LiveSensor]:
    sensor = LiveSensor(free_address(), (9, 9), None, open_model("lstm"))
    yield sensor
    sensor.close()


@pytest.fixture
def sender() -> Iterator[Send]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:

        def send(live: LiveSensor, take: Take, name: str = "armrest", *, by: socket.socket | None = None) -> None:
            for counter, frame in frames(0.0, take):
                packet = Form(name).packet(frame, counter, frame.t)
                (by or out).sendto(packet, live.socket.getsockname())

        yield send


def made(gesture: str, person: int = 901) -> Take:
    sensor = SimulatedSensor.nominal(day=person)
    return gesture_take(gesture, Participant(person), sensor, generator(4, person), "normal", 1)


@pytest.mark.parametrize("gesture", ["one_tap", "double_tap", "circle_clockwise"])
def test_a_take_holds_the_frames_that_were_sent(gesture: str, live: LiveSensor, sender: Send) -> None:
    take = made(gesture)
    live.begin()
    assert live.take() is None
    sender(live, take)
    live.pump()
    assert live.name == "armrest"
    assert live.quiet(0.1)
    found = live.take()
    assert found is not None and not found.trouble
    values = found.values()
    end = len(take.frames)
    np.testing.assert_array_equal(values, take.frames[end - len(values) :])
    event = take.events[0]
    first = end - len(values)
    assert abs(take.times[first + found.onset] - event.onset_s) < 0.15
    assert abs(take.times[first + found.release] - event.offset_s) < 0.15
    assert found.frames[found.onset].touches  # finger positions come along


def test_two_gestures_in_a_row_are_told(live: LiveSensor, sender: Send) -> None:
    kinds = ("swipe_left", "swipe_left")
    nominal = SimulatedSensor.nominal(day=901)
    live.begin()
    sender(live, session(Participant(901), nominal, generator(4), 8.0, kinds=kinds, idle_s=(0.8, 0.8)))
    live.pump()
    found = live.take()
    assert found is not None
    assert found.trouble == "2 gestures were seen, expected one"


def test_what_was_before_begin_does_not_count(live: LiveSensor, sender: Send) -> None:
    sender(live, made("swipe_left"))
    live.pump()
    live.begin()
    assert live.onset is None
    assert live.take() is None


def test_other_sensors_and_other_sources_are_left_alone(live: LiveSensor, sender: Send) -> None:
    sender(live, made("one_tap"))
    live.pump()
    seen = live.now
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.1", 0))
        sender(live, made("one_tap"), by=stranger)
        sender(live, made("one_tap"), "door")
        live.pump()
    assert live.now == seen
    assert "door sends" in live.trouble()


def test_frames_of_another_size_are_told(live: LiveSensor, sender: Send) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.sendto(b"nonsense", live.socket.getsockname())
        live.pump()
        assert "no frames of a sensor arrive on" in live.trouble()
        for counter, frame in frames(0.0, made("one_tap")):
            small = type(frame)(frame.t, frame.values[:4], frame.touches)
            out.sendto(Form("armrest").packet(small, counter, frame.t), live.socket.getsockname())
        live.pump()
    assert "expected 9x9 values, found 37 numbers" in live.trouble()


def test_an_address_that_is_taken_is_named() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        host, port = taken.getsockname()
        with pytest.raises(GesturedError, match=f"cannot listen on {host}:{port}: Address already in use"):
            LiveSensor(Address(host, port), (9, 9), None, open_model("lstm"))
