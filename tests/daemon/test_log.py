"""A log that nobody reads stops neither the daemon nor its end; what was thrown away is counted."""

import json
import os
import pty
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from gestured.client.lines import Refused
from gestured.daemon import log
from gestured.daemon import start as start_up
from tests.daemon.harness import DEADLINE_S, Daemon, Sensor, lines_of


@pytest.fixture(params=["no reader", "closed", "full disk"])
def unread(request: pytest.FixtureRequest) -> Iterator[int]:
    """A descriptor that takes not one byte more, as those are that nobody reads, or that fails."""
    if request.param == "full disk":
        ours, theirs = None, os.open("/dev/full", os.O_WRONLY)
    else:
        ours, theirs = (sock.detach() for sock in socket.socketpair())  # as journald's is
    if ours is not None and request.param == "closed":
        os.close(ours)
        ours = None
    if ours is not None:
        os.set_blocking(theirs, False)
        for size in (4096, 1):
            with suppress(BlockingIOError):
                while True:
                    os.write(theirs, b"x" * size)
        os.set_blocking(theirs, True)
    yield theirs
    for descriptor in filter(None, (ours, theirs)):
        os.close(descriptor)


def test_a_daemon_whose_log_is_not_read_serves_and_ends(start, unread: int) -> None:
    daemon = start("--clock", "sensor", "--log-level", "debug", stderr=unread)
    daemon.process.stdout.close()
    client = daemon.client()
    Sensor(daemon, "arm").begin().perform("left", "tap")
    assert [line["gesture"] for line in client.events("gesture", "arm", 2)] == ["swipe_left", "one_tap"]
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    assert os.get_blocking(unread)  # it is shared with others: whoever started the daemon finds it as it was


def test_what_an_operator_sends_does_not_act_on_the_daemons_terminal(start) -> None:
    ours, theirs = pty.openpty()
    daemon = start(stderr=theirs)
    with pytest.raises(Refused, match="no gesture"):
        daemon.ask("emit", gesture="wink\x1b[2J")
    assert daemon.stop() == 0
    os.close(theirs)
    said = os.read(ours, 1 << 16)
    assert b"\x1b[2J" not in said and b"wink\\x1b[2J" in said


def test_what_is_said_when_the_interpreter_ends_does_not_keep_it() -> None:
    """No thread starts any more that could write it, such as of a connection that is collected as garbage then."""
    code = """from gestured.daemon import log
log.configure("info")
class Left:
    def __del__(self): say("too late")
say, left = log.log.error, Left()
say("ended")
log.close()"""
    ended = subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, timeout=DEADLINE_S)
    assert ended.returncode == 0 and ended.stderr.count("ended") == 1


def test_a_connection_that_was_lost_is_no_bug(monkeypatch) -> None:
    said: list[Exception] = []
    told = staticmethod(lambda event, reason, count, exc_info: said.append(exc_info))
    monkeypatch.setattr(log, "log", type("Log", (), {"exception": told}))
    lost, bug = ConnectionResetError(104, "Connection reset by peer"), ValueError("x")
    for error in (lost, bug):
        start_up.report(log.Throttle(), None, {"message": "Future exception was never retrieved", "exception": error})
    assert said == [bug]


@pytest.mark.parametrize("unread", ["no reader"], indirect=True)
def test_a_start_that_fails_ends_even_where_nobody_reads_why(tmp_path: Path, unread: int) -> None:
    daemon = Daemon(tmp_path, "--config", tmp_path / "none.toml", stderr=unread)
    assert daemon.wait() == 2


def test_the_last_words_reach_a_reader_that_is_slow(start) -> None:
    reader, writer = os.pipe()
    daemon = start("--clock", "sensor", "--log-level", "debug", stderr=writer)
    os.close(writer)
    daemon.signal(signal.SIGTERM)
    with open(reader) as lines:
        assert list(lines_of(lines.read()))[-1]["event"] == "ended"
    assert daemon.wait() == 0


def test_what_was_thrown_away_is_counted_where_it_is_missing() -> None:
    program = """if True:
        import json, sys
        from gestured.daemon import log
        log.configure("info")
        for number in range(5000):
            log.log.info("a line", number=number, words="x" * 1000)
        print(flush=True)
        sys.stdin.read(1)
        log.log.info("goodbye")
        log.close()
    """
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None and process.stderr is not None and process.stdin is not None
        process.stdout.readline()
        found: list[dict[str, object]] = []
        while not found or "number" in found[-1]:
            found.append(json.loads(process.stderr.readline()))
        process.stdin.write(b".")
        process.stdin.close()
        rest = [json.loads(line) for line in process.stderr]
        assert process.wait(DEADLINE_S) == 0
    *lines, lost = found
    assert [line["number"] for line in lines] == list(range(len(lines)))
    assert lost["level"] == "warning" and lost["count"] == 5000 - len(lines) > 0
    assert len(lines) * 1000 <= log.WAITING_BYTES + (1 << 20)  # and what the pipe itself holds
    assert [line["event"] for line in rest] == ["goodbye"]
