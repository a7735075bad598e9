"""Common mistakes explain themselves: what gesturectl says of each. docs/troubleshooting.md has them, too."""

import json
import os
import socket
from pathlib import Path

import pytest

from gestured.control.status import screen
from tests.daemon import tiny_model
from tests.daemon.harness import Daemon


@pytest.fixture
def free() -> str:
    """A UDP address on which nobody listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{taken.getsockname()[1]}"


def test_simulate_to_where_nobody_listens_ends_at_once(run, free: str) -> None:
    status, out, err = run("simulate", "--to", free)  # without end, if it did not
    assert (status, out) == (1, "")
    assert f"nobody listens on {free}" in err and "start gestured, or name its address with --to" in err


def test_either_socket_finds_the_daemon(run, daemon: Daemon) -> None:
    events, control = daemon.ready["socket"], daemon.ready["control"]
    for command in (["status", "--json"], ["doctor", "--json"], ["emit", "swipe_left", "--json"]):
        for flag, path in (("--socket", events), ("--control", control)):
            out = run(*command, flag, path)[1]
            assert json.loads(out.splitlines()[0]), (command, flag)
            assert "no daemon" not in out
    client = daemon.client()
    for flag, path in (("--socket", events), ("--control", control)):
        status, out, err = run("listen", flag, path, "--types", "status", "--count", 1, "--json")
        assert status == 0, err
        assert [json.loads(line)["type"] for line in out.splitlines()] == ["hello", "status"]
    client.close()


def test_the_variables_that_the_daemon_takes_find_it(run, daemon: Daemon, tmp_path: Path) -> None:
    events, control = daemon.ready["socket"], daemon.ready["control"]
    file = tmp_path / "gestured.toml"
    file.write_text(f'socket = "{events}"\n')
    for given in ({"GESTURED_SOCKET": events}, {"GESTURED_CONTROL": control}, {"GESTURED_CONFIG": str(file)}):
        status, out, err = run("status", "--json", env=given)
        assert status == 0 and json.loads(out)["addresses"]["socket"] == events, (given, err)
        status, _, err = run("listen", "--types", "status", "--count", 1, env=given)
        assert status == 0, (given, err)


def test_a_shadow_is_said_to_have_started_reports_and_is_said_to_have_stopped(run, daemon: Daemon, tmp_path) -> None:
    candidate = tiny_model.make(tmp_path / "next.onnx")
    control = ("--control", daemon.ready["control"])
    started, reported, stopped = (
        run("shadow", *what, *control)[1].splitlines() for what in ((candidate,), (), ("--stop",))
    )
    assert started == [
        "next runs in the shadow from now on: gesturectl shadow reports, gesturectl shadow --stop ends it"
    ]
    assert reported[0].startswith("next in the shadow: 0 segments")
    assert stopped[0] == "next runs in the shadow no longer; what came of it:"
    assert stopped[1].startswith("next in the shadow: 0 segments")


def shift_line(shares: dict[str, float], unlike: list[str]) -> str:
    status = {
        "version": "1", "state": "ok", "uptime_s": 7.0, "pid": 1, "addresses": {"listen": "a:1"},
        "ready": {"ready": True, "reason": None},
        "model": {"active": "lstm", "asked": "lstm", "degraded": False, "failures": 0, "version": "1", "sha256": "ab"},
        "sensors": {}, "answers": {"gestures": {}, "unknown": 0, "cancelled": {}}, "recent": [],
        "input": {"dropped": {}, "kernel_drops": 0},
        "output": {"subscribers": 0, "backlog_bytes": 0, "lines_lost": 0, "evicted": {}},
        "loop_lag_s": 0.0, "internal_errors": 0, "shadow": None,
        "shift": {"gestures": 40, "outside": shares, "unlike": unlike},
    }  # fmt: skip
    (line,) = [line for line in screen(status) if line.startswith("shift:")]
    return line


def test_status_says_one_thing_of_the_shift() -> None:
    alike = shift_line({"unknown": 0.24, "area": 0.0}, [])
    assert alike == "shift: the last 40 gestures are like those of the training"
    unlike = shift_line({"strength": 0.5, "area": 0.0, "duration_s": 0.4}, ["strength", "duration_s"])
    assert unlike.startswith("shift: the last 40 gestures are unlike those of the training in strength (50 %")
    assert "duration (40 %" in unlike and "area" not in unlike


def test_a_port_that_is_taken_names_its_process(run, udp: socket.socket) -> None:
    taken = f"127.0.0.1:{udp.getsockname()[1]}"
    status, _, err = run("sniff", "--listen", taken)
    assert status == 1 and f"(pid {os.getpid()})" in err and "Address already in use" in err
