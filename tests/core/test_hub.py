"""The one path: whoever goes through the hub uses the same frames and says the same."""

import gc
import ipaddress
import math
import socket
import statistics
import tracemalloc
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from benchmarks.house import idle_calls
from gestured.control.export import sessions_of
from gestured.core.classifier import Classifier, Scores
from gestured.core.events import Cancelled, Event, Gesture, Onset, Provisional, Release, Unknown
from gestured.core.facts import Changed, Dropped, Fault, Taken
from gestured.core.frames import Segment
from gestured.core.hub import FORGET_S, Hub
from gestured.core.points import Certainty
from gestured.core.scene import Scene, Setup
from gestured.core.wire import Addresses
from gestured.lab.recordings.live import LiveSensor
from gestured.record import tape_writer
from tests import encoding
from tests.daemon.harness import Frame, Hand, blob, floats
from tests.test_bad_tapes import SETTINGS

FIRST, SECOND, STRANGER = ("10.0.0.1", 1), ("10.0.0.2", 1), ("192.0.2.1", 1)
GESTURES = ("swipe", "double_tap")
Arrived = tuple[float, bytes, tuple[str, int]]  # s, packet, source


class Sure(Classifier):
    """A classifier that calls everything a swipe."""

    gestures: tuple[str, ...] = GESTURES

    def classify(self, segment: Segment) -> Scores:
        return Scores(np.array([1.0, 0.0], np.float32), 0.0, "sure")


class Early(Sure):
    """The same of a contact that is not over; what is short it calls a tap."""

    gestures = ("swipe", "double_tap", "one_tap")
    certainty = Certainty(1, (0.0,), (0.5,), tap=0.5)

    def classify(self, segment: Segment) -> Scores:
        tap = segment.offset - segment.onset < 0.2
        return Scores(np.array([not tap, 0, tap], np.float32), 0.0, "early")

    def preview(self, segment: Segment) -> Scores:
        return self.classify(segment)


SCENE = Scene(GESTURES, (9, 9), frames=True)


def stream(sensor: str, frames: list[Frame], source: tuple[str, int], start: float = 0.0) -> list[Arrived]:
    return [
        (start + n / 15, floats(f"/{sensor}/pressure", frame, 0), source) for n, frame in enumerate(frames, start=1)
    ]


def play(scene: Scene, arrived: list[Arrived]) -> list[object]:
    hub = Hub(scene, Sure())
    facts: list[object] = []
    for t, packet, source in sorted(arrived):
        facts += hub.receive([(packet, source)], t)
        facts += hub.tick(t)
    return [*facts, *hub.flush(sorted(arrived)[-1][0] + 2.0)]


def states(hub: Hub, t: float) -> dict[str, str]:
    return {name: reading.state for name, reading in hub.readings(t).items()}


@pytest.fixture
def crossed() -> list[Arrived]:
    """A sensor that is swiped over, and another source that uses its name meanwhile, with frames of another level."""
    hand = Hand()
    owner = stream("arm", hand.idle(2.0) + hand.swipe("left") + hand.idle(1.0), FIRST)
    return owner + [(t + 0.01, floats("/arm/pressure", hand.frame() + 90, 0), SECOND) for t, _, _ in owner[5:40]]


def test_packets_that_are_found_together_decide_what_they_decide_one_by_one() -> None:
    """Sensors that are swiped over at other moments, beside junk, NaN and a second source."""
    rng, hubs = np.random.default_rng(25), [Hub(replace(SCENE, frames=False), Sure()) for _ in range(2)]
    frames = [hand.idle(2.0 + n / 10) + hand.swipe("left") + hand.idle(2.0) for n, hand in enumerate([Hand()] * 8)]
    events: list[list[Event]] = [[], []]
    counted: list[list[str]] = [[], []]
    for k in range(min(map(len, frames))):
        packets = [(floats(f"/s{n}/pressure", frame[k], 0), FIRST) for n, frame in enumerate(frames)]
        strange = floats("/s1/pressure", np.full((9, 9), math.nan), 0)
        packets += [(strange, FIRST), (packets[0][0], SECOND), (rng.bytes(12), FIRST)]
        packets = [packets[n] for n in rng.permutation(len(packets))]
        for hub, said, rest, reads in zip(hubs, events, counted, ([packets], [[one] for one in packets]), strict=True):
            facts = [fact for read in reads for fact in hub.receive(read, k / 15)] + hub.tick(k / 15)
            said += [fact for fact in facts if isinstance(fact, Event)]
            rest += sorted(str(fact) for fact in facts if isinstance(fact, Changed | Dropped))
    assert events[0] == events[1] and counted[0] == counted[1]
    assert sum(isinstance(event, Gesture) for event in events[0]) == len(frames)


