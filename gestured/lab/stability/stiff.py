"""Stiff and extreme sessions: how slow ramps, hum, creep, coarse clocks and long days change decisions.

Whole simulated sessions of gestures and non-gestures are bent in one way each, and pass through the daemon's own path.
A whole day shows what a front end holds at its end.
"""

import hashlib
import math
import pickle
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.points import USUAL
from gestured.core.scene import Setup
from gestured.core.stamping import Stamper
from gestured.core.wire import Arrival
from gestured.lab.everyday.hours import Hours, hear, points_of
from gestured.lab.everyday.stretches import Stretch
from gestured.lab.stability.extremes import Array
from gestured.lab.table import Table, Value
from gestured.model.model import Model
from gestured.record.judge import NONE, Performed
from gestured.simulator import GESTURES, Participant, SimulatedSensor, Take, gesture_take, session
from gestured.simulator.people import generator

DAY_S, HOUR_S = 86_400.0, 3600.0
FIRST = 8_000_000  # first person; no model has learned from these people
SHOWN = 16  # digits of a SHA-256
RUNS = ("the first run", "the second")


def day(quick: bool) -> Stretch:
    """A day at 15 Hz (20 minutes if quick): its temperature swings by 50 noise units; a gesture every ten minutes."""
    sensor, rng = SimulatedSensor.nominal(day=FIRST), generator(FIRST, 0xDA4)
    noise, contacts = sensor.gain * sensor.noise, 2 if quick else 6 * 24
    takes = [gesture_take(name, Participant(FIRST + k), sensor, rng) for k, name in enumerate(GESTURES)]
    touched = [one - np.median(one, axis=0) for one in (take.frames.astype(np.float64) for take in takes)]
    meant: list[Performed] = []
    for k in range(contacts):
        act, at = takes[k % len(takes)].events[0], 600.0 * k + 300.0
        meant.append(Performed(act.label, act.kind, at + act.onset_s, at + act.offset_s))

    def frames() -> Iterator[Frame]:
        for k in range(contacts):
            t = 600.0 * k + np.arange(9000) / sensor.rate_hz
            block = noise * rng.standard_normal((9000, sensor.rows, sensor.columns))
            block += 300.0 + 50.0 * noise * np.sin(2 * math.pi * t / DAY_S)[:, None, None]
            one = touched[k % len(touched)]
            block[4500 : 4500 + len(one)] += one
            yield from map(Frame, t.tolist(), np.rint(block))

    return Stretch("day", "one", frames(), Setup(grid=(sensor.rows, sensor.columns)), meant, [])


def day_table(quick: bool) -> Table:
    """The same day twice through a front end: the size of its state, and whether the states are equal."""
    whole, part, every_s = ("20 minutes", "ten minutes", HOUR_S / 6) if quick else ("24 hours", "an hour", HOUR_S)
    most = f"most, after any {part.split()[-1]}"
    return Table(
        f"A front end after {whole} at 15 Hz",
        ("the same day", "frames", f"bytes held after {part}", most, "digest of all at its end"),
        [(title, *_run(day(quick), every_s)) for title in RUNS],
        (
            "A simulated sensor whose temperature swings by 50 noise units, with a gesture every ten minutes; the row",
            "of 24 hours above has what was decided, and for how long no gesture could begin. Held is all that",
            "Python's pickle finds: the state of every filter, and what was learned of every taxel.",
        ),
    )


def _run(life: Stretch, every_s: float) -> tuple[Value, ...]:
    front_end, count, sizes = FrontEnd(*life.setup.grid or (9, 9)), 0, list[int]()
    for frame in life.frames:
        front_end.push(frame)
        count += 1
        if count % round(15 * every_s) == 0:
            sizes.append(len(pickle.dumps(front_end)))
    return count, sizes[0], max(sizes), hashlib.sha256(pickle.dumps(front_end)).hexdigest()[:SHOWN]


SESSION_S, PEOPLE = 120.0, 10
OTHERS = 0.25  # share of non-gestures in what is performed
EPOCH_S = 1.7e9  # of the sensors' clocks at a session's start
Bend = Callable[[Take, float], Take]  # a session and its noise in counts -> the session, bent
Clock = Callable[[Array], Array]  # true times -> what the sensor's clock shows, in s


@dataclass(frozen=True, slots=True)
class Case:
    """One way to bend a session: by its frames, its sensor, its clock or its counter."""

    title: str
    bend: Bend = lambda take, noise: take
    sensor: Callable[[SimulatedSensor], SimulatedSensor] = lambda sensor: sensor
    clock: Clock | None = None  # its time tags are used; None: the arrivals are
    counter: int = 0  # of the first frame


def _counts(take: Take) -> NDArray[np.float64]:
    return take.frames.astype(np.float64)


def _warming(units: float) -> Bend:
    """All taxels rise by so many noise units a second."""
    return lambda take, noise: replace(take, frames=_counts(take) + units * noise * take.times[:, None, None])


def _hum(hz: float, strength: float) -> Bend:
    """Mains hum as a scan at 15 Hz shows it, row after row."""

    def bend(take: Take, noise: float) -> Take:
        row = np.arange(take.frames.shape[1]) / take.frames.shape[1]
        wave = np.sin(2 * math.pi * (hz * take.times[:, None] + row))
        return replace(take, frames=_counts(take) + strength * noise * wave[:, :, None])

    return bend


