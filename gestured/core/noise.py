"""How much an idle sensor moves: each taxel's noise, and the step in which the sensor counts."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.quantiles import median, quantile

Array = NDArray[np.float64]

NOISE_TAU_S = 30.0  # the time constant with which noise is followed: it changes slowly
REVIEW_S = 0.5  # the pause between two looks at the noise; they would cost too much at each frame
UNSEEN_S = 4.0  # the most that one look counts of the time under a contact or in silence
OUTLIER = 4.0  # times its noise: a taxel that is further off counts as this far, since one outlier must not rule
JUMP_PER_SIGMA = 1.128  # of normal noise, the mean absolute difference of successive values: 2 / sqrt(pi)
SIGMA_PER_DEVIATION = 1.2533  # of normal noise, its sigma by its mean absolute deviation: sqrt(pi / 2)
LIVELY_FRAMES = 10  # from so many one can tell that a sensor never sends the same frame twice in a row
TREMBLE = 0.35  # of a step: with that much noise a finger's tremble shows in the last digit
CLIPPED_SHARE = 0.25  # of the taxels: where so many lie at the lowest value twice, the sensor cuts off its noise
CLIPPED_QUANTILE = 0.75  # of the taxels' noise, where it is cut off: most taxels seem quieter than they are
PRIOR_FRAMES = 16  # frames that the noise of all taxels weighs: a second of frames knows a taxel's own noise badly
LEAST_STEP = 1e-35  # counts; its reciprocal must stay a number
WHOLE = 2.0**52  # counts: from here on every float64 is a whole number, which says nothing
RESOLUTION = 1e-6  # of the largest count: less than float32 resolves is no step of a sensor


class Restlessness(NamedTuple):
    """What (n, N) counts of a sensor that may be idle say of its noise."""

    floor: float  # counts, one standard deviation of the usual taxel, or one step where that is more
    step: float  # counts, one quantisation step
    spread: Array  # (N,) counts, one standard deviation of each taxel about its median
    tells_constants: bool  # whether a taxel that stood still stands out: noise shows, and is not cut off
    fine: bool  # whether a finger's tremble shows in the last digit

    def sigma(self, frames: int) -> Array:
        """(N,) counts: each taxel's standard deviation as `frames` tell it, leaning on all taxels together."""
        pooled = (frames * self.spread**2 + PRIOR_FRAMES * self.floor**2) / (frames + PRIOR_FRAMES)
        return np.maximum(np.sqrt(pooled), self.floor / 2)


def restlessness(stack: Array, baseline: Array, jumps: Array) -> Restlessness:
    """What (n, N) counts say, with their medians (N,) and their successive absolute differences (n - 1, N).

    Differences see noise and not slow movement; means of absolute values, since one outlier must not rule.
    """
    rough = jumps.mean(axis=0) / JUMP_PER_SIGMA
    clipped = np.count_nonzero((stack == stack.min()).sum(axis=0) >= 2) >= CLIPPED_SHARE * rough.size
    pooled = quantile(rough[rough > 0], CLIPPED_QUANTILE if clipped else 0.5) if rough.any() else 0.0
    step = quantum(stack, jumps)
    spread = np.abs(stack - baseline).mean(axis=0) * SIGMA_PER_DEVIATION
    return Restlessness(max(pooled, step), step, spread, not (clipped or pooled < step), pooled >= TREMBLE * step)


def quantum(stack: Array, jumps: Array) -> float:
    """One quantisation step in counts of a sensor that has shown (n, N) counts, and these changes; never 0.

    Whole numbers count in ones; otherwise the smallest change that was seen is taken.
    """
    if np.array_equal(stack, np.rint(stack)) and np.abs(stack).max() < WHOLE:
        return 1.0
    seen = jumps[jumps > 0]
    top = float(median(np.abs(stack).max(axis=1)))  # of most frames: one spike must not rule
    return max(float(seen.min()) if seen.size else 0.0, top * RESOLUTION, LEAST_STEP)


class Noise:
    """The noise of one sensor: learned with its baseline, then followed while it is idle."""

    def __init__(self, taxels: int) -> None:
        self.sigma: Array = np.ones(taxels)  # counts, each taxel's standard deviation
        self.level = 1.0  # counts, the median taxel's
        self.step = 0.0  # counts, one quantisation step: below it noise cannot be known
        self.lively = False  # whether no frame of the idle sensor was the one before again
        self._reviewed = 0.0  # s, when it was last looked at
        self._smallest = 0.0  # counts, the smallest change of a sensor that stood still when it was learned; else 0
        self._shown: Array = np.zeros(taxels)  # the last raw counts of such a sensor

    def learn(self, t: float, raw: Array, sigma: Array, step: float, frames: Array, *, still: bool) -> None:
        """Begin anew at `t` s with what (n, N) idle `frames` told, the last of them `raw`; `still`: none changed."""
        self.step, self._reviewed = step, t
        self.lively = len(frames) >= LIVELY_FRAMES and bool(np.diff(frames, axis=0).any(axis=1).all())
        self._smallest, self._shown = math.inf if still else 0.0, raw
        self._set(sigma)

    def learns_step(self, raw: Array) -> bool:
        """Whether (N,) counts of a sensor that has stood still so far tell its step anew, and with it its noise."""
        if not self._smallest > 0:
            return False
        moved = raw != self._shown
        changed = raw[moved] - self._shown[moved]
        self._shown = raw
        if not changed.size or np.array_equal(raw, np.rint(raw)):  # whole numbers count in ones, as in `quantum`
            return False
        smallest = max(float(np.abs(changed).min()), RESOLUTION * float(np.abs(raw).max()), LEAST_STEP)
        if smallest >= self._smallest:
            return False
        self._smallest = self.step = smallest
        self._set(np.full_like(self.sigma, smallest))
        return True

    def follow(self, t: float, above: Array) -> bool:
        """Follow the idle sensor, (N,) counts off its baseline at `t` s; whether it was time to look at the noise."""
        if t - self._reviewed < REVIEW_S:
            return False
        since = max(self._reviewed, t - UNSEEN_S)
        seen = np.minimum(np.abs(above), OUTLIER * self.sigma) * SIGMA_PER_DEVIATION
        sigma = self.sigma + (seen - self.sigma) * -math.expm1((since - t) / NOISE_TAU_S)
        self._set(np.maximum(sigma, self.step / 2))  # what shows no noise may have some all the same
        self._reviewed = t
        return True

    def _set(self, sigma: Array) -> None:
        self.sigma = sigma
        self.level = float(median(sigma))