def test_a_silent_sensor_keeps_no_others_frames() -> None:
    """Frames that were read together share memory: each sensor falls silent after another read."""
    rng, kept = np.random.default_rng(0), []
    for together in (True, False):
        hub = Hub(replace(SCENE, grid=(32, 32), frames=False), Sure())
        gc.collect()
        tracemalloc.start()
        for k in range(20):
            packets = [(floats(f"/s{n}/pressure", rng.normal(100, 2, (32, 32)), 0), FIRST) for n in range(k, 20)]
            for read in [packets] if together else [[packet] for packet in packets]:
                hub.receive(read, k / 15)
        hub.tick(60.0)
        del packets, read
        gc.collect()
        kept.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    assert kept[0] < 1.1 * kept[1]


class Counting(dict[str, Setup]):
    """Sensors of a scene; counts how often it is asked for one."""

    asked = 0

    def __contains__(self, name: object) -> bool:
        self.asked += 1
        return super().__contains__(name)


def test_strangers_cost_the_same_however_many_sensors_there_are() -> None:
    """One packet holds hundreds of names: were each held against all sensors, it would stop the daemon."""
    named, strangers = Counting(), 300
    hub = Hub(replace(SCENE, sensors=named, max_sensors=200, frames=False), Sure())
    frame = Hand().frame()
    for n in range(200):
        hub.receive([(floats(f"/s{n}/pressure", frame, 0), FIRST)], 1.0)
    flood = encoding.bundle([blob("u1")(f"/x{n}/pressure", frame, 0) for n in range(strangers)])
    named.asked = 0
    facts = hub.receive([(flood, STRANGER)], 2.0)
    assert [fact.reason for fact in facts if isinstance(fact, Dropped)] == ["too_many_sensors"] * strangers
    assert named.asked < 3 * strangers
    # A place is free as soon as one of them has been silent for long enough.
    (new,) = hub.receive([(floats("/x0/pressure", frame, 0), STRANGER)], 1.5 + FORGET_S)[:1]
    assert isinstance(new, Changed) and new.what == "new"
    kept = Hub(replace(SCENE, sensors={"arm": Setup()}, max_sensors=1), Sure())  # there is no place for any stranger
    (dropped,) = kept.receive([(floats("/x0/pressure", frame, 0), STRANGER)], 1.0)
    assert isinstance(dropped, Dropped) and dropped.reason == "too_many_sensors"
    (new, *_) = kept.receive([(floats("/arm/pressure", frame, 0), FIRST)], 1.0)
    assert isinstance(new, Changed) and new.what == "new"


@pytest.mark.parametrize("what", ["restart", "change"])
def test_what_the_time_has_decided_is_said_though_nobody_looked_before_a_restart_or_another_scene(what: str) -> None:
    hand, hub = Hand(), Hub(SCENE, Sure())
    for t, packet, source in stream("arm", hand.idle(2.0) + hand.swipe("left"), FIRST):
        hub.receive([(packet, source)], t)
    while hub.due == math.inf:
        t += 1 / 15
        hub.receive([(floats("/arm/pressure", hand.frame(), 0), FIRST)], t)
    now = hub.due + 0.01
    # Another `stale_s` makes the front end anew, and no answer is ever sure of more than 1.
    deaf = replace(SCENE, thresholds={"swipe": 1.1}, stale_s=2.0)
    facts = hub.restart(["arm"], now) if what == "restart" else hub.change(deaf, Sure(), now)
    assert [type(fact) for fact in facts if is_answer(fact)] == [Gesture]


