"""gesturectl simulate, received on a real UDP socket and read with python-osc."""

import errno
import json
import re
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from itertools import count
from typing import Any

import numpy as np
import pytest
from pythonosc.osc_bundle import OscBundle

from gestured.client.sensor import Form, Sensor, connected, sent_after_refusal
from gestured.control.play import takes
from gestured.core.errors import GesturedError
from gestured.core.frames import Frame
from gestured.simulator import GESTURES
from gestured.simulator.places import PLACES
from gestured.simulator.resting import POSTURES
from tests.daemon.harness import DEADLINE_S

FRAMES = 30  # 2 seconds at 15 Hz


def received(udp: socket.socket, count: int) -> list[bytes]:
    return [udp.recv(65536) for _ in range(count)]


def to(udp: socket.socket) -> str:
    return f"127.0.0.1:{udp.getsockname()[1]}"


def test_a_bundle_of_pressure_and_trajectory(run, udp, monkeypatch):
    monkeypatch.setattr("gestured.control.play.UNTOUCHED_S", 0.5)
    begun, flags = time.time(), ("--sensor", "seat-2", "--seconds", 2, "--kinds", "one_tap", "--json")
    status, out, _ = run("simulate", "--to", to(udp), *flags)
    assert status == 0
    bundles = [OscBundle(data) for data in received(udp, FRAMES)]
    pressures = [bundle.content(0) for bundle in bundles]
    trajectories = [bundle.content(1) for bundle in bundles]
    assert {message.address for message in pressures} == {"/seat-2/pressure"}
    assert {message.address for message in trajectories} == {"/seat-2/trajectory"}
    counters = [message.params[0] for message in pressures]
    assert counters == sorted(set(counters))
    frames = np.array([message.params[1:] for message in pressures])
    assert frames.shape == (FRAMES, 81)
    (performed,) = map(json.loads, out.splitlines())
    assert (performed["type"], performed["sensor"], performed["gesture"]) == ("performed", "seat-2", "one_tap")
    # The strongest frame lies within what was performed, by the bundles' own time tags.
    moments = np.array([bundle.timestamp for bundle in bundles])
    strongest = moments[np.ptp(frames - frames[0], axis=1).argmax()]
    assert performed["onset"] - 0.2 < strongest < performed["offset"] + 0.2
    assert begun < moments[0] and moments[-1] < time.time() + 1
    assert any(message.params for message in trajectories)
    assert all(len(message.params) % 3 == 0 for message in trajectories)


def test_an_ipv6_address_is_said_as_it_is_given(run):
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as udp:
        udp.bind(("::1", 0))
        where = f"[::1]:{udp.getsockname()[1]}"
        status, _, err = run("simulate", "--to", where, "--seconds", 0.2)
    assert status == 0 and f" to {where} as " in err


@pytest.mark.parametrize(("kind", "dtype"), [((), ">u2"), (("float32",), ">f4")])
def test_each_blob_carries_one_matrix(run, udp, kind, dtype):
    status, _, _ = run("simulate", "--to", to(udp), "--grid", "7x5", "--rate", 200, "--seconds", 0.2, "--blob", *kind)
    assert status == 0
    for data in received(udp, 40):
        message = OscBundle(data).content(0)
        assert message.address == "/simulated/pressure"
        values = np.frombuffer(message.params[1], dtype)
        assert values.shape == (35,)
        assert np.isfinite(values).all() and (values >= 0).all() and values.max() > 0


def test_ctrl_c_ends_it(start, udp):
    process = start("simulate", "--to", to(udp))
    assert udp.recv(65536)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert b"Traceback" not in err


def test_after_ctrl_c_at_any_moment_a_sensor_can_be_closed(udp):
    """It comes at a line of Python, also at one of the standard library's."""
    frames = [(n, Frame(0.002 * n, np.zeros((9, 9)))) for n in range(2)]
    done, moment = False, 0
    while not done:
        sensor, left, moment = Sensor(udp.getsockname(), Form("a")), count(moment, -1), moment + 1

        def trace(*_: Any, left: Iterator[int] = left) -> Any:
            if not next(left):
                raise KeyboardInterrupt
            return trace

        with suppress(KeyboardInterrupt):
            sys.settrace(trace)
            try:
                sensor.send(frames)
                done = True
            finally:
                sys.settrace(None)
        closing = threading.Thread(target=sensor.close, daemon=True)
        closing.start()
        closing.join(DEADLINE_S)
        assert not closing.is_alive()
    assert moment > 10


