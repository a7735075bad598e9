"""Settling: the idle sensor is learned from one second in which nothing moved.

A filter that begins with the first frame would learn a hand that lies there.
"""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.quantiles import median, quantile

Array = NDArray[np.float64]

SETTLE_S = 0.93  # a stable second at 15 Hz: half-way between its last two frames, so that jitter cannot miss it
LOOK_S = 0.06  # the pause between two checks whether the last second was stable
SETTLE_FRAMES = 64  # the most frames kept of a second; those of faster sensors are thinned out
LEAST_FRAMES = 4  # the fewest frames of a second, since fewer have no two halves to compare
PATIENCE_S = 5.0  # a sensor that has not settled by then (hum, a restless hand) is used all the same
RESTLESS = 5.0  # times the sensor's noise: a taxel that moves more was touched, or is bad
MOVED = 3  # the most taxels that may move in a stable second: bad ones must not keep a sensor from settling
MOVED_ONE_IN = 20  # of a small sensor, at most one taxel in so many may move
HALVES = 1.4  # times the noise of a second's quieter half: more is no noise, but a movement that has just ended
HALF_CHANGES = 16  # changes of taxels in half a second that suffice to tell the noise of that half
CONSTANT_ONE_IN = 4  # if more than one taxel in so many stands still, that is this sensor's way, and no fault
SPIKE = 1000.0  # times the usual jump between frames: a frame that is further off is a fault of the readout
SPIKES_ONE_IN = 8  # if more than one frame in so many is a spike, none of them is taken for a fault
JUMP_PER_SIGMA = 1.128  # mean absolute difference of successive values of normal noise, in sigmas: 2 / sqrt(pi)
SIGMA_PER_DEVIATION = 1.2533  # sigma of normal noise, in mean absolute deviations: sqrt(pi / 2)
TREMBLE = 0.35  # of a quantisation step: with as much noise, a finger's tremble shows in the last digit
CLIPPED_SHARE = 0.25  # of the taxels: if so many lie at the lowest value twice, the sensor cuts off its noise
CLIPPED_QUANTILE = 0.75  # of the taxels' noise if it is cut off, since most taxels then seem quieter than they are
PRIOR_FRAMES = 16  # weight, in frames, of all taxels' noise: one second tells little of a taxel's own noise
LEAST_STEP = 1e-35  # counts; its reciprocal must stay a number
LIVELY_FRAMES = 10  # frames that suffice to tell that a sensor never sends the same frame twice in a row
WHOLE = 2.0**52  # counts; from here on every float64 is a whole number, which says nothing of the step
RESOLUTION = 1e-6  # of the largest count: a step below this is less than float32 resolves, and no sensor's