@pytest.mark.parametrize("rate_hz", [5.0, 12.0, 15.0, 45.0])
def test_an_answer_comes_when_the_wait_is_over_and_waits_for_no_frame(rate_hz: float) -> None:
    hand, hub = Hand(), Hub(SCENE, Sure())
    assert hub.due == math.inf
    idle = [hand.frame() for _ in range(round(2 * rate_hz))]
    frames = idle + hand.swipe("left") + idle
    t = 0.0
    for frame in frames:
        t += 1 / rate_hz
        assert not [fact for fact in hub.receive([(floats("/arm/pressure", frame, 0), FIRST)], t) if is_answer(fact)]
        if hub.due < t + 1 / rate_hz:
            break
    due = hub.due
    assert t < due < t + 1 / rate_hz
    assert not hub.tick(due - 0.001)
    gesture, release = (fact for fact in hub.tick(due + 1e-6) if isinstance(fact, Event))
    assert isinstance(gesture, Gesture) and isinstance(release, Release)
    assert gesture.decided == pytest.approx(due) == pytest.approx(gesture.offset + 1 / rate_hz + 0.1)
    assert hub.due == math.inf


@pytest.mark.parametrize("asked", [False, True])
@pytest.mark.parametrize("clock", ["arrival", "sensor"])
@pytest.mark.parametrize("seed", range(8))
def test_when_time_is_looked_at_changes_no_event(seed: int, clock: Literal["arrival", "sensor"], asked: bool) -> None:
    """Jitter, losses, stalls of the way; a tick now and then, or none."""
    rng, hand = np.random.default_rng(seed), Hand(seed)
    frames = hand.idle(2.0)
    for _ in range(6):
        frames += hand.swipe("left") if rng.random() < 0.5 else hand.tap()
        frames += hand.idle(float(rng.uniform(0.1, 1.0)))
    waiting: list[tuple[bytes, tuple[str, int]]] = []
    come: list[tuple[float, list[tuple[bytes, tuple[str, int]]]]] = []
    for n, frame in enumerate(frames, 1):
        if rng.random() < 0.95:
            waiting.append((encoding.bundle([floats("/arm/pressure", frame, 0)], 1.7e9 + n / 15), FIRST))
        if rng.random() < 0.85:
            come.append((n / 15 + rng.uniform(0, 0.03), waiting))
            waiting = []

    def events(looks: int) -> list[Event]:
        hub, found, before = Hub(replace(SCENE, clock=clock, gestures=Early.gestures), Early()), list[object](), 0.0
        hub.foresee(None if asked else ())
        for t, packets in come:
            for at in sorted(rng.uniform(before, t, looks)):
                found += hub.tick(at)
            found += hub.receive(packets, t)
            before = t
        return [fact for fact in found + [*hub.flush(before + 2.0)] if isinstance(fact, Event)]

    assert events(0) == events(1) == events(5)
    assert any(isinstance(event, Provisional) and event.gesture == "one_tap" for event in events(0)) == asked


def is_answer(fact: object) -> bool:
    return isinstance(fact, Gesture | Unknown | Cancelled)


def write(path: Path, arrived: list[Arrived], events: Sequence[Mapping[str, Any]] = (), **settings: object) -> Path:
    """A tape as the daemon would have written it."""
    model = {"name": "sure", "sha256": "", "rows": 9, "columns": 9}
    told = {"gestures": GESTURES, "model": model, "settings": SETTINGS | {"model": "sure"} | settings}
    with tape_writer.Writer(path, told, 1 << 30) as writer:
        rest = [*events]
        for t, packet, source in sorted(arrived):
            while rest and rest[0].get("since", math.inf) < t + 1e9:
                writer.event(0, rest.pop(0))
            writer.packet(round((t + 1e9) * 1e9), f"{source[0]}:{source[1]}", packet)
        for event in rest:
            writer.event(0, event)
    return path


def test_an_export_holds_the_frames_that_the_daemon_used(crossed: list[Arrived], tmp_path: Path) -> None:
    names, made = sessions_of(write(tmp_path / "a.mcap", crossed))
    used = [fact.frame for fact in play(SCENE, crossed) if isinstance(fact, Taken)]
    assert names == ["arm"] and np.array_equal(made.frames, np.stack([frame.values for frame in used]))
    assert np.allclose(np.diff(made.times), np.diff([frame.t for frame in used]), atol=1e-6)


@pytest.fixture
def live() -> Iterator[LiveSensor]:
    sensor = LiveSensor(("127.0.0.1", 0), (9, 9), None, Sure())
    yield sensor
    sensor.close()


