"""A scene pays for what it uses and for nothing else: what real daemons import, map, open and start."""

import os
import re
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gestured.core import wire
from gestured.model.model import shipped
from tests import encoding
from tests.daemon.harness import RATE_HZ, Daemon, Frame, Hand, Sensor, floats
from tests.daemon.parts import SOURCE, Parts

NEVER = {"torch", "sklearn", "pywt", "matplotlib", "scipy", "onnx", "mcap"}
EVERYTHING = ("--metrics", "127.0.0.1:0", "--publish", "osc://127.0.0.1:9", "--flight-recorder", "1")
Start = Callable[..., Daemon]


def imported(daemon: Daemon) -> set[str]:
    """The packages that it has imported so far, as the interpreter itself reports them."""
    names = re.findall(r"^import time:.*\| +(\S+)$", daemon.stderr(), re.MULTILINE)
    return {name.partition(".")[0] for name in names}


def libraries(daemon: Daemon) -> str:
    """What is mapped into its memory."""
    return Path(f"/proc/{daemon.process.pid}/maps").read_text()


def count(daemon: Daemon, what: str) -> int:
    """Its threads ("task") or descriptors ("fd")."""
    return len(os.listdir(f"/proc/{daemon.process.pid}/{what}"))


def used(
    start: Start, *flags: str, model: object = "cnn_lstm", make: Callable[[Daemon, str], Sensor] = Sensor
) -> Daemon:
    """A daemon that has answered one swipe of a sensor, with `python -X importtime`."""
    if model in shipped() and not shipped()[str(model)].exists():
        pytest.skip(f"{shipped()[str(model)]} is not there")
    daemon = start("--clock", "sensor", *flags, model=model, python=("-X", "importtime"))
    with_client = daemon.client().subscribe("gesture", "unknown")
    sensor = make(daemon, "armrest")
    sensor.send(sensor.hand.idle(1.5) + sensor.hand.swipe("right") + sensor.hand.idle(1.0))
    with_client.until(lambda line: line["type"] in ("gesture", "unknown"))
    with_client.close()
    return daemon


class Fingers(Sensor):
    """A sensor that sends finger positions in a bundle with each frame."""

    def packet(self, frame: Frame) -> bytes:
        """The next frame as a packet."""
        self.t += 1 / RATE_HZ
        self.count += 1
        pressure = floats(f"/{self.name}/pressure", frame, self.count)
        return encoding.bundle([pressure, trajectory(self.name)], self.t)


def trajectory(sensor: str, types: str = "iffiff") -> bytes:
    """Positions of fingers."""
    return encoding.message(f"/{sensor}/trajectory", types, ([1, 4.0, 4.0] * 5)[: len(types)])


SCENES: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "minimal": ((), {}),
    "metrics": (("--metrics", "127.0.0.1:0"), {}),
    "OSC out": (("--publish", "osc://127.0.0.1:9"), {}),
    "forest only": ((), {"model": "touch_pattern_rf"}),
    "trajectories": ((), {"make": Fingers}),
    "everything": (EVERYTHING, {"make": Fingers}),
    "swipes only": (("--gestures", "swipe_left,swipe_right"), {}),
}


@pytest.mark.parametrize("scene", SCENES)
def test_no_scene_loads_what_belongs_to_training(start: Start, scene: str) -> None:
    flags, more = SCENES[scene]
    daemon = used(start, *flags, **more)
    assert not imported(daemon) & NEVER
    assert "libtorch" not in libraries(daemon)
    assert "numpy" in imported(daemon)  # so that an empty report does not pass


def test_numpy_brings_no_threads_no_random_numbers_and_no_masked_arrays(start: Start) -> None:
    daemon = used(start)
    # The loop, the log, what ends a run of a model that takes too long, and what ends the process where the loop hangs.
    assert count(daemon, "task") == 4
    assert "numpy.random" not in daemon.stderr() and "numpy.ma.core" not in daemon.stderr()


def test_the_metrics_library_comes_with_metrics_alone(start: Start) -> None:
    assert "prometheus_client" not in imported(used(start, "--publish", "osc://127.0.0.1:9"))


