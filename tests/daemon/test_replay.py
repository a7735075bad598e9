"""The daemon over UDP, at any speed, says what the recognizer says in the process: event for event."""

import dataclasses
import json
import random
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

import gestured
from gestured.core.events import Event
from gestured.core.messages import event_type
from gestured.daemon import operations
from gestured.daemon.asked import scene_of
from gestured.daemon.merge import load_settings
from gestured.daemon.parts import Parts
from gestured.model.ladder import ladder_for
from gestured.record.replay import maker
from tests.daemon import harness, tiny_model
from tests.daemon.harness import Daemon, Hand, Sensor

QUIET = 20  # frames after a contact, in which all is decided that it leaves open
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


@pytest.mark.parametrize("used", [["one_tap", "swipe_left", "swipe_up"], list(tiny_model.GESTURES)])
def test_online_is_offline(start: Callable[..., Daemon], model: Path, tmp_path: Path, used: list[str]) -> None:
    """gestured.open with what the daemon's settings say; a hand stays on the sensor when it falls silent."""
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
    assert last == ["onset", "cancelled", "release"] and len(own) > 50
    assert {event_type(event) for event in own} >= {"gesture", "cancelled"}
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", "--config", settings)
    same(said(daemon, "turned", timed, len(own)), own)


def said(daemon: Daemon, name: str, timed: list[tuple[float, harness.Frame]], count: int) -> list[harness.Line]:
    """The first lines that a daemon says of a sensor whose frames were felt at these times.

    They go as fast as it goes, without overrunning a socket's buffer, and wait only while nobody touches the sensor:
    during a contact the daemon would decide by the time that passes meanwhile.
    """
    client = daemon.client().subscribe(*KINDS, sensors=[name])
    sensor, packets = Sensor(daemon, name), list[bytes]()
    for t, frame in timed:
        sensor.t = 1e9 + t - 1 / harness.RATE_HZ
        packets.append(sensor.packet(frame))
    taken, quiet = daemon.frames(), 0
    for n, ((_, frame), packet) in enumerate(zip(timed, packets, strict=True), start=1):
        sensor.sock.send(packet)
        quiet = quiet + 1 if frame.max() < 30 else 0
        while quiet == QUIET and daemon.frames() < taken + n:
            pass
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


def test_a_tape_knows_everything_that_decides(model: Path, tmp_path: Path) -> None:
    file = tmp_path / "gestured.toml"
    file.write_text(
        'grid = "7x8"\nclock = "sensor"\nstale_s = 2.5\ntap_gap_s = 0.3\nprovisional_taps = false\nmax_sensors = 7\n'
        'touch = true\nstrictness = "strict"\nallow = ["127.0.0.0/8", "fd00::/8"]\n'
        'addresses.pressure = "/skin/{sensor}"\n'
        'gestures.use = ["swipe_left", "one_tap"]\ngestures.one_tap = { threshold = 0.75, refractory_s = 1.5 }\n'
        'sensors.arm = { grid = "5x6", rotate = 90, mirror = true, invert = true, clock = "arrival" }\n'
        'sensors.elbow = { strictness = "eager", arming.by = "one_tap", zones.volume.at = [0.0, 0.5, 1.0, 1.0] }\n'
        'arming = { by = "swipe_left", seconds = 3 }\ngates.start = ["door"]\n'
    )
    ladder = ladder_for(model)
    usual, odd = (load_settings({"model": str(model), **given}, {})[0] for given in ({}, {"config": str(file)}))
    scene = scene_of(odd, ladder)
    hub, own, taps = SimpleNamespace(scene=scene), SimpleNamespace(gestures={}), SimpleNamespace(epoch_ns=0)
    parts = SimpleNamespace(ladder=ladder, instance="", hub=hub, own=own, taps=taps, settings=odd)
    told = operations.scene(cast(Parts, parts))
    read, other = maker(json.loads(json.dumps(told))).scene, scene_of(usual, ladder)
    kept = {"touches", "frames"}  # what is told beside the answers decides nothing
    for name in {field.name for field in dataclasses.fields(scene)} - kept:
        assert getattr(read, name) == getattr(scene, name) != getattr(other, name), name