def test_what_is_collected_falls_silent_as_in_the_daemon(live: LiveSensor, monkeypatch: pytest.MonkeyPatch) -> None:
    """A finger that is down when the sensor goes away: the contact is cancelled, and let go."""
    now = 100.0
    monkeypatch.setattr("gestured.lab.recordings.live.time.monotonic", lambda: now)
    hand = Hand()
    with socket.socket(type=socket.SOCK_DGRAM) as sender:
        sender.connect(live.socket.getsockname())
        for frame in hand.idle(2.0) + hand.swipe("left")[:4]:
            now += 1 / 15
            sender.send(floats("/arm/pressure", frame, 0))
            live.pump()
    assert live.touched and [type(one) for one in live.found] == [Onset]
    now += 1.1
    live.pump()
    assert [type(one) for one in live.found] == [Onset, Cancelled, Release] and not live.touched


def test_another_scene_keeps_what_was_learned_where_it_holds() -> None:
    hand = Hand()
    hub = Hub(replace(SCENE, frames=False), Sure())
    t = 0.0
    for n, frame in enumerate(hand.idle(2.0), start=1):
        t = n / 15
        hub.receive([(floats("/arm/pressure", frame, 0), FIRST)], t)
    allowing = replace(hub.scene, allow=(ipaddress.ip_network("10.0.0.0/8"),))
    assert hub.change(allowing, Sure(), t) == [] and states(hub, t) == {"arm": "ok"}
    turned = replace(hub.scene, sensors={"arm": Setup(grid=(9, 9), clock="sensor")})
    hub.change(turned, Sure(), t)
    assert states(hub, t) == {"arm": "starting"}
    (fact,) = hub.receive([(b"rubbish!", STRANGER)], t)
    assert isinstance(fact, Dropped) and fact.reason == "not_allowed"
    assert [fact.what for fact in hub.tick(t + 2.0) if isinstance(fact, Changed)] == ["silent"]


def test_a_sensor_that_cannot_hear_says_what_it_waits_for() -> None:
    """Rubbish when it is switched on, noise in the middle, and something that goes on for long."""
    hand, hub, rng = Hand(), Hub(replace(SCENE, frames=False), Sure()), np.random.default_rng(0)
    now, said = 0.0, list[tuple[str, str]]()

    def send(frames: list[Frame]) -> list[tuple[str, str]]:
        nonlocal now
        said.clear()
        for frame in frames:
            now += 1 / 15
            hub.receive([(floats("/arm/pressure", frame, 0), FIRST)], now)
            hub.tick(now)
            (reading,) = hub.readings(now).values()
            said.append((reading.state, reading.reason))
        return [one for one, _ in groupby(said)]

    def anything(seconds: float) -> list[Frame]:
        return [rng.integers(0, 2**16, (9, 9)).astype(float) for _ in range(round(15 * seconds))]

    learning = ("starting", "it is being learned, and waits for a second in which nothing moves on it")
    fine = ("ok", "")
    assert send(anything(1.2)) == [learning, fine]  # rubbish that does not change looks like a sensor
    assert send(hand.idle(3.0)) == [fine, learning, fine]
    assert [state for state, _ in send(anything(4.0))] == ["ok", "degraded"] and "jump" in said[-1][1]
    assert send(hand.idle(1.0))[-1] == fine
    send(anything(10.0))
    assert said[-1][0] == "degraded" and "times what it was" in said[-1][1]
    assert send(hand.idle(3.0))[-1] == fine
    moving = [hand.frame(4.0 + n % 2) for n in range(120)]
    assert send(moving) == [
        fine,
        ("degraded", "it was pressed for 5 s, and waits to be let go, or for a second in which nothing moves"),
        fine,  # what goes on for so long is learned
    ]
    assert send(hand.idle(1.0))[-1] == fine


def test_other_firmware_has_other_addresses() -> None:
    hub = Hub(replace(SCENE, addresses=Addresses("/textile/{sensor}/matrix", "/textile/{sensor}/touches")), Sure())
    packets = [(floats(f"/{name}", Hand().frame(), 0), FIRST) for name in ("textile/long/matrix", "arm/pressure")]
    facts = hub.receive(packets, 1.0)
    assert list(hub.readings(1.0)) == ["long"]
    assert [fact.reason for fact in facts if isinstance(fact, Dropped)] == ["address"]