class Unpaced(Sensor):
    """Sends nothing, and waits for no frame's time."""

    felt: list[np.ndarray] = []

    def send(self, frames):
        Unpaced.felt = [frame.values for _, frame in frames]


@pytest.fixture
def unpaced(monkeypatch):
    monkeypatch.setattr("gestured.control.simulate.Sensor", Unpaced)


def test_a_day_at_a_place_is_told_as_each_thing_ends(run, unpaced, monkeypatch):
    monkeypatch.setattr("gestured.control.play.PART_S", 150.0)
    flags = ("simulate", "--everyday", "table", "--seconds", 200, "--grid", "7x5", "--json")
    status, out, _ = run(*flags)
    told = [json.loads(line) for line in out.splitlines()]
    ends = [one["offset"] for one in told]
    assert (status, Unpaced.felt[0].shape) == (0, (7, 5)) and ends == sorted(ends)
    kinds = {one["kind"] for one in told}
    assert kinds & set(POSTURES) and kinds & set(GESTURES) and kinds & set(PLACES["table"].rates)
    assert len({one["participant"] for one in told}) == 2  # each part is another person's
    assert run(*flags, "--seed", 1)[1] != out


def test_it_says_in_words_what_is_performed_and_the_same_seed_is_the_same(run, unpaced):
    flags = ("simulate", "--kinds", "palm,double_tap", "--speed", "fast", "--seconds", 8)
    first = run(*flags)[1], Unpaced.felt
    assert first[0].startswith("performed no gesture (palm), fast") and "\nperformed double_tap, fast" in first[0]
    again = run(*flags)[1], Unpaced.felt
    assert np.array_equal(again[1], first[1])
    run(*flags, "--seed", 1)
    assert not np.array_equal(Unpaced.felt[:100], first[1][:100])


def test_what_is_made_at_a_time_is_bounded_and_made_before_it_is_to_be_sent(run, unpaced, monkeypatch):
    made = []

    def parts(*arguments):
        for part in takes(*arguments):
            made.append(part[1].frames.size)
            yield part

    class Slow(Unpaced):
        def send(self, frames):
            end = time.monotonic() + 30.0
            while len(made) < 3 and time.monotonic() < end:  # this one, the next, and one that waits for its place
                time.sleep(0.01)

    def begins(*arguments):
        assert made
        return Slow(*arguments)

    monkeypatch.setattr("gestured.control.play.PART_COUNTS", 50_000)
    monkeypatch.setattr("gestured.control.simulate.takes", parts)
    monkeypatch.setattr("gestured.control.simulate.Sensor", begins)
    assert run("simulate", "--seconds", 120, "--kinds", "one_tap")[0] == 0
    assert len(made) == 3 and max(made) <= 50_000


def test_a_daemon_that_goes_is_said_at_the_end_and_may_come_back(start):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        udp.settimeout(30)
        where = to(udp)
        process = start("simulate", "--to", where, "--seconds", 1)
        received(udp, 5)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 0
    heard, sent = map(int, re.search(rf"nobody listened on {where} for (\d+) of (\d+) packets", err.decode()).groups())
    assert 0 < heard < sent - 1


def test_a_day_has_kinds_of_its_own(run):
    status, out, err = run("simulate", "--everyday", "--kinds", "one_tap")
    assert (status, out) == (1, "")
    assert "--everyday: expected neither --kinds nor --speed" in err


def out_of_reach(port: int) -> type[socket.socket]:
    """A socket that cannot send from this port, as one that keeps an address which this machine has no more."""

    class Kept(socket.socket):
        def send(self, *data: Any) -> int:
            if self.getsockname()[1] == port:
                raise OSError(errno.ENETUNREACH, "Network is unreachable")
            return super().send(*data)

    return Kept


def test_after_this_machine_got_another_address_a_new_socket_takes_the_place_of_the_old(udp):
    with connected(udp.getsockname()) as old:
        kept = out_of_reach(old.getsockname()[1])(fileno=old.detach())
    with kept:
        assert not sent_after_refusal(kept, b"a frame")
        assert udp.recv(9) == b"a frame"


def test_a_network_that_goes_is_a_sentence(udp, monkeypatch):
    sensor = Sensor(udp.getsockname(), Form("a"))
    monkeypatch.setattr(
        "gestured.client.sensor.sent_after_refusal", lambda *_: sensor.socket.connect(("255.255.255.255", 9))
    )
    with closing(sensor), pytest.raises(GesturedError, match=r"^cannot send to 127\.0\.0\.1:\d+: "):
        sensor.send([(0, Frame(0.0, np.zeros((9, 9))))])
