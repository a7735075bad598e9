"""What is counted: bounded whatever arrives, and sound."""

import math
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gestured.core.beside.reading import STATES, Reading, Vitals
from gestured.core.classifier import Scores
from gestured.core.events import Cancelled, Event, Gesture, Place, Provisional, Unknown, Where
from gestured.core.facts import Decided
from gestured.core.frames import Frame, Segment
from gestured.core.front_end import FrontEnd
from gestured.core.listening import MOST_GATES
from gestured.core.window import Window
from gestured.daemon.exposition import exposition
from gestured.daemon.metrics import NAMED_SENSORS, Metrics
from gestured.daemon.service import Service
from gestured.daemon.shift import LAST, LEAST_GESTURES, Shift
from gestured.daemon.status import sensor, status
from gestured.model.features import MEASURES
from tests.daemon.harness import Hand
from tests.daemon.parts import Parts, with_service

WINDOW = Window(rows=9, columns=9, rate_hz=15.0, smooth_frames=1, lead_s=1 / 15, tail_s=1 / 15, floor=4.0)
ROOT = Path(__file__).resolve().parents[2]
REASONS = (
    "not_osc", "address", "types", "truncated", "trailing", "bundle", "oversized", "size", "not_finite",
    "too_many_touches", "not_allowed", "second_source", "too_many_sensors", "socket_error",
    "flood",
)  # fmt: skip


def everything() -> Iterator[Event]:
    for number in range(100):
        for model in ("cnn_lstm", "lstm", "forest", "mine", "yours"):
            yield Gesture("s", 1, f"gesture_{number}", number / 100, 1, 0, 1, 2, 3, 0, model, True, {})
        where = Where(Place(0.5, 0.5), Place(0.5, 0.5), 0.0, 1.0, 1.0, 1, 0, f"zone_{number}")
        yield Gesture(f"s_{number}", 1, "left", 0.9, 1, 0, 1, 2, 3, 0, "lstm", False, {}, where=where)
    yield Provisional("s", 1, "left", 0.9, 0, 1)
    yield Gesture("s", 1, "left", 0.9, 1, 0, 1, 2, 3, 0, "lstm", False, {}, "confirmed")
    yield Cancelled("s", 1, "held", "revoked")
    yield Unknown("s", 1, 0.1, 0, 1, 2, 3, 0, "lstm", False, {})
    yield Unknown("s", 1, 0.1, 0, 1, 2, 3, 0, "lstm", False, {}, "disarmed")
    for n in range(MOST_GATES):
        yield Unknown("s", 1, 0.1, 0, 1, 2, 3, 0, "lstm", False, {}, "inhibited", gates=(f"gate{n}", f"other{n}"))
    for reason in ("held", "silence", "restart", "glitch", "stuck", "refractory", "model", "internal_error"):
        yield Cancelled("s", 1, reason)


