"""gesturectl status --all: each daemon that runs, a line each."""

import json
import sys
from pathlib import Path

import pytest

from gestured.client import address
from gestured.control import status as status_command
from gestured.control.cli import main
from gestured.daemon.sockets import UnixListener
from tests.daemon.harness import Daemon


def test_each_daemon_that_runs_is_shown_wherever_its_socket_is(run, daemon: Daemon, serve) -> None:
    daemons: list[Daemon] = [daemon, serve()]
    status, out, _ = run("status", "--all", "--json")
    found = {line["control"]: line["pid"] for line in map(json.loads, out.splitlines()) if "pid" in line}
    assert {daemon.ready["control"]: daemon.process.pid for daemon in daemons}.items() <= found.items()
    (line,) = [line for line in run("status", "--all")[1].splitlines() if line.startswith(daemons[1].ready["control"])]
    assert line.split()[1] == "no_data"


def test_all_are_watched_until_ctrl_c(run, daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    pauses = iter(range(2))

    def pause(seconds: float) -> None:
        if next(pauses, None) is None:
            raise KeyboardInterrupt

    monkeypatch.setattr("time.sleep", pause)
    status, out, _ = run("status", "--all", "--watch", "--json")
    told = [json.loads(line)["control"] for line in out.splitlines()]
    assert (status, told.count(daemon.ready["control"])) == (0, 3)
    pauses = iter(range(2))
    monkeypatch.setattr(sys, "stdout", None)  # as an output that is closed: nobody can ask whether it is a terminal
    assert main(["status", "--all", "--watch"]) == 0 and not list(pauses)


def test_one_that_does_not_answer_and_none_at_all_are_said(
    run, fake_control, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tmp_path / "table"
    monkeypatch.setattr(address, "UNIX_SOCKETS", table)
    monkeypatch.setattr(status_command, "SYSTEM", tmp_path / "events.sock")
    status, out, err = run("status", "--all")
    assert (status, out) == (1, "") and "no daemon runs" in err
    installed = fake_control("mad").rename(tmp_path / "events.ctl")
    status, out, _ = run("status", "--all")
    assert status == 1 and f"{installed} " in out and "status: mad" in out


@pytest.mark.parametrize(("folder", "whole"), [("a", True), ("a" * 120, False)])
def test_a_socket_that_was_named_from_a_folder_is_found_from_another(
    folder: str, whole: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless its whole path is longer than that of a socket may be."""
    (tmp_path / folder).mkdir()
    monkeypatch.chdir(tmp_path / folder)
    listener = UnixListener(Path("events.sock"))
    assert listener.sock.getsockname() == (str(tmp_path / folder / "events.sock") if whole else "events.sock")
    listener.close()
    assert not list((tmp_path / folder).iterdir())