def test_python_osc_comes_with_osc_output_alone(start: Start) -> None:
    silent = used(start, "--metrics", "127.0.0.1:0", "--flight-recorder", "1")
    silent.stop()
    assert "pythonosc" not in imported(silent)
    assert "pythonosc" in imported(used(start, "--publish", "osc://127.0.0.1:9"))


def test_the_metrics_library_comes_with_the_first_scrape(start: Start) -> None:
    daemon = used(start, "--metrics", "127.0.0.1:0")
    daemon.get("/metrics")
    assert "prometheus_client" in imported(daemon)


def test_a_daemon_without_metrics_has_no_http_thread_and_no_tcp_socket(start: Start) -> None:
    daemon = used(start)
    with_http = Path(f"/proc/{daemon.process.pid}/net/tcp").read_text()
    own = {os.readlink(f"/proc/{daemon.process.pid}/fd/{fd}") for fd in os.listdir(f"/proc/{daemon.process.pid}/fd")}
    listening = {line.split()[9] for line in with_http.splitlines()[1:] if line.split()[3] == "0A"}
    assert not own & {f"socket:[{inode}]" for inode in listening}
    assert "gestured.daemon.http" not in daemon.stderr()


def test_threads_and_descriptors_of_http_are_there_with_metrics_alone(start: Start) -> None:
    plain = used(start)
    before = count(plain, "task"), count(plain, "fd")
    plain.stop()
    watched = used(start, "--metrics", "127.0.0.1:0")
    watched.get("/healthz")
    assert count(watched, "task") > before[0]
    assert count(watched, "fd") > before[1]


def test_the_forest_alone_opens_no_network(start: Start) -> None:
    daemon = used(start, model="touch_pattern_rf")
    assert "cnn_lstm" not in daemon.stderr() + libraries(daemon)
    assert daemon.client().hello["model"] == "touch_pattern_rf"


def test_finger_positions_cost_nothing_that_is_kept(start: Start) -> None:
    """Nothing in the daemon asks for them: right or wrong ones, with a frame or without, leave no trace."""
    daemon = used(start, "--metrics", "127.0.0.1:0", make=Fingers)
    before = daemon.get("/metrics")[1].count("\n")
    with socket.socket(type=socket.SOCK_DGRAM) as sender:
        sender.connect(daemon.address)
        for n in range(300):  # of sensors that send nothing else
            sender.send(trajectory(f"ghost{n}"))
            sender.send(trajectory(f"ghost{n}", "iff" * 5))
            sender.send(trajectory("armrest", "fff"))
    frames = daemon.frames()
    Sensor(daemon, "door").send(Hand().idle(1.0))
    while daemon.frames() < frames + RATE_HZ:
        pass
    status = daemon.get("/readyz")[1]
    assert "armrest" in status and "door" in status and "ghost" not in status
    assert daemon.metric("gestured_sensors") == 2
    text = daemon.get("/metrics")[1]
    assert not re.search(r"^gestured_dropped_total\{.*\} [1-9]", text, re.MULTILINE)
    assert text.count("\n") - before < 50  # the door's own series


def test_finger_positions_are_passed_over_at_their_address(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = Parts(model)
    monkeypatch.setattr(wire, "_touches", None)  # nobody calls it
    frame = floats("/armrest/pressure", Hand().frame(), 0)
    for n in range(100):
        packet = encoding.bundle([trajectory(f"s{n}"), frame, trajectory("armrest")], 1.7e9 + n)
        parts.desk.take(parts.hub.receive([(packet, SOURCE)], n / 15))
    assert parts.metrics.frames.values == {("armrest", "ok"): 100} and parts.metrics.dropped.values == {}


def test_the_explanation_names_what_is_left_out() -> None:
    def explained(*flags: str) -> str:
        command = [sys.executable, "-m", "gestured.daemon", "--model", "cnn_lstm", *flags, "--explain"]
        return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout

    minimal, everything = explained(), explained(*EVERYTHING)
    for text in ("no --metrics", "python-osc, OSC output: no --publish"):
        assert text in minimal
        assert text not in everything
    assert "second tap" in explained("--gestures", "swipe_left,swipe_right")
