"""The daemon over UDP, at any speed, says what the recognizer says in the process: event for event."""

import random
from pathlib import Path

import numpy as np
import pytest

from gestured.core.events import Event
from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.messages import event_type
from gestured.core.recognizer import Recognizer, events_of
from gestured.model.model import open_model
from tests.daemon import harness
from tests.daemon.harness import Daemon, Hand, Sensor

KINDS = ("gesture", "unknown", "cancelled", "onset", "release")


def session(seed: int) -> list[tuple[float, harness.Frame]]:
    """(time in s, frame): everything a hand does, with jitter, gaps and a rest that is too long."""
    pick, hand = random.Random(seed), Hand(seed)
    frames = hand.idle(2.0)
    for _ in range(25):
        what = pick.choice(["tap", "double", "left", "right", "up", "down", "press", "hold"])
        if what == "tap":
            frames += hand.tap()
        elif what == "double":
            frames += hand.tap() + hand.idle(0.2) + hand.tap()
        elif what in ("press", "hold"):
            frames += [hand.frame(4.0) for _ in range(15 if what == "press" else 90)]
        else:
            frames += hand.swipe(what)
        frames += hand.idle(pick.choice([0.2, 0.7, 1.5]))
    t, timed = 0.0, []
    for frame in frames:
        t += 1 / 15 + pick.uniform(-0.005, 0.005) + (2.0 if pick.random() < 0.004 else 0.0)
        timed.append((t, frame))
    return timed


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_online_is_offline(shared: Daemon, model: Path, seed: int) -> None:
    name, timed = f"session{seed}", session(seed)
    recognizer = Recognizer(FrontEnd(name, 9, 9), open_model(model))
    offline: list[Event] = []
    for t, frame in timed:
        offline += events_of(recognizer.push(Frame(t, frame.astype(np.float32))))
    assert len(offline) > 50 and {"gesture", "cancelled"} < {event_type(event) for event in offline}
    client = shared.client().subscribe(*KINDS, sensors=[name])
    sensor = Sensor(shared, name)
    taken = shared.frames()
    for n, (t, frame) in enumerate(timed, start=1):
        sensor.t = 1e9 + t - 1 / harness.RATE_HZ
        sensor.send([frame])
        while n % 100 == 0 and shared.frames() < taken + n:
            pass  # as fast as it goes, without overrunning a socket's buffer
    online = [client.line() for _ in offline]
    began = online[0]["onset"] - offline[0].onset
    for ours, theirs in zip(online, offline, strict=True):
        assert (ours["type"], ours["id"]) == (event_type(theirs), theirs.id)
        for key in ("gesture", "sequence", "frames", "lost", "reason"):
            assert ours.get(key) == getattr(theirs, key, None)
        for key in ("onset", "offset", "decided"):
            assert ours.get(key, began) - began == pytest.approx(getattr(theirs, key, 0.0), abs=1e-3)
        assert ours.get("scores", {}) == pytest.approx(getattr(theirs, "scores", {}), abs=1e-5)
