"""The same packets give the same, one by one or all at once: idle frames that wait together are taken by a bank."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gestured.core import bank
from gestured.core.bank import FEW, TURNS, Bank
from gestured.core.events import Gate
from gestured.core.facts import Arrived, Fact, Fault
from gestured.core.hub import Hub
from gestured.core.mounting import Mounting
from gestured.core.scene import Scene, Setup
from tests import encoding
from tests.core.test_hub import GESTURES, Sure

SOURCE = ("10.0.0.1", 1)
EACH = FEW + 2  # sensors of a kind
SETUPS = {f"plain{n}": Setup() for n in range(EACH)}
SETUPS |= {f"turned{n}": Setup((4, 7), Mounting(rotate=90, mirror=True, invert=True)) for n in range(EACH)}
SETUPS |= {f"clock{n}": Setup(clock="sensor") for n in range(EACH)}
SCENE = Scene(GESTURES, (9, 9), sensors=SETUPS, max_sensors=64)
Read = tuple[float, list[tuple[str, bytes]]]  # s, and the packets that wait then, with their sensors' names
PLAIN = [f"plain{n}" for n in range(EACH)]


def packed(names: Sequence[str], values: NDArray[np.float64]) -> list[bytes]:
    """A packet for each of some sensors, whose counts are the rows."""
    return [
        encoding.message(f"/{name}/pressure", "f" * 81, one.tolist()) for name, one in zip(names, values, strict=True)
    ]


@pytest.fixture
def passed(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Of each frame that a bank looks at, whether it takes it."""
    found, take = list[bool](), Bank._take

    def watched(*given: Any) -> NDArray[np.intp]:
        lost = take(*given)
        found.extend((lost >= 0).tolist())
        return lost

    monkeypatch.setattr(Bank, "_take", watched)
    return found


def frames(setup: Setup, rng: np.random.Generator) -> Iterator[NDArray[np.float64] | None]:
    """Counts of a sensor to which about everything happens; None where it sends nothing."""
    grid, sign = setup.grid or SCENE.grid, -1 if setup.mounting.invert else 1
    y, x = np.mgrid[: grid[0], : grid[1]]
    base, noise, whole = rng.uniform(100, 300, grid), rng.choice([0.3, 2.0, 30.0]), rng.random() < 0.4
    stuck, silent, frozen, press, shown = np.zeros(grid, dtype=bool), 0, 0, 0.0, base
    place, way = np.zeros(2), np.zeros(2)
    for k in range(210):
        what = np.searchsorted([0.008, 0.010, 0.011, 0.013, 0.015, 0.017, 0.019], rng.random()) if k > 25 else 7
        if what == 0:  # a finger comes
            place, way, press = rng.uniform(0, grid), rng.normal(0, 0.6, 2), rng.uniform(5, 80) * noise
        elif what == 1:
            silent = k + int(rng.integers(1, 25))
        elif what == 2:
            stuck = rng.random(grid) < 0.05
        elif what == 3:  # something is laid on it, or leaves
            base = base + sign * rng.choice([-60, -20, 20]) * noise
        elif what == 4:
            noise *= rng.choice([0.2, 3.0])
        elif what == 6:  # it repeats itself
            frozen = k + int(rng.integers(5, 60))
        place, press = place + way, press if rng.random() < 0.8 else 0.0
        counts = base + sign * press * np.exp(-((y - place[0]) ** 2 + (x - place[1]) ** 2) / 1.6)
        counts = counts + rng.normal(0, noise, grid) + 1e6 * (what == 5) * (rng.random(grid) < 0.1)
        shown = np.where(stuck | (k < frozen), shown, np.rint(counts) if whole else counts)
        yield None if k < silent else shown


