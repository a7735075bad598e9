"""How tapes are made: what simulated hands do on a sensor, as packets that arrive."""

import heapq
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gestured.client.sensor import Form
from gestured.core.frames import Frame
from gestured.record.recordings import touches_of
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session
from tests.golden.tape import Packet, Source, Tape, ticks
from tests.hostile.faults import Fault
from tests.hostile.line import Line

EPOCH_S = 1.7e9  # of the sensors' time tags
GRAIN_S = 2.0**-10  # of times and time tags: what has few digits compresses well
Sent = tuple[float, Source, bytes]  # s, when it arrives, from whom, what
# Its noise is one or two counts: 8 bits would nearly do, and it compresses.
QUIET = replace(SimulatedSensor.nominal(), gain=120.0)
ARM: Source = ("10.0.0.1", 5001)
LEG: Source = ("10.0.0.2", 5002)
UINT16 = Form("arm", "uint16")


def hands(
    seed: int, seconds: float, sensor: SimulatedSensor = QUIET, kinds: Sequence[str] | None = None, lead_s: float = 2.0
) -> Take:
    """What somebody, drawn from `seed`, does on a sensor; `kinds` in that order, as far as the time reaches."""
    rng = generator(seed, 0x601D)
    return session(Participant(3000 + seed), replace(sensor, seed=seed), rng, seconds, 0.3, (0.7, 1.8), kinds, lead_s)


def frames_of(take: Take) -> list[Frame]:
    """The frames that arrived, each at the time at which it was felt, with its touches."""
    found = []
    for t, values, places, ids in zip(take.sensor_times, take.frames, take.touches, take.touch_ids, strict=True):
        places = np.round(16 * places) / 16  # what has few digits compresses well
        found.append(Frame(float(t), values, touches_of(ids, places)))
    return found


def moment(t: float) -> float:
    """The time tag of what is felt at `t` s."""
    return EPOCH_S + round(t / GRAIN_S) * GRAIN_S


def sent(
    take: Take,
    form: Form,
    source: Source = ARM,
    after_s: float = 0.0,
    tag: Callable[[int, float], float] = lambda n, t: moment(t),
    counter: Callable[[int], int] = lambda n: n,
) -> list[Sent]:
    """A take as it arrives. `tag` gives the time tag of the n-th frame, felt at t s; `counter` what it is numbered."""
    return [
        (after_s + float(arrival), source, form.packet(frame, counter(int(n)), tag(i, frame.t)))
        for i, (arrival, n, frame) in enumerate(zip(take.times, take.counter, frames_of(take), strict=True))
    ]


def damaged(fault: Fault, take: Take, form: Form, seed: int, source: Source = ARM) -> list[Sent]:
    """A take with a fault of the damage table, as it arrives."""
    rng, line = np.random.default_rng(seed), Line(fault.line, seed)
    form = replace(form, plain=not fault.counted)
    waiting: list[tuple[float, int, bytes]] = []
    order = itertools.count()
    for values, t, count in zip(*fault.apply((take.frames, take.sensor_times, take.counter), rng), strict=True):
        packet = form.packet(Frame(float(t), values), int(count), moment(float(t)))
        for arrival, what in line.push(float(t), packet):
            heapq.heappush(waiting, (arrival, next(order), what))
    return [(t, source, data) for t, _, data in (heapq.heappop(waiting) for _ in range(len(waiting)))]


def held(take: Take, at_s: float, seconds: float) -> Take:
    """A take in which what is touched at `at_s` stays so for longer; the sensor's noise goes on."""
    at = int(np.searchsorted(take.times, at_s))
    more = round(seconds * take.sensor.rate_hz)
    rest = np.concatenate([np.arange(at), at + np.arange(more) % 5, np.arange(at, len(take.times))])
    wait = np.concatenate([np.zeros(at), np.arange(more), np.full(len(take.times) - at, more)]) / take.sensor.rate_hz
    own = np.where((np.arange(len(rest)) >= at) & (np.arange(len(rest)) < at + more), at, rest)
    return replace(
        take,
        frames=take.frames[rest],
        touches=take.touches[rest],
        touch_ids=take.touch_ids[rest],
        times=take.times[own] + wait,
        sensor_times=take.sensor_times[own] + wait,
        counter=np.arange(len(rest)),
    )


def struck(take: Take) -> Take:
    """A take with touches of two frames between its gestures, at a fast sensor too short for a finger."""
    frames, strongest = take.frames.copy(), int(take.frames.astype(int).sum(axis=(1, 2)).argmax())
    for event in take.events[1::2]:
        at = int((event.offset_s + 0.45) * take.sensor.rate_hz)  # gestures are 0.7 s apart or more
        frames[at : at + 2] = take.frames[strongest]
    return replace(take, frames=frames)


def jammed(take: Take) -> Take:
    """A take in which two rows at the edge jump up and stand still, for 0.8 s every two."""
    frames = take.frames.copy()
    frames[take.times % 2.0 < 0.8, :2] = int(frames.max()) + 100
    return replace(take, frames=np.where((take.times < 3.0)[:, None, None], take.frames, frames))


def late(packets: Iterable[Sent], stalls: Sequence[tuple[float, float]]) -> list[Sent]:
    """What arrives while the daemon's loop stands still, from and to these s, is found waiting at the end of it."""
    return [
        (next((until for since, until in stalls if since <= t < until), t), source, data) for t, source, data in packets
    ]


def tape(
    name: str,
    about: str,
    *packets: Iterable[Sent],
    stalls: Sequence[tuple[float, float]] = (),
    rest_s: float = 2.5,
    origin_s: float = 0.0,
    **settings: Any,
) -> Tape:
    """A tape of all these packets, the first of them at `origin_s`; the daemon goes on for `rest_s` after the last."""
    every = sorted(late(itertools.chain(*packets), stalls), key=lambda packet: packet[0])
    first = every[0][0]

    def ns(t: float) -> int:
        return round((round((t - first) / GRAIN_S) * GRAIN_S + origin_s) * 1e9)

    found = tuple(Packet(ns(t), source, data) for t, source, data in every)
    start, end = found[0].t_ns, found[-1].t_ns + round(rest_s * 1e9)
    still = [(ns(since), ns(until)) for since, until in stalls]
    return Tape(name, about, found, ticks(start, end, still), end, settings)
