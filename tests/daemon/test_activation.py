"""Sockets that systemd passes: taken by their names, left alone at the end, refused where they are something else."""

import json
import os
import signal
import socket
from pathlib import Path

import pytest

from tests.daemon.harness import DEADLINE_S, Daemon, Sensor

# As systemd does: the sockets from descriptor 3 on, and LISTEN_PID set by the process itself after its fork.
ACTIVATE = """
import os, sys
fds = [int(fd) for fd in sys.argv[1].split(",")]
kept = [os.dup2(os.dup(fd), 100 + i) for i, fd in enumerate(fds)]
for i, fd in enumerate(kept):
    os.dup2(fd, 3 + i)
os.environ |= {"LISTEN_PID": str(os.getpid()), "LISTEN_FDS": str(len(fds)), "LISTEN_FDNAMES": sys.argv[2]}
os.execv(sys.executable, [sys.executable, *sys.argv[3:]])
"""


class Activated(Daemon):
    """A daemon that is given sockets by name."""

    def __init__(self, folder: Path, *flags: object, sockets: dict[str, socket.socket]) -> None:
        fds = [sock.fileno() for sock in sockets.values()]
        activate = ("-c", ACTIVATE, ",".join(map(str, fds)), ":".join(sockets))
        super().__init__(folder, *flags, python=activate, pass_fds=fds)


@pytest.fixture
def passed(tmp_path: Path):
    """What systemd would hold: one socket for each name."""
    sockets = {"metrics": socket.create_server(("127.0.0.1", 0))}
    for name in ("events", "control"):
        sockets[name] = socket.socket(socket.AF_UNIX)
        sockets[name].bind(str(tmp_path / f"{name}.sock"))
        sockets[name].listen()
    sockets["osc"] = socket.socket(type=socket.SOCK_DGRAM)
    sockets["osc"].bind(("127.0.0.1", 0))
    yield sockets
    for sock in sockets.values():
        sock.close()


def test_sockets_are_taken_by_name_and_survive_a_restart(model: Path, tmp_path: Path, passed) -> None:
    flags = ("--clock", "sensor", "--stale-s", 30)  # on a busy machine no sensor is stale
    daemon = Activated.start(tmp_path, model, *flags, sockets=passed)
    try:
        assert daemon.ready["socket"] == str(tmp_path / "events.sock")
        assert daemon.ready["control"] == str(tmp_path / "control.sock")
        assert daemon.ready["listen"].endswith(f":{passed['osc'].getsockname()[1]}")
        assert daemon.get("/readyz")[0] == 200
        client = daemon.client()
        sensor = Sensor(daemon, "arm").begin().perform("left")
        client.events("gesture", "arm")
        assert daemon.stop() == 0
        assert (tmp_path / "events.sock").exists() and (tmp_path / "control.sock").exists()
        sensor.begin().perform("left")  # nobody is there: the kernel keeps it
        waiting = socket.socket(socket.AF_UNIX)
        waiting.settimeout(DEADLINE_S)
        waiting.connect(str(tmp_path / "events.sock"))  # and this client
        daemon = Activated.start(tmp_path, model, *flags, sockets=passed)
        lines = waiting.makefile("rb")
        assert b'"hello"' in lines.readline()
        sensor.perform("up")
        events = []
        while not events or events[-1]["gesture"] != "swipe_up":
            events.append(json.loads(lines.readline()))
        assert events[-1]["sequence"] == 2  # after the one that came while nobody was there
        waiting.close()
    finally:
        daemon.stop()
    assert "Traceback" not in daemon.stderr()


def test_a_setting_for_which_systemd_holds_a_socket_is_said_to_be_unused(model: Path, tmp_path: Path, passed) -> None:
    own = tmp_path / "control.sock"
    flags = ("--listen", "0.0.0.0:9000", "--socket", tmp_path / "events.sock", "--control", own)
    daemon = Activated.start(tmp_path, model, *flags, sockets=passed)
    daemon.stop()
    lines = [line for line in map(json.loads, daemon.stderr().splitlines()) if line["level"] == "warning"]
    assert [line["key"] for line in lines] == ["listen"]  # the others are what systemd has
    assert lines[0]["value"] == "0.0.0.0:9000" and lines[0]["address"] == daemon.ready["listen"]


def test_what_is_sent_while_it_is_stopped_is_the_next_starts(model: Path, tmp_path: Path, passed) -> None:
    daemon = Activated.start(tmp_path, model, "--clock", "sensor", sockets=passed)
    client = daemon.client()
    sensor = Sensor(daemon, "arm").begin().perform("left")
    client.events("gesture", "arm")
    daemon.get("/metrics")
    daemon.ask("reload")  # now every thread that it may have is there
    daemon.signal(signal.SIGSTOP)
    os.waitid(os.P_PID, daemon.process.pid, os.WSTOPPED)
    sent = [sensor.packet(frame) for frame in sensor.hand.idle(3.0)]
    for packet in sent:
        sensor.sock.send(packet)
    daemon.signal(signal.SIGABRT)  # as systemd's watchdog does: ended, and woken for it
    daemon.signal(signal.SIGCONT)
    assert daemon.wait() == -signal.SIGABRT
    passed["osc"].settimeout(DEADLINE_S)
    assert [passed["osc"].recv(65536) for _ in sent] == sent


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ({"osc": "metrics"}, ("'osc'", "ListenDatagram", "SOCK_STREAM")),
        ({"events": "osc"}, ("'events'", "ListenStream", "SOCK_DGRAM")),
        ({"control": "control", "osc": "file"}, ("'osc'", "no socket")),
        ({"gestured.socket": "osc"}, ("'gestured.socket'", "FileDescriptorName=", ", control, gates, metrics")),
    ],
)
def test_a_socket_that_is_something_else_is_refused(model: Path, tmp_path: Path, passed, names, said) -> None:
    flags = ("--model", model, "--listen", "127.0.0.1:0", "--socket", tmp_path / "own.sock")
    with (tmp_path / "file").open("wb") as file:  # such as ListenFIFO= and OpenFile= pass
        given = {name: passed.get(real, file) for name, real in names.items()}
        daemon = Activated(tmp_path, *flags, sockets=given)
    assert daemon.wait() == 4
    assert all(word in daemon.stderr() for word in (*said, "gestured: systemd")), daemon.stderr()
    assert not (tmp_path / "own.sock").exists()
