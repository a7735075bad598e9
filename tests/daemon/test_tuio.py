"""Fingers as TUIO cursors, read by a client that somebody else wrote (python-tuio)."""

import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pythonosc.osc_bundle import OscBundle

from gestured.core.address import Address
from gestured.core.errors import SettingsError
from gestured.core.events import Status, Touch
from gestured.daemon.asked import open_ladder
from gestured.daemon.metrics import Metrics
from gestured.daemon.tuio import TuioSink
from tests.daemon.harness import Daemon, Sensor
from tests.daemon.parts import settings_of

pythontuio = pytest.importorskip("pythontuio")


class Screen(pythontuio.TuioListener):  # type: ignore[name-defined, misc]
    """What a program that draws cursors is told of them: (what, session, x, y)."""

    def __init__(self, udp: socket.socket) -> None:
        self.seen: list[tuple[str, int, float, float]] = []
        self._udp, self._client = udp, pythontuio.dispatcher.TuioDispatcher()
        self._client.add_listener(self)

    def read(self, until: Callable[[], bool]) -> None:
        while not until():
            self._client.call_handlers_for_packet(self._udp.recv(9999), ("127.0.0.1", 0))

    def _note(self, what: str, cursor: Any) -> None:
        self.seen.append((what, cursor.session_id, *cursor.position))

    def add_tuio_cursor(self, cur: Any) -> None:
        self._note("add", cur)

    def update_tuio_cursor(self, cur: Any) -> None:
        self._note("update", cur)

    def remove_tuio_cursor(self, cur: Any) -> None:
        self._note("remove", cur)


def test_a_cursor_follows_the_finger_and_is_removed_with_it(start: Callable[..., Daemon], udp: socket.socket) -> None:
    to = f"tuio://127.0.0.1:{udp.getsockname()[1]}"
    daemon = start("--clock", "sensor", "--touch", "true", "--publish", to)
    screen = Screen(udp)
    Sensor(daemon, "arm").begin().perform("up", "right")
    screen.read(lambda: [what for what, *_ in screen.seen].count("remove") == 2)
    sessions = dict.fromkeys(session for _, session, *_ in screen.seen)
    up, right = ([one for one in screen.seen if one[1] == session] for session in sessions)
    for way in (up, right):
        assert [what for what, *_ in way] == ["add", *["update"] * (len(way) - 2), "remove"] and len(way) >= 7
    assert [y for *_, y in up] == sorted((y for *_, y in up), reverse=True)  # downward is more
    assert up[0][3] > 0.8 and up[-1][3] < 0.2 and all(abs(x - 0.5) < 0.1 for _, _, x, _ in up)
    assert right[-1][2] - right[0][2] > 0.6


@pytest.fixture
def sent(udp: socket.socket) -> Callable[[], list[list[Any]]]:
    """The arguments of each message of the next bundle."""
    return lambda: [[*message.params] for message in OscBundle(udp.recv(9999))]


def test_each_frame_says_whose_it_is_who_is_alive_and_its_number(udp: socket.socket, sent: Any) -> None:
    sink = TuioSink(Address(*udp.getsockname()), Metrics())
    event = Touch("arm", 7, 0, "down", 10.0, 0.25, 0.75, 0.0, 0.0, 100.0, 4)
    sink.publish(event, 0.0)
    source, *rest = sent()
    assert source == ["source", f"gestured/arm@{socket.gethostname()}"]
    first, one = rest[2][1], rest[0][1]
    assert rest == [["alive", one], ["set", one, 0.25, 0.25, 0.0, 0.0, 0.0], ["fseq", first]]
    sink.publish(Touch("arm", 7, 1, "move", 10.0, 0.5, 0.5, 0.1, 0.0, 100.0, 4), 0.0)  # of which no `down` was seen
    _, alive, place, number = sent()
    two = alive[-1]
    assert alive == ["alive", one, two] and one != two
    assert [place, number] == [["set", two, 0.5, 0.5, 0.0, 0.0, 0.0], ["fseq", first + 1]]
    sink.publish(Touch("arm", 7, 0, "move", 10.5, 0.5, 0.875, 0.25, 0.125, 100.0, 4), 0.0)
    speed = pytest.approx((0.5**2 + 0.25**2) ** 0.5 / 0.5, rel=1e-6)
    assert sent()[2] == ["set", one, 0.5, 0.125, 0.5, -0.25, speed]
    sink.publish(Status("ok", {"arm": "ok", "leg": "ok"}, "m", 1.0), 0.0)
    assert [sent()[1:] for _ in "12"] == [[["alive", one, two], ["fseq", first + 3]], [["alive"], ["fseq", first + 4]]]
    sink.publish(Touch("arm", 7, 0, "up", 11.0, 0.5, 0.875, 0.0, 0.0, 100.0, 4), 0.0)
    assert sent()[1:] == [["alive", two], ["fseq", first + 5]]
    sink.publish(Status("ok", {"leg": "ok"}, "m", 1.0), 0.0)
    assert sent() == [["source", f"gestured/leg@{socket.gethostname()}"], ["alive"], ["fseq", first + 6]]
    assert sent()[1:] == [["alive", two], ["fseq", first + 7]]
    again = TuioSink(Address(*udp.getsockname()), Metrics())  # as at a reload: the finger stays who it was
    again.take_over(sink)
    sink.close()
    again.publish(Touch("arm", 7, 1, "move", 12.0, 0.5, 0.5, 0.0, 0.0, 100.0, 4), 0.0)
    assert sent()[1:] == [["alive", two], ["set", two, 0.5, 0.5, 0.0, 0.0, 0.0], ["fseq", first + 8]]
    again.publish(Touch("arm", 8, 0, "down", 12.0, 0.5, 0.5, 0.0, 0.0, 100.0, 4), 0.0)
    assert sent()[1][1] == two
    again.close()  # which tells programs that draw that no finger is left
    assert [sent()[1:] for _ in "12"] == [[["alive"], ["fseq", first + n]] for n in (10, 11)]


def test_frames_and_sessions_go_on_where_those_of_an_earlier_start_ended(
    udp: socket.socket, sent: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Programs drop frames of lower numbers than they have seen, and take a finger for the old one of its session."""
    numbers, sessions = [], []
    for t in (1.7e9, 1.7e9 + 10):
        monkeypatch.setattr("gestured.daemon.tuio.time.time", lambda t=t: t)
        sink = TuioSink(Address(*udp.getsockname()), Metrics())
        for touch in range(60):
            sink.publish(Touch("arm", touch, 0, "down", 10.0, 0.5, 0.5, 0.0, 0.0, 100.0, 4), 0.0)
            *_, (_, session, *_), (_, number) = sent()
            numbers.append(number)
            sessions.append(session)
    for told, most in ((numbers, 2**31), (sessions, 2**24)):
        assert told == sorted(set(told)) and 0 < told[0] < told[-1] < most


def test_it_needs_touch_events(model: Path) -> None:
    settings, _ = settings_of("--model", model, "--publish", "tuio://127.0.0.1:3333")
    with pytest.raises(
        SettingsError, match="publish = tuio://127.0.0.1:3333: it tells where fingers are, expected `touch"
    ):
        open_ladder(settings)
