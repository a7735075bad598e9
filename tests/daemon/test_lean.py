"""A scene pays for what it uses and for nothing else: what real daemons import, map, open and start."""

import math
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from gestured.core import wire
from gestured.model.shipped import shipped
from tests import encoding
from tests.daemon.harness import Daemon, Hand, Sensor, floats
from tests.daemon.parts import SOURCE, Parts

NEVER = {"torch", "sklearn", "pywt", "matplotlib", "scipy", "onnx", "mcap"}
Used = Callable[[str], Daemon]


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


SCENES: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "minimal": ((), {}),
    "all but OSC out": (("--metrics", "127.0.0.1:0", "--flight-recorder", "1"), {}),
    "OSC out": (("--publish", "osc://127.0.0.1:9"), {}),
    "forest only": ((), {"model": "touch_pattern_rf"}),
}


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Used]:
    """Daemons of the scenes that have answered one swipe, with `python -X importtime`; one of each for all tests."""
    running: dict[str, Daemon] = {}

    def used(scene: str) -> Daemon:
        if scene not in running:
            flags, more = SCENES[scene]
            model = more.get("model", "cnn_lstm")
            if not shipped()[model].exists():
                pytest.skip(f"{shipped()[model]} is not there")
            folder = tmp_path_factory.mktemp("scene")
            daemon = Daemon.start(folder, model, "--clock", "sensor", *flags, python=("-X", "importtime"))
            running[scene] = daemon
            client = daemon.client().subscribe("gesture", "unknown")
            sensor = Sensor(daemon, "armrest")
            sensor.send(sensor.hand.idle(1.5) + sensor.hand.swipe("right") + sensor.hand.idle(1.0))
            client.until(lambda line: line["type"] in ("gesture", "unknown"))
            client.close()
        return running[scene]

    yield used
    for daemon in running.values():
        assert daemon.stop() == 0


@pytest.mark.parametrize("scene", SCENES)
def test_no_scene_loads_what_belongs_to_training(used: Used, scene: str) -> None:
    daemon = used(scene)
    assert not imported(daemon) & NEVER
    assert "libtorch" not in libraries(daemon)
    assert "numpy" in imported(daemon)  # so that an empty report does not pass


def test_numpy_brings_no_threads_no_random_numbers_and_no_masked_arrays(used: Used) -> None:
    daemon = used("minimal")
    # The loop, the log, what ends a run of a model that takes too long, and what ends the process where the loop hangs.
    assert count(daemon, "task") == 4
    assert "numpy.random" not in daemon.stderr() and "numpy.ma.core" not in daemon.stderr()


def test_python_osc_comes_with_osc_output_alone(used: Used) -> None:
    assert "pythonosc" not in imported(used("all but OSC out"))
    assert "pythonosc" in imported(used("OSC out"))


def test_the_metrics_library_comes_with_the_first_scrape(used: Used) -> None:
    assert "prometheus_client" not in imported(used("OSC out"))
    daemon = used("all but OSC out")
    assert "prometheus_client" not in imported(daemon)
    daemon.get("/metrics")
    assert "prometheus_client" in imported(daemon)


def test_a_daemon_without_metrics_has_no_http_thread_and_no_tcp_socket(used: Used) -> None:
    daemon = used("minimal")
    with_http = Path(f"/proc/{daemon.process.pid}/net/tcp").read_text()
    own = {os.readlink(f"/proc/{daemon.process.pid}/fd/{fd}") for fd in os.listdir(f"/proc/{daemon.process.pid}/fd")}
    listening = {line.split()[9] for line in with_http.splitlines()[1:] if line.split()[3] == "0A"}
    assert not own & {f"socket:[{inode}]" for inode in listening}
    assert "gestured.daemon.http" not in daemon.stderr()


def test_the_forest_alone_opens_no_network(used: Used) -> None:
    daemon = used("forest only")
    assert "cnn_lstm" not in daemon.stderr() + libraries(daemon)
    assert daemon.client().hello["model"] == "touch_pattern_rf"


def test_finger_positions_are_not_kept(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trajectories wait for no frame. What is wrong with one is counted as dropped."""

    def trajectory(sensor: str, types: str = "iffiff", y: float = 4.0) -> bytes:
        return encoding.message(f"/{sensor}/trajectory", types, ([1, 4.0, y] * 5)[: len(types)])

    parts = Parts(model)
    monkeypatch.setattr(wire.Decoder, "_join", None)  # nobody calls it
    frame = floats("/armrest/pressure", Hand().frame(), 0)
    for n in range(100):
        together = [trajectory(f"s{n}"), frame, trajectory("armrest"), trajectory(f"s{n}", "iff" * 5)]
        together.append(trajectory("armrest", y=math.nan))
        packets = [encoding.bundle(together, 1.7e9 + n), trajectory(f"ghost{n}"), trajectory("armrest", "fff")]
        parts.desk.take(parts.hub.receive([(packet, SOURCE) for packet in packets], n / 15))
    assert parts.metrics.frames.values == {("armrest", "ok"): 100}
    assert parts.metrics.dropped.values == {(why,): 100 for why in ("too_many_touches", "not_finite", "types")}
    assert list(parts.hub.readings(0.0)) == ["armrest"]
