"""The faults of a sensor, of the way from it, and of the machine that listens; seeded."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.hostile.line import Impairment

Frames = NDArray[np.generic]  # (N, R, C) raw counts
Times = NDArray[np.float64]  # (N,) s
Counts = NDArray[np.int64]  # (N,) the sensor's frame counter
Stream = tuple[Frames, Times, Counts]
Stall = tuple[float, float]  # s, from and until
Change = Callable[[Frames, Times, Counts, np.random.Generator], Stream]
LEAD_S = 2.0  # untouched, and without a fault: what the daemon learns the sensor from
EVERY_S = 10.0  # the faults that come and go come so often


@dataclass(frozen=True)
class Fault:
    """What is wrong: with the way, with the sensor, or with the daemon's machine.

    `counted`: frames carry the sensor's counter. `stall_s`: every ten seconds the daemon's loop stands still for so
    long; what arrives meanwhile waits in the kernel's buffer.
    """

    line: Impairment = Impairment()
    sensor: Change | None = None
    counted: bool = True
    stall_s: float = 0.0

    def apply(self, stream: Stream, rng: np.random.Generator) -> Stream:
        """What the sensor sends instead."""
        frames, times, counts = stream[0].copy(), stream[1].copy(), stream[2].copy()
        return self.sensor(frames, times, counts, rng) if self.sensor else (frames, times, counts)

    def stalls(self, times: Times, rng: np.random.Generator) -> list[Stall]:
        """When the daemon stands still, in order."""
        if not self.stall_s:
            return []
        starts = (begin + rng.uniform(0, 8) for begin in np.arange(times[0] + LEAD_S, times[-1], EVERY_S))
        return [(start, start + self.stall_s) for start in starts]


def _taxels(count: int, becomes: int | None) -> Change:
    """Some taxels, each from a moment on while they run, show one value, or (None) all at once anything at all."""

    def change(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
        at = rng.choice(frames.shape[1] * frames.shape[2], count, replace=False)
        for row, column in zip(at // frames.shape[2], at % frames.shape[2], strict=True):
            if becomes is None:
                later = times > times[0] + LEAD_S
                frames[later, row, column] = rng.integers(0, 4096, later.sum())
            else:
                frames[times > times[0] + LEAD_S + rng.uniform(0, 10), row, column] = becomes
        return frames, times, counts

    return change


def _dead_line(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
    """A whole row or column falls to 0: a broken conductor."""
    later, at = times > times[0] + LEAD_S, int(rng.integers(frames.shape[1]))
    if rng.random() < 0.5:
        frames[later, at, :] = 0
    else:
        frames[later, :, at] = 0
    return frames, times, counts


def _saturated(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
    """Nothing above a third of a touch can be told apart."""
    idle = np.median(frames.astype(np.float64), axis=0)
    top = idle + (np.quantile(frames.max(axis=(1, 2)) - idle.max(), 0.95) / 3)
    return np.minimum(frames, top.astype(frames.dtype)), times, counts


def _frozen(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
    """For a second in ten it sends the same frame again and again."""
    for begin in np.arange(times[0] + LEAD_S, times[-1], EVERY_S):
        span = (times >= begin + rng.uniform(0, 8)) & (times < begin + 9)
        at = np.flatnonzero(span)[:15]
        frames[at] = frames[at[:1]]
    return frames, times, counts


def _one_in_a_hundred(*, flash: bool) -> Change:
    """One frame in a hundred is all at the top of the range, or else anything at all."""

    def change(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
        hit = (rng.random(len(frames)) < 0.01) & (times > times[0] + LEAD_S)
        frames[hit] = 4095 if flash else rng.integers(0, 4096, (hit.sum(), *frames.shape[1:]))
        return frames, times, counts

    return change


def _spikes(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
    """Every ten seconds one taxel shows 1e30 in one frame, as a flipped bit of a float may."""
    frames = frames.astype(np.float32)
    for begin in np.arange(times[0] + LEAD_S, times[-1], EVERY_S):
        at = min(int(np.searchsorted(times, begin + rng.uniform(0, 8))), len(frames) - 1)
        frames[at, rng.integers(frames.shape[1]), rng.integers(frames.shape[2])] = 1e30
    return frames, times, counts


def _drift(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
    """Its rate wanders by a fifth, up and down within half a minute."""
    phase = rng.uniform(0, 2 * np.pi)
    return frames, times + 0.95 * (np.cos(phase) - np.cos(2 * np.pi * times / 30 + phase)), counts


def _away(seconds: float, *, restarts: bool) -> Change:
    """Every ten seconds it sends nothing for so long; where it restarts then, its counter begins at 0."""

    def change(frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
        heard = np.ones(len(times), bool)
        for begin in np.arange(times[0] + LEAD_S, times[-1], EVERY_S):
            start = begin + rng.uniform(0, 8)
            heard &= (times < start) | (times >= start + seconds)
            if restarts:
                later = np.flatnonzero(times >= start + seconds)
                counts[later] = np.arange(len(later))
        return frames[heard], times[heard], counts[heard]

    return change


FAULTS: dict[str, Fault] = {
    "none": Fault(),
    "loss of 1 %": Fault(Impairment(loss=0.01)),
    "loss of 5 %": Fault(Impairment(loss=0.05)),
    "loss of 20 %": Fault(Impairment(loss=0.2)),
    "loss of 5 % in bursts of 5": Fault(Impairment(loss=0.05, burst=5)),
    "loss of 5 %, no counter": Fault(Impairment(loss=0.05), counted=False),
    "10 % doubled": Fault(Impairment(duplicate=0.1)),
    "10 % doubled, no counter": Fault(Impairment(duplicate=0.1), counted=False),
    "5 % overtaken": Fault(Impairment(late=0.05)),
    "5 % overtaken, no counter": Fault(Impairment(late=0.05), counted=False),
    "delay of 0.5 s, jitter of 0.05 s": Fault(Impairment(delay_s=0.5, jitter_s=0.05)),
    "jitter of 0.2 s": Fault(Impairment(jitter_s=0.2)),
    "the way stalls for 0.8 s": Fault(Impairment(stall_s=0.8)),
    "the daemon stalls for 1 s": Fault(stall_s=1.0),
    "5 % corrupted": Fault(Impairment(corrupt=0.05)),
    "5 % cut short": Fault(Impairment(cut=0.05)),
    "silence of 1.5 s": Fault(sensor=_away(1.5, restarts=False)),
    "sensor restarts": Fault(sensor=_away(0.3, restarts=True)),
    "rate drifts by 20 %": Fault(sensor=_drift),
    "frozen for 1 s": Fault(sensor=_frozen),
    "2 taxels stuck": Fault(sensor=_taxels(2, 4095)),
    "4 taxels dead": Fault(sensor=_taxels(4, 0)),
    "a row or column dead": Fault(sensor=_dead_line),
    "2 taxels noisy": Fault(sensor=_taxels(2, None)),
    "saturated at a third": Fault(sensor=_saturated),
    "1 % garbage frames": Fault(sensor=_one_in_a_hundred(flash=False)),
    "1 % flashes": Fault(sensor=_one_in_a_hundred(flash=True)),
    "a spike of 1e30": Fault(sensor=_spikes),
}