def _arm(creeps: bool) -> Bend:
    """Something as wide as an arm lies on the edge from 10 s on; if it creeps, by a third of its counts each decade."""

    def bend(take: Take, noise: float) -> Take:
        rows, columns = take.frames.shape[1:]
        shape = np.exp(-((np.arange(rows) - rows) ** 2) / 4.0)[:, None] * np.ones(columns)
        since = np.maximum(take.times - 10.0, 0.0)
        level = np.clip(since / 0.3, 0.0, 1.0) * (1.0 + (0.33 * np.log10(1.0 + since / 0.5) if creeps else 0.0))
        return replace(take, frames=_counts(take) + 60.0 * noise * level[:, None, None] * shape)

    return bend


def _pulsing(period_s: float) -> Bend:
    """Counts of touches swing between a tenth and all of themselves."""

    def bend(take: Take, noise: float) -> Take:
        frames = _counts(take)
        idle = np.median(frames, axis=0)
        swing = 0.55 + 0.45 * np.sign(np.sin(2 * math.pi * take.times / period_s))
        return replace(take, frames=idle + (frames - idle) * swing[:, None, None])

    return bend


def _coarse(step_s: float) -> Clock:
    return lambda t: np.floor(t / step_s) * step_s


def _stepping(leap_s: float) -> Clock:
    return lambda t: t + leap_s * np.floor(t / 7.0)


def cases() -> Iterator[Case]:
    """All cases; the first is a session as it is."""
    yield Case("as it is")
    for ramp in (1.0, 3.0, 10.0):
        yield Case(f"a cabin warms: {ramp:g} noise units a second", _warming(ramp))
    for hz in (0.1, 0.5, 2.0, 5.0, 7.4):
        for strength in (2.0, 6.0):
            yield Case(f"mains at 50 or 60 Hz, seen at {hz:g} Hz: {strength:g} sigma", _hum(hz, strength))
    yield Case("an arm on the edge", _arm(creeps=False))
    yield Case("an arm on the edge that creeps", _arm(creeps=True))
    for period in (0.2, 0.4, 2.0):
        yield Case(f"force swings tenfold every {period:g} s", _pulsing(period))
    stiff = {"relaxation": (0.25, 0.25), "taus_s": (0.03, 0.9), "jitter_s": 0.03}
    yield Case("relaxation of 0.03 s beside 0.9 s, frames 30 ms off", sensor=lambda one: replace(one, **stiff))  # type: ignore[arg-type]
    for step in (0.01, 0.05, 0.1):
        yield Case(f"a clock of {1000 * step:g} ms", clock=_coarse(step))
    for leap in (3600.0, -3600.0, 0.5, -0.5):
        yield Case(f"a clock that steps by {leap:g} s every 7 s", clock=_stepping(leap))
    yield Case("a counter that wraps", clock=lambda t: t, counter=2**31 - 900)


def stiff_table(model: Model, quick: bool) -> Table:
    """The table of each case over the same sessions, and of a day."""
    people = range(FIRST, FIRST + (1 if quick else PEOPLE))
    rows = [_row(case.title, model, (_stretch(case, person) for person in people)) for case in cases()]
    rows.append(
        _row(f"{'20 minutes' if quick else '24 hours'} whose temperature swings by 50 noise units", model, [day(quick)])
    )
    return Table(
        "Stiff and extreme sessions, by decisions",
        ("session", "minutes", "gestures", "right", "wrong", "missed", "false", "deaf min an hour"),
        rows,
        (
            f"Simulated sessions of {PEOPLE} people, two minutes each, in which a quarter of what is performed is no",
            "gesture; each case bends the same ones. A noise unit (sigma) is the standard deviation of an idle taxel.",
            "False: said of what is no gesture. Deaf: no gesture can begin, as docs/everyday.md counts it.",
        ),
    )


def _row(title: str, model: Model, stretches: Iterable[Stretch]) -> tuple[Value, ...]:
    least, found = points_of(model)[USUAL], Hours()
    for one in stretches:
        found.add(hear(one, [model], USUAL, published=True), model.name, least)
    said, deaf = found.said, sum(found.deaf_s.values()) / 60 / found.hours
    became = [said[how] for how in ("right", "wrong", "missed")]
    return title, round(60 * found.hours), sum(became), *became, said["false"], f"{deaf:.1f}"


def _stretch(case: Case, person: int) -> Stretch:
    sensor = case.sensor(SimulatedSensor.nominal(day=person))
    take = session(Participant(person), sensor, generator(person, 0x57F), SESSION_S, OTHERS)
    take = case.bend(take, sensor.gain * sensor.noise)
    frames = list(map(Frame, take.times.tolist(), take.frames)) if case.clock is None else list(_stamped(case, take))
    # The judge compares times of the stream, which a clock that steps shifts.
    felt = take.times if case.clock is None else np.array([frame.t for frame in frames])
    acts = [act for act in take.events if act.label != NONE]
    times = [np.interp((act.onset_s, act.offset_s), take.times, felt).tolist() for act in acts]
    meant = [Performed(act.label, act.kind, *when) for act, when in zip(acts, times, strict=True)]
    return Stretch("stiff", str(person), frames, Setup(grid=take.frames.shape[1:]), meant, [])


def _stamped(case: Case, take: Take) -> Iterator[Frame]:
    """The frames at the times that the daemon gives them by the sensor's clock and counter."""
    assert case.clock is not None
    stamper, tags = Stamper("sensor"), EPOCH_S + case.clock(take.sensor_times)
    for n, (arrived, values) in enumerate(zip(take.times.tolist(), take.frames, strict=True)):
        counter = (case.counter + n + 2**31) % 2**32 - 2**31
        stamp = stamper.stamp([Arrival("stiff", values, counter, float(tags[n]), ())], arrived)[0]
        yield Frame(stamp.t, values, (), stamp.lost)