def reads(seed: int) -> list[Read]:
    """Frames of all at 15 Hz, within a moment; sensors with a clock of their own send some late, and some twice."""
    rng, found, late = np.random.default_rng(seed), list[Read](), dict[str, bytes]()
    streams = {name: frames(setup, rng) for name, setup in SETUPS.items()}
    for k, each in enumerate(zip(*streams.values(), strict=True)):
        packets: list[tuple[str, bytes]] = []
        for name, counts in zip(streams, each, strict=True):
            if counts is None:
                continue
            clock = name.startswith("clock")
            if rng.random() < 0.02:
                continue  # it is lost on its way
            numbers = [k] * clock + counts.ravel().tolist()
            packet = encoding.message(f"/{name}/pressure", "i" * clock + "f" * counts.size, numbers)
            if clock:
                packet = encoding.bundle([packet], 1.7e9 + k / 15)
            if clock and name not in late and rng.random() < 0.1:
                late[name] = packet
                continue
            twice = clock and rng.random() < 0.02
            packets += [(name, one) for one in ([late.pop(name)] if name in late else []) + [packet] * (1 + twice)]
        found.append((k / 15 + rng.uniform(0, 0.02), packets))
    return found


def shown(hub: Hub, now: float) -> None:
    """Have the hub show what is known of all sensors; of those in banks, each tick shows some."""
    for _ in range(TURNS):
        hub.tick(now)


def play(reads: Sequence[Read], *, together: bool) -> tuple[dict[str, list[Fact]], list[object]]:
    """What was said of each sensor, but for how its frames arrived; and from time to time all that is known of it."""
    hub, said, known = Hub(SCENE, Sure()), {name: list[Fact]() for name in SETUPS}, list[object]()
    counts = {name: np.zeros(5, dtype=int) for name in SETUPS}
    for n, (now, packets) in enumerate(reads):
        waiting = [(packet, SOURCE) for _, packet in packets]
        if n % 7 == 3:
            hub.missed()
        facts = [*hub.inhibit(None, "door", now, 0.5)] if n % 20 == 0 else []
        facts += [
            fact for some in ([waiting] if together else [[one] for one in waiting]) for fact in hub.receive(some, now)
        ]
        for fact in facts + (hub.tick(now) if n % 40 == 39 else hub.wait(now)):
            if isinstance(fact, Arrived):
                for name in fact.sensors:
                    counts[name] += fact[1:]
            else:
                said.setdefault(str(getattr(fact, "sensor", None)), []).append(fact)
        if n % 15 == 14:
            shown(hub, now)
            for name, reading in sorted(hub.readings(now).items()):
                baseline = b"" if reading.baseline is None else reading.baseline.tobytes()
                known.append((name, baseline, counts[name].tolist()))
                gate = reading.gate and replace(reading.gate, since=0.0)  # the time for which this is known
                known.append(repr(replace(reading, first=None, baseline=None, gate=gate)))
    return said, known


