"""Frames that nobody here made: real fingers."""

import signal
import socket
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gestured.model.shipped import shipped
from gestured.record.judge import Performed, Tally
from tests import encoding
from tests.daemon.harness import Daemon

ROOT = Path(__file__).resolve().parents[1]
SESSIONS = ROOT.parent / "shared" / "data" / "capfingerid_sessions_dev.npz"
BATCH = 400  # frames on the way at once: fewer than a socket's buffer holds

pytestmark = pytest.mark.e2e


def test_real_fingers(serve: Callable[..., Daemon]) -> None:
    """Swipes and taps on a touchscreen come out as what they were, mostly."""
    if not shipped()["cnn_lstm"].exists():
        pytest.skip(f"{shipped()['cnn_lstm']} is not there")
    if not SESSIONS.exists():
        pytest.skip(f"{SESSIONS} is not there")
    with np.load(SESSIONS, allow_pickle=False) as data:
        sessions = dict(data)
    daemon = serve("--metrics", "127.0.0.1:0", "--grid", "27x15", "--clock", "sensor", model="cnn_lstm")
    chosen = (1, 4, 8)
    client = daemon.client().subscribe("gesture", "release")
    begun = {number: send_session(daemon, sessions, number) for number in chosen}
    assert daemon.process.poll() is None
    daemon.signal(signal.SIGTERM)  # what it has still to say, it says before it ends
    events = [event for event in client.rest() if event["type"] == "gesture"]
    performed, verdicts = 0, Counter[str]()
    for number in chosen:
        acts = truth(sessions, number, begun[number])
        performed += sum(act.label.startswith("swipe") for act in acts)
        tally = Tally(acts)
        for event in events:
            outcome = tally.hear(event, event["decided"]) if event["sensor"] == f"session-{number}" else None
            if outcome is not None and outcome.performed is not None and outcome.performed.label.startswith("swipe"):
                verdicts[outcome.verdict] += 1
    right, wrong = verdicts["right"], verdicts["wrong"]
    assert performed > 50
    assert right / performed > 0.6, f"{right} of {performed} right"
    assert wrong / performed < 0.2, f"{wrong} of {performed} wrong"


def truth(sessions: dict[str, np.ndarray], number: int, begun: float) -> list[Performed]:
    """What was performed in a session whose time 0 was at `begun` (epoch s)."""
    mine = sessions["event_recording"] == number
    columns = (sessions[name][mine].tolist() for name in ("event_labels", "event_onsets", "event_offsets"))
    rows = zip(*columns, strict=True)
    return [Performed(label, label, begun + onset, begun + offset) for label, onset, offset in rows]


def frames(daemon: Daemon) -> int:
    """How many frames it has looked at, whatever became of them."""
    lines = daemon.get("/metrics")[1].splitlines()
    return round(sum(float(line.split()[-1]) for line in lines if line.startswith("gestured_frames_total")))


def send_session(daemon: Daemon, sessions: dict[str, np.ndarray], number: int) -> float:
    """Sends one session as fast as the daemon takes it; returns the epoch time of the recording's time 0."""
    first, last = sessions["offsets"][number : number + 2]
    times = sessions["times"][first:last]
    before = frames(daemon)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(daemon.address)
        begun = time.time()
        for n, (t, frame) in enumerate(zip(times.tolist(), sessions["frames"][first:last], strict=True)):
            address = f"/session-{number}/pressure"
            message = encoding.message(address, "ib", [n, frame.astype(np.uint8).tobytes()])
            sender.send(encoding.bundle([message], begun + t))
            if n % BATCH == BATCH - 1 or n == len(times) - 1:
                while frames(daemon) < before + n + 1:
                    pass  # each look is a request over HTTP: the daemon sets the pace
    return begun - float(times[0])
