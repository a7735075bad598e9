"""Which daemon gesturectl talks to when nobody says so."""

import os
from pathlib import Path

import pytest

from gestured.client import address
from gestured.core.errors import SettingsError


@pytest.fixture
def system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The installed service's socket, in a folder that is not there yet."""
    path = tmp_path / "run" / "events.sock"
    monkeypatch.setattr(address, "SYSTEM", path)
    return path


def test_a_daemon_of_ones_own_comes_before_the_installed_service(tmp_path: Path, system: Path):
    own = tmp_path / "gestured" / "events.sock"
    environ = {"XDG_RUNTIME_DIR": str(tmp_path)}
    assert address.find_socket(environ) == own
    system.parent.mkdir()
    assert address.find_socket(environ) == system
    assert address.find_control(environ) == system.with_suffix(".ctl")
    own.parent.mkdir()
    own.touch()
    assert address.find_socket(environ) == own


def test_what_the_environment_says_comes_first(tmp_path: Path, system: Path):
    system.parent.mkdir()
    assert address.find_socket({"GESTURED_SOCKET": "/a/b.sock", "RUNTIME_DIRECTORY": "/c"}) == Path("/a/b.sock")
    assert address.find_socket({"RUNTIME_DIRECTORY": "/c:/d"}) == Path("/c/events.sock")


@pytest.mark.parametrize("path", ["/", "."])
def test_what_the_environment_says_must_have_a_name(path: str):
    with pytest.raises(SettingsError, match="GESTURED_SOCKET: expected the path"):
        address.find_control({"GESTURED_SOCKET": path})


def test_without_a_session_root_has_the_services_folder_and_others_are_asked_for_a_path(
    system: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert address.default_socket({}) == address.find_socket({}) == system
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    for asked in (address.default_socket, address.find_socket, address.find_control):
        with pytest.raises(SettingsError, match=r"XDG_RUNTIME_DIR .* --socket"):
            asked({})
    system.parent.mkdir()
    assert address.find_socket({}) == system
