"""The daemon over UDP, at any speed, says what the recognizer says in the process: event for event."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import gestured
from gestured.core.events import Event
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.messages import event_type
from gestured.core.recognizer import Recognizer
from gestured.model.opening import open_model
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
    same(said(shared, name, timed, len(offline)), offline)


def test_a_process_of_ones_own_hears_the_same(start: Callable[..., Daemon], model: Path, tmp_path: Path) -> None:
    """gestured.open with what the daemon's settings say; a hand stays on the sensor when it falls silent."""
    used = ["one_tap", "swipe_left", "swipe_up"]
    settings = tmp_path / "gestured.toml"
    settings.write_text(f"gestures.use = {used}\n[sensors.turned]\nrotate = 90\nmirror = true\n")
    timed = session(4)
    timed += [(timed[-1][0] + n / harness.RATE_HZ, Hand(9).frame(4.0)) for n in range(1, 8)]
    recognizer = gestured.open(model, sensor="turned", grid=(9, 9), rotate=90, mirror=True, gestures=used)
    own: list[Event] = []
    for t, frame in timed:
        own += recognizer.push(t, frame.tolist())
    own += recognizer.flush(timed[-1][0] + 60.0)
    last = [event_type(event) for event in own[-3:]]
    assert last == ["onset", "cancelled", "release"] and {"gesture", "unknown"} < {event_type(event) for event in own}
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", "--config", settings)
    same(said(daemon, "turned", timed, len(own)), own)


def said(daemon: Daemon, name: str, timed: list[tuple[float, harness.Frame]], count: int) -> list[harness.Line]:
    """The first lines that a daemon says of a sensor whose frames were felt at these times."""
    client = daemon.client().subscribe(*KINDS, sensors=[name])
    sensor = Sensor(daemon, name)
    taken = daemon.frames()
    for n, (t, frame) in enumerate(timed, start=1):
        sensor.t = 1e9 + t - 1 / harness.RATE_HZ
        sensor.send([frame])
        while n % 100 == 0 and daemon.frames() < taken + n:
            pass  # as fast as it goes, without overrunning a socket's buffer
    return [client.line() for _ in range(count)]


def same(online: list[harness.Line], offline: list[Event]) -> None:
    """Event for event, but for where the times begin."""
    began = online[0]["onset"] - offline[0].onset
    for ours, theirs in zip(online, offline, strict=True):
        assert (ours["type"], ours["id"]) == (event_type(theirs), theirs.id)
        for key in ("gesture", "sequence", "frames", "lost", "reason"):
            assert ours.get(key) == getattr(theirs, key, None)
        for key in ("onset", "offset", "decided"):
            assert ours.get(key, began) - began == pytest.approx(getattr(theirs, key, 0.0), abs=1e-3)
        assert ours.get("scores", {}) == pytest.approx(getattr(theirs, "scores", {}), abs=1e-5)
