"""Frames that nobody here wrote or made: an OSC tool of Debian's, python-osc's client, real fingers."""

import json
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gestured.client.stream import Stream
from gestured.core.address import Address
from gestured.model.shipped import shipped
from tests import encoding

ROOT = Path(__file__).resolve().parents[1]
SESSIONS = ROOT.parent / "shared" / "data" / "capfingerid_sessions_dev.npz"
RATE_HZ = 15.0
IDLE_S, PRESS_S = 1.6, 0.2
BATCH = 400  # frames on the way at once: fewer than a socket's buffer holds

pytestmark = pytest.mark.e2e


class Daemon:
    """The real daemon as a process, with the shipped model."""

    def __init__(self, folder: Path, *flags: str) -> None:
        path = folder / "events.sock"
        command = [
            sys.executable,
            "-m",
            "gestured.daemon",
            "--listen",
            "127.0.0.1:0",
            "--metrics",
            "127.0.0.1:0",
        ]
        self.process = subprocess.Popen(
            [*command, "--socket", str(path), "--model", str(shipped()["cnn_lstm"]), *flags],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert self.process.stdout is not None
        self.ready: dict[str, Any] = json.loads(self.process.stdout.readline())
        self.ending = False
        self.port = Address.parse(self.ready["listen"]).port

    def stream(self, *types: str) -> Stream:
        return Stream(Path(self.ready["socket"]), {"types": types})

    def frames(self) -> int:
        """How many frames it has looked at, whatever became of them."""
        with urllib.request.urlopen(f"http://{self.ready['metrics']}/metrics", timeout=10) as answer:
            lines = answer.read().decode().splitlines()
        return int(sum(float(line.split()[-1]) for line in lines if line.startswith("gestured_frames_total")))

    def end(self) -> None:
        """Ask it to end, once; what it has still to say, it says before."""
        if not self.ending:
            self.ending = True
            self.process.terminate()

    def close(self) -> int:
        self.end()
        status = self.process.wait(20)
        self.process.stdout.close()
        return status


@pytest.fixture
def daemon(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Daemon]:
    if not shipped()["cnn_lstm"].exists():
        pytest.skip(f"{shipped()['cnn_lstm']} is not there")
    running = Daemon(tmp_path, *getattr(request, "param", ()))
    yield running
    assert running.close() == 0


def tap() -> Iterator[list[int]]:
    """A finger on row 2, column 6 for a moment, on a sensor of 9 x 9 that is idle otherwise; at its rate."""
    start = time.monotonic()
    press = round(IDLE_S * RATE_HZ), round((IDLE_S + PRESS_S) * RATE_HZ)
    for n in range(round((2 * IDLE_S + PRESS_S) * RATE_HZ)):
        time.sleep(max(0.0, start + n / RATE_HZ - time.monotonic()))  # this is the sensor's own clock
        frame = np.full((9, 9), 300 + n % 2)
        if press[0] <= n < press[1]:
            frame[1:4, 5:8] += 150
            frame[2, 6] += 450
        yield frame.ravel().tolist()


def answered(stream: Stream) -> dict[str, dict[str, Any]]:
    """The events of one contact by type."""
    seen: dict[str, dict[str, Any]] = {}
    for event in stream:
        seen[event["type"]] = event
        if "release" in seen and {"gesture", "unknown", "cancelled"} & seen.keys():
            return seen
    raise AssertionError(f"the daemon closed the stream after {seen}")


def check_tap(daemon: Daemon, send: Any) -> None:
    stream = daemon.stream("onset", "gesture", "unknown", "cancelled", "release")
    for values in tap():
        send(values)
    seen = answered(stream)
    stream.close()
    assert seen["onset"]["sensor"] == "armrest"
    assert seen["gesture"]["gesture"] == "one_tap"
    assert seen["gesture"]["scores"].keys() == set(stream.hello["gestures"])


def test_frames_from_oscsend(daemon: Daemon):
    if shutil.which("oscsend") is None:
        pytest.skip("oscsend is not installed: apt install liblo-tools")

    def send(values: list[int]) -> None:
        address = ["oscsend", "127.0.0.1", str(daemon.port), "/armrest/pressure", "i" * len(values)]
        subprocess.run([*address, *map(str, values)], check=True, timeout=10)

    check_tap(daemon, send)


def test_frames_from_python_osc(daemon: Daemon):
    from pythonosc.udp_client import SimpleUDPClient

    client = SimpleUDPClient("127.0.0.1", daemon.port)
    check_tap(daemon, lambda values: client.send_message("/armrest/pressure", [float(value) for value in values]))


@pytest.mark.parametrize("daemon", [("--grid", "27x15", "--clock", "sensor")], indirect=True)
def test_real_fingers(daemon: Daemon):
    """Swipes and taps on a touchscreen come out as what they were, mostly."""
    if not SESSIONS.exists():
        pytest.skip(f"{SESSIONS} is not there")
    with np.load(SESSIONS, allow_pickle=False) as data:
        sessions = dict(data)
    chosen = (1, 4, 8)
    stream = daemon.stream("gesture", "release")
    begun = {number: send_session(daemon, sessions, number) for number in chosen}
    assert daemon.process.poll() is None
    daemon.end()
    events = [event for event in stream if event["type"] == "gesture"]
    right = wrong = performed = 0
    for number in chosen:
        heard = [event for event in events if event["sensor"] == f"session-{number}"]
        for label, onset, offset in truth(sessions, number):
            if not label.startswith("swipe"):
                continue
            performed += 1
            answers = {e["gesture"] for e in heard if overlap(e, begun[number] + onset, begun[number] + offset)}
            right += label in answers
            wrong += bool(answers) and label not in answers
    assert performed > 50
    assert right / performed > 0.6, f"{right} of {performed} right"
    assert wrong / performed < 0.2, f"{wrong} of {performed} wrong"


def truth(sessions: dict[str, np.ndarray], number: int) -> list[tuple[str, float, float]]:
    mine = sessions["event_recording"] == number
    columns = (sessions[name][mine].tolist() for name in ("event_labels", "event_onsets", "event_offsets"))
    return list(zip(*columns, strict=True))


def overlap(event: dict[str, Any], onset: float, offset: float) -> bool:
    return bool(min(event["offset"], offset) - max(event["onset"], onset) > -0.2)


def send_session(daemon: Daemon, sessions: dict[str, np.ndarray], number: int) -> float:
    """Sends one session as fast as the daemon takes it; returns the epoch time of the recording's time 0."""
    first, last = sessions["offsets"][number : number + 2]
    times = sessions["times"][first:last]
    before = daemon.frames()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", daemon.port))
        begun = time.time()
        for n, (t, frame) in enumerate(zip(times.tolist(), sessions["frames"][first:last], strict=True)):
            address = f"/session-{number}/pressure"
            message = encoding.message(address, "ib", [n, frame.astype(np.uint8).tobytes()])
            sender.send(encoding.bundle([message], begun + t))
            if n % BATCH == BATCH - 1 or n == len(times) - 1:
                while daemon.frames() < before + n + 1:
                    pass  # each look is a request over HTTP: the daemon sets the pace
    return begun - float(times[0])
