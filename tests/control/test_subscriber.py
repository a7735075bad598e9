"""gestured.Subscriber, against scripted daemons and a real one."""

import json
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gestured.client.control import Control
from gestured.client.lines import Refused, Unreachable, read_ahead
from gestured.client.subscriber import LONGEST_S, Subscriber
from gestured.core.errors import GesturedError
from tests.sockets import GESTURE, HELLO, PATIENCE_S, FakeDaemon, meanwhile


@contextmanager
def serving(fake: FakeDaemon, *lines: object, hello: object = HELLO) -> Iterator[None]:
    """Meanwhile a daemon takes one connection, greets and says these lines."""

    def serve() -> None:
        fake.accept(hello)
        fake.say(*lines)

    with meanwhile(serve):
        yield


def asked(fake: FakeDaemon, subscriber: Subscriber, *lines: object, hello: object = HELLO) -> dict[str, Any]:
    """The next event, where a daemon takes one connection, greets and says these lines."""
    with serving(fake, *lines, hello=hello):
        return next(subscriber)


def test_events_are_the_lines_and_the_hello_stands_beside_them(fake: FakeDaemon):
    with Subscriber(fake.path, types=["gesture"], sensors=("armrest",), gestures=["one_tap"]) as subscriber:
        assert asked(fake, subscriber, GESTURE, {"type": "lost", "count": 7}) == GESTURE
        assert next(subscriber) == {"type": "lost", "count": 7}
        assert subscriber.hello == HELLO and subscriber.path == fake.path
    filters = {"types": ["gesture"], "sensors": ["armrest"], "gestures": ["one_tap"]}
    assert fake.request() == {"subscribe": filters}


def test_without_filters_nothing_is_asked(fake: FakeDaemon):
    with Subscriber(str(fake.path)) as subscriber:
        asked(fake, subscriber, GESTURE)
    assert fake.client.makefile("rb").read() == b""


def test_what_a_daemon_could_not_finish_is_not_given(fake: FakeDaemon):
    with Subscriber(fake.path) as subscriber:
        asked(fake, subscriber, GESTURE, b'{"type":"gesture","seq')
        fake.close()
        assert asked(fake, subscriber, GESTURE | {"sequence": 5})["sequence"] == 5


def test_a_daemon_without_a_place_is_asked_again(fake: FakeDaemon):
    def crowd() -> None:
        fake.accept(b'{"type":"error","reason":"more than 64 clients"}\n{"type":"status"}\n')
        fake.close()
        fake.accept()
        fake.say(GESTURE)

    with meanwhile(crowd), Subscriber(fake.path) as subscriber:
        assert next(subscriber) == GESTURE


def test_two_daemons_are_heard_at_once(fake: FakeDaemon, tmp_path: Path):
    other = FakeDaemon(tmp_path / "other.sock")
    in_the_car, at_home = HELLO | {"instance": "car"}, HELLO | {"instance": "home"}
    with (
        other.listener,
        serving(fake, GESTURE | {"sensor": "door"}, hello=in_the_car),
        serving(other, GESTURE | {"sensor": "sofa"}, hello=at_home),
        Subscriber(fake.path, other.path) as subscriber,
    ):
        heard = {(next(subscriber)["sensor"], subscriber.path, subscriber.hello["instance"]) for _ in range(2)}
    assert heard == {("door", fake.path, "car"), ("sofa", other.path, "home")}


def test_a_pause_is_told_and_loses_nothing(fake: FakeDaemon):
    half, rest = json.dumps(GESTURE).encode()[:20], json.dumps(GESTURE).encode()[20:] + b"\n"
    with Subscriber(fake.path, timeout=0.05) as subscriber:
        with pytest.raises(TimeoutError, match=r"0\.05 s"):
            asked(fake, subscriber, half)
        fake.say(rest)
        events = []
        while not events:
            try:
                events.append(next(subscriber))
            except TimeoutError:
                pass
        assert events == [GESTURE]


def test_a_daemon_that_only_greets_holds_up_no_timeout(fake: FakeDaemon):
    """Else only the last of thirty starts, a tenth of a second apart, would be followed by the TimeoutError."""
    greeted, stop = 0, threading.Event()
    fake.listener.settimeout(0.05)

    def start_again() -> None:
        nonlocal greeted
        while not stop.is_set() and greeted < 30:
            with suppress(OSError):
                fake.accept()
                greeted += 1
                fake.close()

    with Subscriber(fake.path, timeout=0.25) as subscriber, meanwhile(start_again):
        with pytest.raises(TimeoutError):
            next(subscriber)
        stop.set()
    assert greeted < 30


def test_a_line_without_end_is_refused_before_it_fills_the_memory(fake: FakeDaemon):
    def serve() -> None:
        fake.accept()
        with suppress(BrokenPipeError, ConnectionResetError):
            while True:
                fake.say(b" " * 65536)

    with meanwhile(serve), pytest.raises(Refused, match=f"{fake.path} sent a line of more than"):
        next(Subscriber(fake.path))


def test_close_in_another_thread_ends_the_iteration(fake: FakeDaemon):
    subscriber = Subscriber(fake.path)
    events = read_ahead(subscriber)
    fake.accept()
    fake.say(GESTURE)
    assert events.get(timeout=PATIENCE_S) == GESTURE
    subscriber.close()
    assert events.get(timeout=PATIENCE_S) is None
    assert fake.client.recv(1) == b""
    subscriber.close()


