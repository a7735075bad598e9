"""Too much of everything: packets, clients, requests."""

import json
import resource
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.daemon.harness import Daemon, Sensor
from tests.hostile.grammar import TYPES, violations
from tests.hostile.stall import play
from tests.hostile.test_network import play as send
from tests.hostile.test_network import swipe

MOST_WAITED_S = 5.0  # a daemon that had to wait longer for a processor shows nothing; the test takes 20 s


@pytest.mark.hostile
@pytest.mark.parametrize(
    ("kind", "rate"), [("rubbish", 50_000), ("frames", 50_000), ("sensors", 50_000), ("full", 500)]
)
def test_a_flood_from_one_source_while_another_sensor_works(start, kind: str, rate: int) -> None:
    daemon = start("--metrics", "127.0.0.1:0")
    client = daemon.client().subscribe(*TYPES)
    sensor = Sensor(daemon, "arm")
    quiet = [sensor.hand.frame() for _ in range(90)]
    lines = send(client, [sensor], [quiet])
    flood = [sys.executable, "-m", "tests.hostile.flood", daemon.ready["listen"], kind, "--rate", str(rate)]
    with subprocess.Popen([*flood, "--seconds", "12"], stdout=subprocess.DEVNULL) as source:
        lines += send(client, [sensor], [quiet + quiet])  # what it takes to see that it is a flood
        for direction in ("left", "right", "left", "right"):
            lines += send(client, [sensor], [swipe(sensor, direction)])
            assert daemon.get("/healthz")[0] == 200
        assert source.poll() is None  # it has not ended before
    # After the pause it begins untouched: nobody saw what a finger did in a silence.
    lines += send(client, [sensor], [quiet[:4] + swipe(sensor, "left") + quiet])
    held = daemon.metric("gestured_dropped_total", reason="flood")
    lost = daemon.metric("gestured_kernel_drops_total")
    assert daemon.stop() == 0
    lines += client.rest()
    assert violations(lines) == []
    gestures = [line["gesture"] for line in lines if line["type"] == "gesture"]
    assert gestures[-1] == "swipe_left"  # the next good frame counts
    print(f"{kind}: {held:.0f} packets held back, {lost:.0f} found no room, {len(gestures)} of 5 gestures")
    assert len(gestures) >= 4


@pytest.mark.hostile
@pytest.mark.parametrize(
    ("kind", "rate", "ports"),
    [("full", 500, 1), ("full", 600, 58), ("owners", 600, 58), ("full", 50_000, 1), ("frames", 100_000, 58),
     ("claims", 600, 20), ("claims", 600, 58)],
)  # fmt: skip
def test_while_a_flood_lasts_the_gestures_of_others_are_right(start, kind: str, rate: int, ports: int) -> None:
    """Of kind "claims" each port has a name of its own, so that the flood comes to own sensors while it lasts."""
    daemon = start("--metrics", "127.0.0.1:0", "--max-sensors", "100", model="cnn_lstm")
    flood = [sys.executable, "-m", "tests.hostile.flood", daemon.ready["listen"], kind, "--seconds", "21"]
    flood += ["--rate", str(rate), "--ports", str(ports)]
    with subprocess.Popen(flood, stdout=subprocess.DEVNULL):
        result = play(daemon, 4 if kind == "claims" else 23, 15.0, 0.0, 20.0)
    waited_s = int(Path(f"/proc/{daemon.process.pid}/schedstat").read_text().split()[1]) / 1e9  # for a processor
    print(f"{kind}, {rate} packets/s from {ports} ports: {result}; the daemon waited for {waited_s:.1f} s")
    assert result.violations == []
    right, missed = result.verdicts["right"], result.verdicts["missed"]
    good = result.verdicts["wrong"] + result.verdicts["false"] == 0 and right >= 0.95 * (right + missed)
    if not good and waited_s > MOST_WAITED_S:
        pytest.skip(f"the machine is too busy: the daemon waited {waited_s:.1f} s for a processor")
    assert good, result


def connect(daemon: Daemon) -> socket.socket:
    sock = socket.socket(socket.AF_UNIX)
    sock.settimeout(20)
    sock.connect(str(daemon.socket))
    return sock


@pytest.fixture
def descriptors() -> Iterator[None]:
    """Enough of them for a thousand clients."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard < 2048:
        pytest.skip(f"this test needs 2048 descriptors, there are {hard}")
    resource.setrlimit(resource.RLIMIT_NOFILE, (2048, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.hostile
def test_a_thousand_clients_of_which_some_never_read(start, descriptors) -> None:
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0")
    readers = [connect(daemon) for _ in range(950)]
    stalled = [connect(daemon) for _ in range(50)]
    for sock in stalled:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.sendall(b'{"subscribe":{"types":["gesture","unknown","onset","release","status"]}}\n')
    sensor = Sensor(daemon, "arm").begin()
    watch = daemon.client()
    for _ in range(20):
        sensor.perform("left", "right", "tap")
        watch.events("gesture", "arm", 3)
    assert all(read_until(sock, 60) == list(range(1, 61)) for sock in readers)
    assert daemon.metric("gestured_clients") == 1001
    for sock in (*readers, *stalled):
        sock.close()
    watch.subscribe("status")
    while daemon.metric("gestured_clients") > 1:
        watch.line()


def read_until(sock: socket.socket, last: int) -> list[int]:
    """The sequences of a client's gestures, up to `last`."""
    found: list[int] = []
    with sock.makefile("rb") as file:
        while not found or found[-1] < last:
            line = json.loads(file.readline())
            if line["type"] == "gesture":
                found.append(line["sequence"])
    return found
