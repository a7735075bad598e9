"""Whom gesturectl believes: root, oneself, and the account to which root gave the socket's folder."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.several import several
from tests.sockets import HELLO

OTHER, OPERATOR = 65_533, 65_532  # two accounts that nobody has

# Binds a socket as another account, says one line to whoever connects, and reports what it was asked.
SERVER = """
import os, socket, sys
path, uid, line = sys.argv[1], int(sys.argv[2]), sys.argv[3]
os.setgroups([]); os.setgid(uid); os.setuid(uid)
listener = socket.socket(socket.AF_UNIX)
listener.bind(path)
os.chmod(path, 0o666)
listener.listen()
print("ready", flush=True)
client, _ = listener.accept()
try:
    client.sendall(line.encode() + b"\\n")
    asked = client.recv(4096)
except ConnectionError:  # it hung up at once
    asked = b""
print(asked.decode() or "nothing", flush=True)
"""

CLIENT = """
import os, sys
from gestured.control.cli import main, parser
parser().format_help()  # loads everything: the other account may not be allowed to read where Python is
os.setgroups([]); os.setgid(int(sys.argv[1])); os.setuid(int(sys.argv[1]))
sys.exit(main(sys.argv[2:]))
"""

EVIL = json.dumps({"ok": True, "type": "hello", "protocol": 1, "model": "\x1b]0;evil\x07", "reason": "\x1b[2J"})
GOOD = json.dumps({"ok": True, "model": "tiny"})

Serve = Callable[[Path, str], "subprocess.Popen[str]"]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Starts a server of the account OTHER at a path, with the line that it says."""

    def begin(path: Path, line: str) -> "subprocess.Popen[str]":
        command = [sys.executable, "-c", SERVER, str(path), str(OTHER), line]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert server.stdout is not None and server.stdout.readline() == "ready\n"
        return server

    def ended(server: "subprocess.Popen[str]") -> None:
        server.kill()
        server.communicate()

    yield from several(begin, ended)


def folder(below: str) -> Iterator[Path]:
    """A folder of the account OTHER."""
    if os.geteuid() != 0:
        pytest.skip("only root can give a folder to another account")
    with tempfile.TemporaryDirectory(prefix="gestured-test-", dir=below) as made:
        os.chown(made, OTHER, OTHER)
        os.chmod(made, 0o755)
        yield Path(made)


@pytest.fixture
def seized() -> Iterator[Path]:
    """A folder where anybody could have made it first."""
    yield from folder("/tmp")


@pytest.fixture
def given() -> Iterator[Path]:
    """A folder that only root can have made, as /run/gestured is."""
    yield from folder("/run")


def heard(server: "subprocess.Popen[str]") -> str:
    assert server.stdout is not None
    return server.stdout.readline().strip()


@pytest.mark.parametrize("command", [["reload"], ["status", "--json"]])
def test_root_asks_nothing_of_whoever_made_the_default_folder_first(
    run, serve: Serve, seized: Path, command: list[str]
) -> None:
    (seized / "gestured").mkdir()
    os.chown(seized / "gestured", OTHER, OTHER)
    path = seized / "gestured" / "events.ctl"
    path.with_suffix(".sock").touch()  # so that it comes before a daemon that is installed on this machine
    server = serve(path, EVIL)
    status, out, err = run(*command, env={"XDG_RUNTIME_DIR": str(seized), "RUNTIME_DIRECTORY": ""})
    said = out + err
    assert status == 1 and f"{path} is served by uid {OTHER}" in said and "neither root nor you" in said
    assert "\x1b" not in said and "--control" in said
    assert heard(server) == "nothing"


def test_nor_does_it_listen_to_him(run, serve: Serve, seized: Path) -> None:
    for more in ([], ["--reconnect"]):
        server = serve(seized / "events.sock", json.dumps(HELLO))
        status, out, err = run("listen", "--socket", seized / "events.sock", *more)
        assert (status, out, err.count("\n")) == (1, "", 1)
        assert f"served by uid {OTHER}" in err and "--socket" in err
        assert heard(server) == "nothing"
        (seized / "events.sock").unlink()


def test_a_link_to_a_folder_that_root_gave_him_is_no_better(run, serve: Serve, seized: Path, given: Path) -> None:
    server = serve(given / "events.ctl", EVIL)
    (seized / "link").symlink_to(given)
    status, out, err = run("reload", "--control", seized / "link" / "events.ctl")
    assert status == 1 and f"served by uid {OTHER}" in err
    assert heard(server) == "nothing"


@pytest.mark.parametrize("operator", [False, True])
def test_the_account_to_which_root_gave_the_folder_is_believed(run, serve: Serve, given: Path, operator: bool) -> None:
    server = serve(given / "events.ctl", GOOD)
    ask = as_operator if operator else run
    assert ask("reload", "--control", given / "events.ctl") == (0, "reloaded; tiny answers\n", "")
    assert json.loads(heard(server)) == {"verb": "reload"}


def test_an_operator_believes_no_other_account(serve: Serve, seized: Path) -> None:
    server = serve(seized / "events.ctl", EVIL)
    status, out, err = as_operator("reload", "--control", seized / "events.ctl")
    assert (status, out) == (1, "") and f"served by uid {OTHER}" in err
    assert heard(server) == "nothing"
    seized.chmod(0o700)  # and one into which he may not look is no bug
    status, out, err = as_operator("reload", XDG_RUNTIME_DIR=str(seized), RUNTIME_DIRECTORY="")
    assert (status, out, err.count("\n")) == (1, "", 1)


def as_operator(*arguments: object, **more: str) -> tuple[int, str, str]:
    """Runs gesturectl as the account OPERATOR, with more in its environment."""
    command = [sys.executable, "-c", CLIENT, str(OPERATOR), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | more, timeout=60)
    return done.returncode, done.stdout, done.stderr
