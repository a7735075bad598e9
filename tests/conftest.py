"""What all tests stand on: a clean environment; and what several do."""

import hashlib
import json
import locale
import os
import signal
import socket
import tempfile
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from gestured.model.shipped import LADDER
from tests.daemon import tiny_model
from tests.daemon.harness import Daemon
from tests.daemon.trust import trust
from tests.several import several
from tests.small_model import GESTURES, build
from tests.sockets import PATIENCE_S, FakeDaemon

ROOT = Path(__file__).resolve().parents[1]
KEPT = ("PATH", "LD_LIBRARY_PATH")  # programs and libraries are where this machine has them
LONGEST = 40  # bytes of a folder for temporary files; with a test's name a Unix socket below it must stay under 108


def clean_environment() -> tempfile.TemporaryDirectory[str]:
    """The same environment for every test and the processes that it starts: nobody's settings, home, language, session.

    A test sees nothing of the caller's but `KEPT` and pytest's own variables. The folder that is returned holds the
    home and the session's sockets until it is deleted.
    """
    temporary = os.path.realpath(tempfile.gettempdir())
    tempfile.tempdir = temporary if len(os.fsencode(temporary)) <= LONGEST else "/tmp"
    folder = tempfile.TemporaryDirectory(prefix="gestured-tests-")
    os.chmod(folder.name, 0o755)  # accounts without rights find the way to their own files below it
    home, session = Path(folder.name, "home"), Path(folder.name, "session")
    home.mkdir()
    session.mkdir(mode=0o700)
    for name in list(os.environ):
        if name not in KEPT and not name.startswith("PYTEST_"):
            del os.environ[name]
    os.environ |= {
        "HOME": str(home),
        "LC_ALL": "C.UTF-8",
        "PYTHONPATH": str(ROOT),  # from any folder a child runs this checkout
        "TERM": "dumb",
        "TMPDIR": tempfile.tempdir,
        "XDG_RUNTIME_DIR": str(session),  # the default sockets are here, not where an installed daemon has them
    }
    locale.setlocale(locale.LC_ALL, "C.UTF-8")
    os.umask(0o022)
    # A job in a shell's background ignores Ctrl-C, and so would the programs that are tested.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    return folder


_cleaned = clean_environment()  # before any test module is imported
trust()

# No test asserts a time, and on a loaded machine Hypothesis' own limits would be one. Each run draws other examples.
settings.register_profile("any machine", deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")


@pytest.fixture
def udp() -> Iterator[socket.socket]:
    """A UDP socket on the loopback that keeps what is sent to it."""
    with socket.socket(type=socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(PATIENCE_S)
        yield receiver


@pytest.fixture
def fake(tmp_path: Path) -> Iterator[FakeDaemon]:
    """An event socket that says what the test tells it to."""
    daemon = FakeDaemon(tmp_path / "events.sock")
    yield daemon
    daemon.listener.close()


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A valid model file named tiny."""
    pytest.importorskip("onnx", reason="the tests' own model is made with the onnx package")
    return tiny_model.make(tmp_path_factory.mktemp("model") / "tiny.onnx")


@pytest.fixture
def serve(model: Path, tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Starts daemons with these flags, each in a folder of its own; they end with the test, and end well."""
    numbers = count()

    def begin(*flags: object, model: object = model) -> Daemon:
        folder = tmp_path / f"daemon{next(numbers)}"
        folder.mkdir()
        return Daemon.start(folder, model, *flags)

    yield from several(begin, Daemon.ends_well)


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of shipped models with a manifest, in place of the package's own."""
    directory = tmp_path / "shelf"
    directory.mkdir()
    for name in LADDER:
        build(directory / f"{name}.onnx", takes="features" if name == "touch_pattern_rf" else "frames")
    files = {
        path.name: {"sha256": hashlib.sha256(path.read_bytes()).hexdigest(), "gestures": GESTURES}
        for path in directory.iterdir()
    }
    (directory / "manifest.json").write_text(json.dumps({"models": files}))
    monkeypatch.setattr("gestured.model.shipped._shipped_directory", lambda: directory)
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.chdir(empty)
    return directory