def test_who_pauses_still_owns_a_sensor_until_it_is_forgotten() -> None:
    """What owners may do in a flood must not end with a pause: on return it would be one more stranger of its host."""
    hub = Hub(SCENE, Sure())
    hub.receive([(floats("/arm/pressure", Hand().frame(), 0), FIRST)], 1.0)
    hub.tick(1.0)
    assert hub.owners == {FIRST: 1}
    hub.tick(0.8 * FORGET_S)
    hub.tick(0.9 * FORGET_S)
    assert states(hub, 0.9 * FORGET_S) == {"arm": "stale"} and hub.owners == {FIRST: 1}
    hub.tick(1.1 + FORGET_S)
    assert hub.owners == {}


def test_a_contact_ends_before_its_sensor_gives_its_place_away() -> None:
    """A daemon that was stopped for a minute takes the packet of another sensor before its next tick."""
    hand, hub = Hand(), Hub(replace(SCENE, max_sensors=1), Sure())
    facts: list[object] = []
    for t, packet, source in stream("arm", hand.idle(2.0) + hand.swipe("left")[:3], FIRST):
        facts += hub.receive([(packet, source)], t)
    facts += hub.receive([(floats("/other/pressure", hand.frame(), 0), SECOND)], 5.0 + FORGET_S)
    told = [type(fact) for fact in facts if isinstance(fact, Onset | Cancelled | Release)]
    assert told == [Onset, Cancelled, Release] and "other" in hub.sequences()


def test_a_frame_that_says_nothing_is_cheap() -> None:
    """Counted in calls, which do not depend on the machine: an idle frame of a scene with nothing but a model."""
    assert statistics.median_low(idle_calls()) <= 35


@pytest.mark.parametrize("clock", ["arrival", "sensor"])
def test_after_a_fault_in_its_stamps_a_contact_ends_by_the_streams_clock(
    clock: Literal["arrival", "sensor"], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recording that is sent at ten times its speed: its own clock is far ahead of the hub's."""
    hub, hand, found = Hub(replace(SCENE, clock=clock), Sure()), Hand(), list[object]()
    frames = [*hand.idle(2.0), *hand.swipe("left")[:5]]
    for n, frame in enumerate(frames):
        packet = encoding.bundle([floats("/arm/pressure", frame, 0)], 1.7e9 + n / 15)
        found += hub.receive([(packet, FIRST)], n / (15 if clock == "arrival" else 150))
    (onset,) = [fact for fact in found if isinstance(fact, Onset)]
    monkeypatch.setattr("gestured.core.stamping.Stamper.stamp", lambda *_, **__: 1 / 0)
    facts = hub.receive([(packet, FIRST)], len(frames) / (15 if clock == "arrival" else 150))
    (release,) = [fact for fact in facts if isinstance(fact, Release)]
    assert onset.onset < release.offset < onset.onset + 1.0


@pytest.mark.parametrize("act", ["change", "restart", "tick"])
def test_a_sensor_that_is_broken_holds_up_no_reload_no_recalibration_and_no_tick_of_others(act: str) -> None:
    hub, hand = Hub(SCENE, Sure()), Hand()
    shown = hand.idle(2.0)
    for t, packet, source in sorted(stream("arm", shown, FIRST) + stream("leg", shown, SECOND)):
        hub.receive([(packet, source)], t)
    hub._sensors["arm"].front_end.cutter = None  # type: ignore[assignment]
    if act == "change":
        facts = hub.change(replace(SCENE, tap_gap_s=0.3), Sure(), 2.1)
        facts += hub.receive([(floats("/arm/pressure", hand.frame(), 0), FIRST)], 2.2)
        assert any(isinstance(fact, Taken) for fact in facts), "what is made anew is sound"
    elif act == "restart":
        facts = hub.restart(["arm", "leg"], 2.1)
    else:
        hub._sensors["arm"].vitals.review = lambda front_end: 1 / 0  # type: ignore[assignment, return-value]
        facts = hub.tick(2.1)
    assert {fact.sensor for fact in facts if isinstance(fact, Fault)} == {"arm"}
    assert states(hub, 2.2)["leg"] == ("ok" if act == "tick" else "starting")