def test_close_in_a_forked_child_leaves_the_connection_to_its_parent(fake: FakeDaemon):
    with Subscriber(fake.path) as subscriber:
        asked(fake, subscriber, GESTURE)
        child = get_context("fork").Process(target=subscriber.close)
        child.start()
        child.join()
        fake.say(GESTURE | {"sequence": 5})
        assert next(subscriber)["sequence"] == 5 and child.exitcode == 0


def test_a_forked_child_has_a_connection_of_its_own(fake: FakeDaemon):
    """It would otherwise take lines of its parent's, or wait for ever for the thread that iterates there."""
    with Subscriber(fake.path) as subscriber:
        events = read_ahead(subscriber)
        fake.accept()
        parents = fake.client
        child = get_context("fork").Process(target=lambda: sys.exit(next(subscriber)["sequence"]), daemon=True)
        child.start()
        fake.accept()
        fake.say(GESTURE | {"sequence": 6})
        child.join()
        parents.sendall(json.dumps(GESTURE | {"sequence": 5}).encode() + b"\n")
        event = events.get(timeout=PATIENCE_S)
        assert event is not None and event["sequence"] == 5 and child.exitcode == 6


def test_a_timeout_says_which_daemon_is_not_there(tmp_path: Path):
    """A mistake in a path otherwise looks like a sensor that nobody touches."""
    path = tmp_path / "events.sock"
    with Subscriber(path, timeout=0.05) as subscriber:
        with pytest.raises(TimeoutError, match=rf"0\.05 s: no daemon on {path}: No such file or directory; start"):
            next(subscriber)
        fake = FakeDaemon(path)
        with fake.listener, serving(fake, GESTURE):
            heard = None
            while heard is None:
                with suppress(TimeoutError):
                    heard = next(subscriber)
            with pytest.raises(TimeoutError, match=r"no event within 0\.05 s$"):
                next(subscriber)


def test_close_ends_the_wait_for_a_daemon_that_is_not_there(tmp_path: Path):
    subscriber = Subscriber(tmp_path / "none.sock")
    events = read_ahead(subscriber)
    subscriber.close()
    assert events.get(timeout=PATIENCE_S) is None


def test_a_daemon_that_takes_no_connection_holds_up_no_timeout(fake: FakeDaemon):
    fake.listener.listen(0)
    with socket.socket(socket.AF_UNIX) as waits:
        waits.connect(str(fake.path))
        with Subscriber(fake.path, timeout=0.05) as subscriber, pytest.raises(TimeoutError):
            next(subscriber)
        with pytest.raises(Unreachable, match="takes no more connections"):
            Control(fake.path)


@pytest.mark.parametrize("path", ["/tmp/" + "a" * 103, "/tmp/a\0b", "\0a"])
def test_a_path_that_no_socket_can_have_is_not_waited_for(path: str):
    with pytest.raises(GesturedError, match=r"expected the path of a Unix socket, at most 107 bytes"):
        next(Subscriber(path, timeout=1.0))


def test_close_in_a_signal_handler_ends_the_iteration(fake: FakeDaemon):
    subscriber = Subscriber(fake.path)
    before = signal.signal(signal.SIGUSR1, lambda *_: subscriber.close())

    def end() -> None:
        fake.accept()
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)

    with meanwhile(end):
        assert list(subscriber) == []
    signal.signal(signal.SIGUSR1, before)


@pytest.mark.parametrize("first", [{"type": "hello", "protocol": 2}, b"SSH-2.0\n", b"\xff\n", b"[]\n"])
def test_something_else_on_the_socket_is_refused(fake: FakeDaemon, first: object):
    subscriber = Subscriber(fake.path)
    with pytest.raises(Refused, match=str(fake.path)):
        asked(fake, subscriber, hello=first)
    assert list(subscriber) == []


def test_without_reconnect_a_daemon_that_is_gone_is_an_error(fake: FakeDaemon, tmp_path: Path):
    with pytest.raises(Unreachable, match="none.sock"):
        next(Subscriber(tmp_path / "none.sock", reconnect=False))
    subscriber = Subscriber(fake.path, reconnect=False)
    assert asked(fake, subscriber, GESTURE) == GESTURE
    fake.close()
    with pytest.raises(Unreachable, match="closed the connection"):
        next(subscriber)


def test_no_path_is_a_mistake():
    with pytest.raises(TypeError, match="event socket"):
        Subscriber()


def test_attempts_come_ever_more_rarely_but_within_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A clock that moves only while it waits: so the waits are all the time that passes."""
    clock, waits = [0.0], []
    monkeypatch.setattr("gestured.client.subscriber.time", SimpleNamespace(monotonic=lambda: clock[0]))
    subscriber = Subscriber(tmp_path / "none.sock")

    def select(timeout: float | None) -> list[Any]:
        assert timeout is not None
        waits.append(timeout)
        clock[0] += timeout
        if len(waits) == 20:
            subscriber.close()
        return []

    monkeypatch.setattr(subscriber._selector, "select", select)
    assert list(subscriber) == []
    waits = [round(wait, 6) for wait in waits if wait > 1e-9]
    assert len(waits) >= 19 and waits == sorted(waits)
    assert waits[-1] == pytest.approx(LONGEST_S)