@pytest.fixture(scope="module")
def usual(model: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The status of a daemon that has heard nothing."""

    async def look(service: Service) -> dict[str, Any]:
        return status(service.parts)

    return with_service(model, tmp_path_factory.mktemp("usual"), look)


def shown(readings: dict[str, Reading]) -> dict[str, Any]:
    """Sensors as a status shows them."""
    return {name: sensor(one, 0.0, 0.0) for name, one in readings.items()}


def test_there_are_at_most_200_series_whatever_arrives(usual: dict[str, Any]) -> None:
    metrics = Metrics()
    for event in everything():
        metrics.event(event)
    names = [f"sensor_{n}" for n in range(500)]
    for name in names:
        for result in ("ok", "lost", "late", "duplicate"):
            metrics.frames.add(metrics.sensor_label(name), result)
    for reason in REASONS:
        metrics.dropped.add(reason)
    for result in ("sent", "refused", "full", "unreachable", "unresolved"):
        metrics.sent.add(result)
    for counter, labels in (
        (metrics.evicted, ("stalled", "too_many")),
        (metrics.reloads, ("done", "refused")),
    ):
        for label in labels:
            counter.add(label)
    shift = dict.fromkeys(("strength", *MEASURES, "confidence", "unknown"), 0.1)
    sensors = shown({name: Reading(STATES[n % len(STATES)], (9, 9)) for n, name in enumerate(names)})
    real = (Path(__file__).parent / "metrics.txt").read_text()
    gauges = set(re.findall(r"^# TYPE (\S+) ", real, re.MULTILINE))
    text = exposition(metrics, usual | {"sensors": sensors, "shift": {"outside": shift}}).decode()
    assert set(re.findall(r"^# TYPE (\S+) ", text, re.MULTILINE)) == gauges
    series = [line for line in text.splitlines() if not line.startswith("#")]
    assert len(series) == len({line.rsplit(" ", 1)[0] for line in series}) <= 200
    assert 'gestured_sensor_state{sensor="other",state="faulty"} 1.0' in series
    assert 'gestured_frames_total{result="ok",sensor="other"} 492.0' in series


def test_what_an_alert_counts_is_0_before_it_happens_first(usual: dict[str, Any]) -> None:
    """Prometheus sees no increase from a series that was not there to its first value."""
    rules = (ROOT / "deploy" / "prometheus" / "gestured.rules.yml").read_text()
    counted = re.findall(r"increase\((\w+(?:\{[^}]*\})?)\[\w+\]\) > ", rules)
    assert 'gestured_reloads_total{result="refused"}' in counted
    assert {f"{series} 0.0" for series in counted} <= set(exposition(Metrics(), usual).decode().splitlines())


@pytest.mark.parametrize(("clock", "least", "most"), [("arrival", 5.2, math.inf), ("sensor", 0.19, 0.21)])
def test_the_latency_counts_how_late_the_daemon_was(model: Path, clock: str, least: float, most: float) -> None:
    """A decision has the time at which the wait was over, however late the daemon comes to it."""
    parts, decided = Parts(model, clock=clock), time.monotonic() - 5.0
    parts.desk.publish(Gesture("s", 1, "one_tap", 0.9, 1, decided - 0.5, decided - 0.2, decided, 3, 0, "m", False, {}))
    (_, (seen,)) = parts.metrics.latency.values[()]
    assert least <= seen <= most


def test_every_reason_to_drop_has_its_place_in_that_count() -> None:
    """A new reason would make another series: the test above must know it."""
    code = "".join(path.read_text() for path in (ROOT / "gestured").rglob("*.py"))
    found = set(re.findall(r'(?:ProtocolError|\.drop|_fault|refuse)\(\s*"([a-z_]+)"', code)) - {"subscription"}
    assert found <= set(REASONS), found - set(REASONS)


def test_several_sensors_together_are_as_their_worst(usual: dict[str, Any]) -> None:
    still, gone = np.zeros(81), np.full(81, 3.0)
    one = Reading("ok", (9, 9), 1 / 15, 0.001, 1, 1.0, first=still, baseline=still)
    other = Reading("stale", (9, 9), 1 / 15, 0.1, 2, 1.0, first=still, baseline=gone)
    named = [f"named{n}" for n in range(NAMED_SENSORS)]
    sensors = dict.fromkeys(named, one) | {"a": one, "b": other}
    text = exposition(Metrics(), usual | {"sensors": shown(sensors)}).decode()
    found = dict(re.findall(r'^gestured_sensor_(\w+\{sensor="(?:other|named0)".*\}) (\S+)$', text, re.MULTILINE))
    alone = {"rate_hertz": "15.0", "jitter_seconds": "0.001", "bad_taxels": "1.0", "drift_ratio": "0.0"}
    together = {"rate_hertz": "0.0", "jitter_seconds": "0.1", "bad_taxels": "3.0", "drift_ratio": "3.0"}
    expected = {f'{name}{{sensor="named0"}}': value for name, value in alone.items()}
    expected |= {f'{name}{{sensor="other"}}': value for name, value in together.items()}
    states = {'state{sensor="named0",state="ok"}': "1.0", 'state{sensor="other",state="stale"}': "1.0"}
    assert found == expected | states


def test_jitter_is_none_for_an_even_stream_and_grows_with_an_uneven_one() -> None:
    even, uneven = Vitals(), Vitals()
    even.interval_s = uneven.interval_s = 1 / 15
    for n in range(200):
        even.arrived(n / 15, 1, missed=False)
        uneven.arrived(n / 15 + (0.02 if n % 2 else 0.0), 1, missed=False)
    assert even.jitter_s < 1e-9 and uneven.jitter_s == pytest.approx(0.02, rel=0.01)


def test_drift_is_the_way_of_the_baseline_in_units_of_noise(model: Path) -> None:
    parts, hand = Parts(model), Hand()

    def drift(t: float) -> float:
        parts.desk.take(parts.hub.tick(t))
        return parts.hub.readings(t)["a"].drift

    t = parts.feed("a", hand.idle(2.0), 0.0)
    assert drift(t) == 0.0
    t = parts.feed("a", [hand.frame() + n / 300 for n in range(3000)], t)
    assert drift(t) == pytest.approx(10 / parts.hub.readings(t)["a"].noise, rel=0.2)
    parts.desk.take(parts.hub.restart(["a"], t))
    t = parts.feed("a", [frame + 10 for frame in hand.idle(2.0)], t)
    assert drift(t) == 0.0 and parts.hub.readings(t)["a"].state == "ok"


@pytest.mark.parametrize(("noisy", "too_many"), [(0, False), (20, False), (21, True)])
def test_a_sensor_with_more_than_a_quarter_of_bad_taxels_is_faulty(noisy: int, too_many: bool) -> None:
    front_end, rng = FrontEnd(9, 9), np.random.default_rng(0)
    for n in range(90):
        counts = 300 + rng.normal(0, 2, 81)
        counts[:noisy] += rng.normal(0, 200, noisy)
        front_end.push(Frame(n / 15, counts.reshape(9, 9)))
    assert front_end.bad_taxels == noisy
    assert (Vitals().condition(front_end, inverted=False)[0] == "faulty") == too_many


def contacts(model: Path, *, watched: bool) -> list[str]:
    """What a sensor without any noise, in fractions of one, makes of a touch after five seconds."""
    parts = Parts(model)
    y, x = np.mgrid[:9, :9]
    touch = 0.37 + np.round(0.5 * np.exp(-((y - 4) ** 2 + (x - 4) ** 2) / 2), 2)
    t = 0.0
    for k in range(120):
        t = parts.feed("arm", [touch if 75 <= k < 90 else np.full((9, 9), 0.37)], t)
        if watched and k % 15 == 0:
            assert parts.hub.readings(t)["arm"].drift >= 0.0
    return [type(event).__name__ for event in parts.events]


def test_looking_at_a_sensor_changes_nothing(model: Path) -> None:
    assert contacts(model, watched=True) == contacts(model, watched=False) != []


QUANTILES = {
    "at": [0.01, 0.5, 0.99],
    "strength": [10, 50, 100],
    "duration_s": [0.1, 0.5, 2.0],
    "confidence": [0.5, 0.9, 0.99],
    "unknown": 0.02,
}


def test_gestures_as_in_training_are_no_shift_and_others_are() -> None:
    shift = Shift(QUANTILES, WINDOW)
    usual = {"strength": 40.0, "duration_s": 0.4, "area": 0.1, "confidence": 1.0}  # surer than ever is no fault
    for _ in range(LEAST_GESTURES - 1):
        shift.add(usual)
    assert shift.shares() == {} and shift.unlike() == []
    for _ in range(LAST):
        shift.add(usual)
    assert shift.shares() == {"strength": 0.0, "duration_s": 0.0, "confidence": 0.0}
    for _ in range(LAST // 4):
        shift.add(usual | {"strength": 300.0})
    assert shift.shares()["strength"] == 0.25 and shift.unlike() == ["strength"]
    assert shift.count == LAST
    for _ in range(LAST):
        shift.add(usual | {"confidence": 0.4})  # what is long ago no longer counts
    assert shift.unlike() == ["confidence"]


def decided(confidence: float, *, degraded: bool = False) -> Decided:
    frames = np.zeros((8, 9, 9), np.float32)
    frames[1:7, 4, 4] = 50
    scores = Scores(np.array([confidence, 0], np.float32), 0.0, "m", degraded, threshold=0.5)
    return Decided("arm", Segment(frames, np.arange(8) / 15, 1, 6, 1.0), scores, confidence >= 0.5)


def test_touches_that_are_no_gestures_and_answers_of_a_fallback_are_no_shift() -> None:
    """In everyday life four touches of five are unknown."""
    shift = Shift(QUANTILES, WINDOW)
    for n in range(LAST):
        shift.see(decided(0.4 if n % 5 else 0.9))
        shift.see(decided(0.9, degraded=True))
    assert shift.count == LAST // 5
    assert shift.shares() == {"strength": 0.0, "duration_s": 0.0, "confidence": 0.0, "unknown": 0.8}
    assert shift.unlike() == []


@pytest.mark.parametrize(
    "quantiles",
    [
        {},
        {"at": []},
        {"at": [0.01, 0.99], "strength": "x"},
        {"at": 3},
        {"at": [0.01, 0.99], "strength": [2, 1]},
        {"at": [0.01, 0.99], "strength": [1, 10**400]},
    ],  # fmt: skip
)
def test_metadata_that_say_nothing_give_no_verdict(quantiles: dict[str, Any]) -> None:
    shift = Shift(quantiles, WINDOW)
    for _ in range(LAST):
        shift.add({"strength": 1.0, "duration_s": 1.0, "area": 1.0})
    assert shift.shares() == {} and shift.count == 0


def test_what_looks_on_cannot_prevent_an_answer(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts, hand = Parts(model), Hand()
    monkeypatch.setattr(Shift, "see", lambda self, decided: 1 / 0)
    parts.feed("arm", hand.idle(2.0) + 2 * (hand.swipe("left") + hand.idle(1.0)), 0.0)
    assert [event.gesture for event in parts.events if isinstance(event, Gesture)] == ["swipe_left"] * 2
    assert parts.metrics.internal_errors.total() == 2