class Learned(NamedTuple):
    """What one second has shown of the idle sensor."""

    baseline: Array  # (N,) counts
    noise: Array  # (N,) counts, one standard deviation
    constant: NDArray[np.bool_]  # (N,) taxels that never changed while others did
    moved: int  # taxels that moved
    fine: bool  # whether a finger's tremble shows in the last digit
    step: float  # counts, one quantisation step
    still: bool  # whether nothing changed at all, so that the step is a guess
    lively: bool  # whether no frame repeated the one before it
    frames: Array  # (n, N) counts from which all this was learned

    @property
    def stable(self) -> bool:
        """Whether hardly a taxel moved."""
        return self.moved <= min(MOVED, self.baseline.size // MOVED_ONE_IN)


class Settling:
    """The frames that may be idle, collected until one second of them shows no movement."""

    def __init__(self) -> None:
        self._frames: deque[tuple[float, Array]] = deque()
        self.since: float | None = None  # s, the first frame since the sensor was last touched

    def clear(self) -> None:
        """Forget what was collected: the sensor was touched."""
        if self.since is not None:
            self._frames.clear()
            self.since = None

    def push(self, t: float, raw: Array, *, patience: bool) -> Learned | None:
        """Take one frame of (N,) counts at `t` s; returns what was learned, or None as long as nothing was.

        With `patience`, a second that is not stable is accepted after `PATIENCE_S`.
        """
        frames = self._frames
        if self.since is None:
            self.since = t
        if not frames or t - frames[-1][0] >= SETTLE_S / SETTLE_FRAMES:
            frames.append((t, raw))
        if t - frames[0][0] < SETTLE_S or len(frames) < LEAST_FRAMES:
            return None
        learned = _learned(np.array([counts for _, counts in frames]))
        if not learned.stable and not (patience and t - self.since >= PATIENCE_S):
            while t - frames[0][0] >= SETTLE_S - LOOK_S:  # check again soon, since a movement may just have ended
                frames.popleft()
            return None
        self.clear()
        return learned


def _learned(stack: Array) -> Learned:
    """What (n, N) counts show of the sensor, if it was idle.

    Noise is told by differences, which slow movement hardly changes, and by means of absolute values, since a single
    outlier must not rule.
    """
    jumps, baseline, step = _shown(stack)
    good = _good(stack, jumps, baseline, step)
    if not good.all():
        stack = stack[good]
        jumps, baseline, step = _shown(stack)
    half = len(stack) // 2
    clipped = bool(np.count_nonzero((stack == stack.min()).sum(axis=0) >= 2) >= CLIPPED_SHARE * baseline.size)
    usual = _usual(jumps, clipped=clipped)
    floor = calm = max(usual, step)  # counts, one standard deviation of the usual taxel, or one step if that is more
    if jumps[:half].size >= HALF_CHANGES:
        quieter = min(_usual(part, clipped=clipped) for part in (jumps[:half], jumps[half:]))
        calm = min(floor, HALVES * max(quieter, step))
    spread = np.abs(stack - baseline).mean(axis=0) * SIGMA_PER_DEVIATION  # each taxel's standard deviation
    shift = np.abs(median(stack[:half]) - median(stack[half:]))
    moved = np.maximum(spread, shift) > RESTLESS * calm
    constant = (jumps == 0).all(axis=0)
    if clipped or usual < step or np.count_nonzero(constant) > constant.size // CONSTANT_ONE_IN:
        constant[:] = False  # the taxels of a clipped or coarse sensor stand still when idle, which proves no fault
    pooled = (len(stack) * spread**2 + PRIOR_FRAMES * floor**2) / (len(stack) + PRIOR_FRAMES)
    noise = np.maximum(np.sqrt(pooled), floor / 2)
    return Learned(
        baseline, noise, constant, int(np.count_nonzero(moved)), usual >= TREMBLE * step, step,
        not jumps.any(), len(stack) >= LIVELY_FRAMES and bool(jumps.any(axis=1).all()), stack,
    )  # fmt: skip


def _usual(jumps: Array, *, clipped: bool) -> float:
    """Counts, the standard deviation of the usual taxel by (n, N) absolute changes; 0 if there were none."""
    rough = jumps.mean(axis=0) / JUMP_PER_SIGMA
    moving = rough[rough > 0]
    return quantile(moving, CLIPPED_QUANTILE if clipped else 0.5) if moving.size else 0.0


def _shown(stack: Array) -> tuple[Array, Array, float]:
    """The (n - 1, N) absolute changes of (n, N) counts, their (N,) medians, and the quantisation step."""
    jumps = np.abs(stack[1:] - stack[:-1])
    return jumps, median(stack), quantum(stack, jumps)


def _good(stack: Array, jumps: Array, baseline: Array, step: float) -> NDArray[np.bool_]:
    """(n,) false for the few frames that are spikes: one spike would rule the noise for minutes."""
    leaps = jumps.max(axis=1)
    leaps.sort()
    usual = leaps.item(len(leaps) // 4)  # the lower quartile, since each spike makes two leaps
    good = np.abs(stack - baseline).max(axis=1) <= SPIKE * max(usual, step)
    few = np.count_nonzero(~good) <= max(1, len(stack) // SPIKES_ONE_IN)
    return good if few else np.ones_like(good)


def quantum(stack: Array, jumps: Array) -> float:
    """The quantisation step in counts of a sensor that has shown (n, N) counts with these `jumps`; never 0.

    Whole numbers count in ones; otherwise the smallest change that was seen is taken.
    """
    if (stack == np.rint(stack)).all() and np.abs(stack).max() < WHOLE:
        return 1.0
    seen = jumps[jumps > 0]
    top = float(median(np.abs(stack).max(axis=1)))  # the median over frames, since one spike must not rule
    return max(float(seen.min()) if seen.size else 0.0, top * RESOLUTION, LEAST_STEP)
