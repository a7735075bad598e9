"""What is still answered while a model hangs, and what systemd is told then."""

import json
import os
import signal
import socket
from pathlib import Path

import pytest

from gestured.client.control import Control
from gestured.client.lines import Unreachable
from gestured.core.front_end import FrontEnd
from gestured.daemon.health import Canary
from tests.daemon.harness import DEADLINE_S, Daemon, Sensor
from tests.daemon.parts import Parts

ROOT = Path(__file__).resolve().parents[2]
HANGING = """
import os
import gestured.model.model
from gestured.core.errors import ModelError

def classify(self, segment):
    open(os.environ["HANG"]).read()  # a pipe: waits until somebody has opened its other end, and closed it
    raise ModelError("it hung")

gestured.model.model.Model.classify = classify
"""


@pytest.fixture
def hanging(tmp_path: Path) -> dict[str, str]:
    """The environment of a daemon whose model hangs until somebody has had `pipe` open for writing."""
    (tmp_path / "sitecustomize.py").write_text(HANGING)
    os.mkfifo(tmp_path / "pipe")
    return {"PYTHONPATH": f"{tmp_path}:{ROOT}", "HANG": str(tmp_path / "pipe")}


def test_health_and_metrics_answer_while_a_model_hangs_and_the_watchdog_is_not_fed(start, hanging, tmp_path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as supervisor:
        supervisor.bind(str(tmp_path / "notify"))
        supervisor.settimeout(DEADLINE_S)
        environment = hanging | {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "600000"}
        daemon: Daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", env=environment)
        Sensor(daemon, "arm").begin().perform("left")
        while daemon.get("/healthz")[0] == 200:
            pass
        supervisor.setblocking(False)
        with pytest.raises(BlockingIOError):
            while True:
                supervisor.recv(4096)  # what was said before it hung
        status, body = daemon.get("/readyz")
        assert status == 503 and "hangs" in json.loads(body)["reason"]
        assert daemon.sample("gestured_loop_lag_seconds") > 1
        with Control(Path(daemon.ready["control"]), patience_s=0.1) as control:
            with pytest.raises(Unreachable, match="hangs"):
                control.ask("status")
        assert daemon.sample("gestured_sensor_state", sensor="arm", state="stale") == 1
        with pytest.raises(BlockingIOError):
            supervisor.recv(4096)
        open(tmp_path / "pipe", "w").close()  # now it may go on
        supervisor.setblocking(True)
        while b"WATCHDOG=1" not in supervisor.recv(4096):
            pass
        while daemon.get("/healthz")[0] != 200:
            pass


def test_what_ends_a_hang_finds_out_where_it_hung(start, hanging) -> None:
    daemon = start("--clock", "sensor", env=hanging)
    Sensor(daemon, "arm").begin().perform("left")
    while True:
        try:
            pipe = os.open(hanging["HANG"], os.O_WRONLY | os.O_NONBLOCK)  # works only while it waits there
            break
        except OSError:
            pass
    daemon.signal(signal.SIGABRT)  # as systemd's watchdog does
    assert daemon.wait() == -signal.SIGABRT
    os.close(pipe)
    assert "sitecustomize.py" in daemon.stderr() and "in classify" in daemon.stderr()


def test_the_canary_says_when_the_way_of_a_frame_is_broken(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = Parts(model)
    metrics, canary = parts.metrics, Canary(parts.desk)
    assert all(canary.sings() for _ in range(50)) and metrics.internal_errors.total() == 0
    with monkeypatch.context() as patch:
        patch.setattr(FrontEnd, "push", lambda self, frame: 1 / 0)
        assert not canary.sings()
    assert metrics.internal_errors.total() == 1
    assert canary.sings()


def test_signals_that_come_again_while_it_ends_do_not_make_it_a_crash(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0")
    daemon.signal(signal.SIGTERM)
    while daemon.process.poll() is None:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            daemon.signal(number)
    assert daemon.wait() == 0
