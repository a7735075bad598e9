"""The idle pass: one frame of each of many sensors that nobody touches, as arrays of all of them.

Nearly all frames of many sensors are idle, and a call of numpy costs more than the 81 numbers that it is for. So
frames of calm sensors that wait together are taken together. What is known of a sensor stays in its own objects: it is
gathered from them, and what has changed is put back. The pass does what `FrontEnd.push` does with an idle frame of a
calm sensor, to the last bit: `matmul` of a stack of grids gives what `dot` gives of each, and exponentials are
`math`'s. Any other frame is left to `push`.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.activity import SURPRISE, USUAL_AT_MOST
from gestured.core.conditioning import Look, weigh
from gestured.core.facts import Fact, Fault
from gestured.core.front_end import FrontEnd
from gestured.core.idle import BASELINE_TAU_S, NOISE_TAU_S, REVIEW_S, UNSEEN_S, mistaken, seen
from gestured.core.quantiles import median
from gestured.core.sensor import Sensor
from gestured.core.taxels import NOISY
from gestured.core.timing import SHARE
from gestured.core.wire import Arrival

Array = NDArray[np.float64]

FEW = 5  # sensors from which on a pass costs less than their frames one by one
AS_EXPECTED = (0, "", False, False)  # a stamp without its time, where no frame was lost and the sensor goes on

_new = tuple.__new__  # Look(...) takes twice the time


class Waiting:
    """The frames of one sensor among the packets of one call; the first `taken` of them are done."""

    __slots__ = ("arrivals", "sensor", "stamps", "taken")

    def __init__(self, sensor: Sensor, first: Arrival) -> None:
        self.sensor, self.arrivals, self.taken = sensor, [first], 0
        self.stamps: Any = None  # a list of `Stamp`, or the bug that `Sensor.stamp` met; None before it was asked

    def goes_on(self) -> bool:
        """Whether an idle pass may take the next frame: there is one, and it came as expected."""
        stamps, taken = self.stamps, self.taken
        return taken < len(stamps) and stamps[taken][1:] == AS_EXPECTED and self.sensor.front_end.calm


def passes(waiting: Iterable[Waiting], now: float, facts: list[Fact]) -> None:
    """Stamp what waits of calm sensors at `now`, and take those frames of it that are idle, a pass for each kind."""
    kinds: dict[tuple[int, ...], list[Waiting]] = {}
    for one in waiting:
        if one.sensor.calm:
            one.stamps = one.sensor.stamp(one.arrivals, now)
            if not isinstance(one.stamps, Exception) and one.goes_on():
                kinds.setdefault(one.sensor.front_end.kind, []).append(one)
    for going in kinds.values():
        while len(going) >= FEW:
            try:
                found = take(
                    [one.sensor.front_end for one in going],
                    [one.stamps[one.taken].t for one in going],
                    [one.arrivals[one.taken].values for one in going],
                )
            except Exception as error:  # a bug in the pass: frames that it has not taken are taken one by one
                facts.append(Fault(None, error))
                found = [one.sensor.front_end.pace.last == one.stamps[one.taken].t for one in going]
            going = list(compress(going, found))
            for one in going:
                one.taken += 1
                one.sensor.passed(now, facts)
            going = [one for one in going if one.goes_on()]


def take(fronts: Sequence[FrontEnd], times: Sequence[float], values: Sequence[NDArray[np.generic]]) -> list[bool]:
    """Take one frame of each of n calm sensors of one `FrontEnd.kind`, where the frame is idle; (n,) whether it was.

    `times` are in s, `values` (R, C) counts as they were sent. No frame was lost before any of them.
    """
    first, paces = fronts[0], [front.pace for front in fronts]
    conditioners = [front.conditioner for front in fronts]
    idles, activities = [one.idle for one in conditioners], [one.activity for one in conditioners]
    t, last, interval_s, usual, scale, reviewed, glance = np.array((
        times,
        [pace.last for pace in paces],
        [pace.interval_s for pace in paces],
        [activity.usual for activity in activities],
        [activity.scale for activity in activities],
        [idle.reviewed for idle in idles],
        [idle.glance for idle in idles],
    ), dtype=np.float64)  # fmt: skip
    stack: NDArray[np.generic] = np.concatenate(values).reshape(-1, *first.sent)
    raw = (stack if first.as_sent else first.mounting.frame(stack)).astype(np.float64).reshape(len(fronts), -1)
    step = t - last
    taken = (step > 0) & (step <= first.timing.stale_s)
    due = (taken & (t >= glance)).nonzero()[0]
    if due.size:
        taken[due] = np.logical_not(mistaken([idles[n] for n in due.tolist()], t[due], raw[due]))
    counts = _rows([idle.counts for idle in idles])
    above = raw - counts
    strongest, lowest = activities[0].measure_all(above * _rows([one.weight for one in conditioners]))
    taken &= (strongest < first.segmenter.off) & (lowest >= -first.conditioner.deep)

    ago = np.minimum(-step, 0.0)
    interval_s += (step - interval_s) * SHARE
    usual += (np.minimum(strongest, SURPRISE * activities[0].typical) * scale - usual) * _shares(ago, NOISE_TAU_S)
    counts += above * _shares(ago, BASELINE_TAU_S)[:, np.newaxis]
    due = (taken & (t - reviewed >= REVIEW_S)).nonzero()[0]
    found = _reviewed([fronts[n] for n in due.tolist()], t[due], above[due], usual[due]) if due.size else None
    if found is not None:
        taken[due[found.noisy]] = False  # `push` looks for the taxels that are bad
    # So far only glances were counted, so a bug until here costs nothing: `push` can take each frame from the start.
    # From here on sensors change one after the other, and `pace.last` says of which the frame is taken.
    done: list[bool] = taken.tolist()
    rows = zip(
        fronts, values, times, paces, idles, activities, raw, above, counts,
        strongest.tolist(), interval_s.tolist(), usual.tolist(), strict=True,
    )  # fmt: skip
    for front, sent, now, pace, idle, activity, shown, higher, baseline, active, interval, mean in compress(rows, done):
        look = _new(Look, (now, shown, higher, active, False, False, False))
        front.cutter.keep(look, 0, None)
        front.cutter.trim(now)
        front.shown, front.look, activity.usual = sent, look, mean
        idle.followed, idle.counts = now, baseline.copy()  # a view would keep the rows of all others in memory
        pace.interval_s, pace.last = interval, now  # the last step: it says that the frame is taken
    if found is not None:
        for n, deviation, level, larger, weighed in zip(due.tolist(), *found[:4], strict=True):
            if done[n]:
                idle, conditioner = idles[n], conditioners[n]
                idle.reviewed, idle.sigma, idle.level = times[n], deviation.copy(), float(level)
                activities[n].scale, conditioner.weight = float(larger), weighed.copy()
    return done


class _Reviewed(NamedTuple):
    """The noise of n sensors after a review, and what follows from it."""

    sigma: Array  # (n, N) counts
    level: Array  # (n,) counts
    scale: Array  # (n,) as in `Activity`
    weight: Array  # (n, N) as `weigh` gives it
    noisy: NDArray[np.bool_]  # (n,) whether some taxel of the sensor is much noisier than the others


def _reviewed(fronts: Sequence[FrontEnd], t: Array, above: Array, usual: Array) -> _Reviewed:
    """The noise of these sensors, (n, N) counts off their baselines at `t` s, followed, and their taxels weighed anew.

    `usual` is how active each of them usually is, with this frame.
    """
    idles, typical = [front.conditioner.idle for front in fronts], fronts[0].conditioner.activity.typical
    sigma, step = _rows([idle.sigma for idle in idles]), np.array([idle.step for idle in idles])
    since = np.maximum([idle.reviewed for idle in idles], t - UNSEEN_S)
    sigma += (seen(above, sigma) - sigma) * _shares(since - t, NOISE_TAU_S)[:, np.newaxis]
    sigma = np.maximum(sigma, step[:, np.newaxis] / 2)
    level = median(sigma.T)
    noisy = np.any(sigma > NOISY * level[:, np.newaxis], axis=1)
    scale = np.minimum(np.maximum(usual / typical, 1.0), USUAL_AT_MOST)
    return _Reviewed(sigma, level, scale, weigh(sigma, level[:, np.newaxis], scale[:, np.newaxis]), noisy)


def _shares(ago: Array, tau: float) -> Array:
    """(n,) shares of a difference that a follower with time constant `tau` s takes up in (n,) times `-ago` s."""
    return np.array([-math.expm1(one) for one in (ago / tau).tolist()])


def _rows(each: list[Array]) -> Array:
    """n arrays (N,) as the rows of one, (n, N)."""
    return np.concatenate(each).reshape(len(each), -1)