@pytest.mark.parametrize("seed", range(2))
def test_packets_say_the_same_one_by_one_or_all_at_once_or_where_a_pass_has_a_bug(
    seed: int, passed: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    arrived = reads(seed)
    alone, known_alone = play(arrived, together=False)
    assert passed == []
    said, known = play(arrived, together=True)
    assert passed.count(True) > 1000 and passed.count(False) > 10
    assert [repr(one) for one in said.items()] == [repr(one) for one in alone.items()]
    assert known == known_alone
    if seed == 0:
        monkeypatch.setattr(Bank, "_take", lambda *_: 1 / 0)
        buggy, known_too = play(arrived, together=True)
        assert len(buggy.pop("None")) > 100, "a bug costs no frame, and is told"
        assert repr((buggy, known_too)) == repr((said, known))


def test_a_taxel_that_slowly_grows_noisy_is_found_alike() -> None:
    """So slowly that no frame of it is a touch: only the review of the noise can find it."""
    rng, arrived = np.random.default_rng(0), list[Read]()
    for k in range(1000):
        loud = np.ones((EACH, 81))
        loud[:3, 40] = np.exp(k / 250)
        values = np.rint(100 + 20 * loud * rng.normal(0, 1, loud.shape))
        arrived.append((k / 15, list(zip(PLAIN, packed(PLAIN, values), strict=True))))
    said, known = play(arrived, together=True)
    assert repr((said, known)) == repr(play(arrived, together=False))
    assert sum("bad_taxels=1" in str(one) for one in known) > 10


@pytest.mark.parametrize("missed", [None, 258])
def test_a_sensor_that_sends_on_is_no_longer_intermittent(missed: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """It fell silent after each few seconds, and then does so no more: it is well again while it is in a bank.

    So it is at once where this machine had no room for packets: those silences need not have been the sensor's own.
    """
    names, said = [f"s{n}" for n in range(EACH)], list[object]()
    for few in (FEW, 10**6):
        monkeypatch.setattr(bank, "FEW", few)
        hub, rng, states = Hub(Scene(GESTURES, (9, 9)), Sure()), np.random.default_rng(0), list[str]()
        for k in range(450):
            if k >= 225 or k % 75 < 45:
                packets = packed(names, rng.normal(100.0, 2.0, (EACH, 81)))
                if k == missed:
                    hub.missed()
                hub.receive([(packet, SOURCE) for packet in packets], k / 15)
            shown(hub, k / 15)
            states += hub.states(k / 15).values()
        assert "intermittent" in states and states[-EACH:] == ["ok"] * EACH
        said.append(states)
    assert said[0] == said[1]


def test_a_dip_of_a_moment_does_not_keep_sensors_out_of_a_bank(passed: list[bool]) -> None:
    """Interference pulls a taxel of each far below its baseline: a second later they are taken together again."""
    rng, hub, alike = np.random.default_rng(0), Hub(SCENE, Sure()), list[int]()
    for k in range(90):
        values = rng.normal(100, 2, (EACH, 81))
        values[:, 40] -= 100.0 * (k == 45)
        hub.receive([(packet, SOURCE) for packet in packed(PLAIN, values)], k / 15)
        alike.append(passed.count(True))
    assert alike[44] - alike[34] == alike[89] - alike[79] == 10 * EACH


def test_a_gate_for_all_and_a_restart_of_one_keep_the_others_in_their_bank(passed: list[bool]) -> None:
    """With a thousand sensors, to take them out would delay every answer by the time of a frame."""
    rng, hub = np.random.default_rng(0), Hub(SCENE, Sure())
    for k in range(60):
        if k == 55:
            told = hub.inhibit(None, "door", k / 15)
            assert [fact.closed for fact in told if isinstance(fact, Gate)] == [("door",)] * len(SETUPS)
            hub.restart([PLAIN[0]], k / 15)
            passed.clear()
        hub.receive([(packet, SOURCE) for packet in packed(PLAIN, rng.normal(100, 2, (EACH, 81)))], k / 15)
    assert passed == [True] * (5 * (EACH - 1))


def test_idle_frames_are_taken_together_though_others_were_lost_before_them(passed: list[bool]) -> None:
    """Else each loss would make the next frames dearer, and an overload would last for ever."""
    rng, hub, names = np.random.default_rng(0), Hub(SCENE, Sure()), [*PLAIN, *(f"clock{n}" for n in range(EACH))]
    lost = before = 0
    for k in range(120):
        packets = [
            (
                encoding.bundle(
                    [encoding.message(f"/{name}/pressure", "i" * ("clock" in name) + "f" * 81, values)], 1e9 + k / 15
                ),
                SOURCE,
            )
            for name in names
            if rng.random() < 0.7 or k < 60
            for values in [[k] * ("clock" in name) + rng.normal(100, 2, 81).tolist()]
        ]
        if k == 60:
            before = len(passed)
        hub.missed()
        facts = hub.receive(packets, k / 15)
        lost += sum(fact.lost * len(fact.sensors) for fact in facts if isinstance(fact, Arrived))
    assert all(passed[before:]) and len(passed) - before > 0.6 * 60 * len(names)
    assert lost == sum(reading.lost for reading in hub.readings(8.0).values()) > 0.2 * 60 * len(names)


def test_a_sensor_that_sends_is_not_stale_between_two_ticks() -> None:
    """The daemon ticks four times a second, and a sensor may count as gone after less."""
    hub, rng, names = Hub(Scene(GESTURES, (9, 9), stale_s=0.2), Sure()), np.random.default_rng(0), set[str]()
    for k in range(300):
        packets = packed(PLAIN, rng.normal(100.0, 2.0, (EACH, 81)))
        hub.receive([(packet, SOURCE) for packet in packets], k / 15)
        if k % 4 == 3:
            hub.tick(k / 15)
        if k > 30:
            names |= {*hub.states(k / 15).values(), *(one.state for one in hub.readings(k / 15).values())}
    assert names == {"ok"}
    hub.tick(k / 15 + 0.25)
    assert set(hub.states(k / 15 + 0.3).values()) == {"stale"}


@pytest.mark.parametrize("tagged", [True, False])
def test_a_sensor_whose_frames_no_bank_can_take_does_not_go_in_and_out(
    tagged: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That cost more than the frames: a clock of its own is set for a sensor that sends no time tags."""
    hub, rng, entered, enter = Hub(SCENE, Sure()), np.random.default_rng(0), list[str](), Bank.enter
    monkeypatch.setattr(Bank, "enter", lambda one, sensor: (entered.append(sensor.name), enter(one, sensor))[1])
    for k in range(60):
        packets = packed([f"clock{n}" for n in range(EACH)], rng.normal(100.0, 2.0, (EACH, 81)))
        packets = [encoding.bundle([packet], 1.7e9 + k / 15 if tagged else None) for packet in packets]
        hub.receive([(packet, SOURCE) for packet in packets], k / 15)
    assert sorted(entered) == ([f"clock{n}" for n in range(EACH)] if tagged else [])


def test_frames_of_one_time_are_spaced_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that shows tenths of seconds has one time for several frames, which may be read at once."""
    known = list[object]()
    for few in (FEW, 10**6):  # with banks, and without
        monkeypatch.setattr(bank, "FEW", few)
        hub, rng = Hub(SCENE, Sure()), np.random.default_rng(0)
        for k in range(0, 90, 3):
            packets = [
                encoding.bundle([encoding.message(f"/clock{n}/pressure", "f" * 81, one)], 1.7e9 + (k + j) // 3 / 5)
                for j in range(3)
                for n, one in enumerate(rng.normal(100.0, 2.0, (EACH, 81)).tolist())
            ]
            hub.receive([(packet, SOURCE) for packet in packets], 1 + k / 15)
        hub.tick(1 + k / 15)
        known.append([hub.readings(1 + k / 15)[f"clock{n}"].interval_s for n in range(EACH)])
    assert known[0] == known[1] == pytest.approx([1 / 15] * EACH)


@pytest.mark.parametrize("rate_hz", [0.4, 2.0, 3.3, 1000.0])
def test_sensors_of_any_rate_are_served(rate_hz: float) -> None:
    scene, rng, faults = Scene(GESTURES, (9, 9), stale_s=5.0), np.random.default_rng(0), list[Fact]()
    hub, names, seconds = Hub(scene, Sure()), [f"s{n}" for n in range(EACH)], 2 + 50 / rate_hz
    for k in range(int(seconds * rate_hz)):
        values = rng.normal(100.0, 2.0, (EACH, 81))
        found = hub.receive([(packet, SOURCE) for packet in packed(names, values)], k / rate_hz)
        faults += [fact for fact in found if isinstance(fact, Fault)]
    hub.tick(k / rate_hz)
    assert faults == []
    assert hub.states(k / rate_hz) == dict.fromkeys(names, "ok")


@pytest.mark.parametrize("broken", ["owner", "habits", "vitals"])
def test_a_bug_in_one_sensor_is_its_own(broken: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever happens to what is known of a sensor, the others are served in the same read, and stay as they are."""
    hub, rng, faults = Hub(SCENE, Sure()), np.random.default_rng(0), list[Fault]()
    for n in range(60):
        values = rng.normal(100.0, 2.0, (len(PLAIN), 81))
        values[3, 40] += 500 * (n >= 30)  # touched, it has to leave its bank
        if n == 30:
            monkeypatch.setattr(hub._sensors["plain3"], broken, None)
        found = hub.receive([(packet, SOURCE) for packet in packed(PLAIN, values)], n / 15)
        faults += [fact for fact in found if isinstance(fact, Fault)]
        taken = {name: fact.taken for fact in found if isinstance(fact, Arrived) for name in fact.sensors}
        assert {name: count for name, count in taken.items() if name != "plain3"} == dict.fromkeys(
            (name for name in PLAIN if name != "plain3"), 1
        )
    assert {fact.sensor for fact in faults} <= {None, "plain3"} and "plain3" in {fact.sensor for fact in faults}
    assert all(hub._sensors[name].front_end.ready for name in PLAIN if name != "plain3")
