"""gesturectl status --all: each daemon that is found, a line each."""

import json
from pathlib import Path

import pytest

from gestured.client import address
from tests.daemon import tiny_model
from tests.daemon.harness import Daemon


@pytest.fixture
def session(tmp_path: Path) -> dict[str, str]:
    """The environment of a session with a folder of its own."""
    return {"XDG_RUNTIME_DIR": str(tmp_path)}


def test_each_daemon_is_shown_and_one_that_hangs_or_is_gone_too(run, session, tmp_path: Path):
    model = tiny_model.make(tmp_path / "tiny.onnx")
    daemons = []
    try:
        for name in ("gestured", "gestured-left", "gestured-right"):
            folder = tmp_path / name
            folder.mkdir()
            daemons.append(Daemon.start(folder, model))
        status, out, err = run("status", "--all", "--json", env=session)
        found = {json.loads(line)["control"]: json.loads(line) for line in out.splitlines()}
        mine = {path: found[path] for path in found if path.startswith(str(tmp_path))}
        assert {Path(path).parent.name for path in mine} == {"gestured", "gestured-left", "gestured-right"}
        assert {each["pid"] for each in mine.values()} == {daemon.process.pid for daemon in daemons}
        daemons[1].process.kill()
        daemons[1].process.wait()
        status, out, err = run("status", "--all", env=session)
        assert status == 1
        (gone,) = [line for line in out.splitlines() if "gestured-left" in line]
        assert "no daemon on" in gone
        assert [line.split()[1] for line in out.splitlines() if "gestured-right" in line] != []
    finally:
        for daemon in daemons:
            daemon.stop()


def test_none_at_all_is_said(run, session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(address, "SYSTEM", tmp_path / "run" / "gestured" / "events.sock")
    assert address.find_all_controls(session) == []
    for name in ("gestured", "gestured-left"):
        (tmp_path / "run" / name).mkdir(parents=True)
        (tmp_path / "run" / name / "events.ctl").touch()
    assert [path.parent.name for path in address.find_all_controls(session)] == ["gestured", "gestured-left"]
