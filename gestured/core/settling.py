"""What the idle sensor looks like: learned from one second in which nothing moved."""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SETTLE_S = 0.93  # a stable second at 15 Hz: half-way between its last two frames, so jitter cannot miss it
LOOK_S = 0.06  # how often it is looked whether the last second was stable
SETTLE_FRAMES = 64  # frames kept of that second; faster sensors are thinned out
PATIENCE_S = 5.0  # a sensor that never settles (hum, a hand that never rests) is used all the same after this
RESTLESS = 5.0  # a taxel that moves more than this many times the sensor's noise was touched, or is bad
LEAST_STEP = 1e-35  # counts; its reciprocal must stay a number
SPIKE = 1000.0  # a frame so many times further off than frames usually jump is a fault of the readout, not idle


class Learned(NamedTuple):
    """What a second says of the idle sensor."""

    baseline: Array  # (N,) counts
    noise: Array  # (N,) counts, one standard deviation
    constant: NDArray[np.bool_]  # (N,) taxels that never changed while others did
    moved: int  # taxels that moved
    fine: bool  # whether noise shows in the last digit
    step: float  # counts, one quantisation step
    still: bool  # nothing changed at all, so that the step is a guess
    frames: Array  # (n, N) counts that this was learned from

    @property
    def stable(self) -> bool:
        """Whether hardly a taxel moved."""
        return self.moved <= min(3, self.baseline.size // 20)


class Settling:
    """Collects frames until one second of them shows no movement, and says what the idle sensor looks like."""

    def __init__(self) -> None:
        self._frames: deque[tuple[float, Array]] = deque()
        self._since: float | None = None

    @property
    def started(self) -> bool:
        """Whether anything is collected."""
        return self._since is not None

    def clear(self) -> None:
        """Forget what was collected: the sensor was touched."""
        self._frames.clear()
        self._since = None

    def push(self, t: float, raw: Array, *, patience: bool) -> Learned | None:
        """Take one frame of (N,) counts; returns what was learned or nothing yet.

        `patience` allows an answer that is not stable after `PATIENCE_S`.
        """
        frames = self._frames
        if self._since is None:
            self._since = t
        if not frames or t - frames[-1][0] >= SETTLE_S / SETTLE_FRAMES:
            frames.append((t, raw))
        if t - frames[0][0] < SETTLE_S or len(frames) < 4:
            return None
        stack = np.array([f for _, f in frames])  # (n, N)
        learned = _idle(stack)
        if not learned.stable and not (patience and t - self._since >= PATIENCE_S):
            while t - frames[0][0] >= SETTLE_S - LOOK_S:  # look again soon: movement may just have ended
                frames.popleft()
            return None
        self.clear()
        return learned


def _idle(stack: Array) -> Learned:
    """What (n, N) counts show."""
    stack = _without_spikes(stack)
    n = len(stack)
    baseline = median(stack)
    # Successive differences see noise and not slow movement; mean absolute values, since one outlier must not rule.
    jumps = np.abs(np.diff(stack, axis=0))
    rough = jumps.mean(axis=0) / 1.128
    # Where idle taxels are clipped at zero, most of them seem quieter than they are: the upper quartile knows better.
    clipped = np.count_nonzero((stack == stack.min()).sum(axis=0) >= 2) * 4 >= rough.size
    pooled = _quantile(rough[rough > 0], 0.75 if clipped else 0.5) if rough.any() else 0.0
    step = quantum(stack, jumps)
    floor = max(pooled, step)  # below one step noise cannot be known: one step stands for it
    spread = np.abs(stack - baseline).mean(axis=0) * 1.2533
    shift = np.abs(median(stack[: n // 2]) - median(stack[n // 2 :]))
    moved = int(np.count_nonzero((spread > RESTLESS * floor) | (shift > RESTLESS * floor)))
    # A second of frames knows a taxel's own noise badly: lean on all taxels together.
    noise = np.maximum(np.sqrt((n * spread**2 + 16 * floor**2) / (n + 16)), floor / 2)
    constant = np.all(jumps == 0, axis=0)
    if clipped or pooled < step or np.count_nonzero(constant) > stack.shape[1] // 4:
        constant[:] = False  # a clipped or coarse sensor stands still when idle: that proves nothing
    return Learned(baseline, noise, constant, moved, pooled >= 0.35 * step, step, not jumps.any(), stack)


def _without_spikes(stack: Array) -> Array:
    """(n, N) counts but for single frames that lie beyond all reason: one of them would rule the noise for minutes."""
    jumps = np.abs(np.diff(stack, axis=0))
    leaps = jumps.max(axis=1)
    usual = float(np.partition(leaps, len(leaps) // 4)[len(leaps) // 4])
    good = np.abs(stack - median(stack)).max(axis=1) <= SPIKE * max(usual, quantum(stack, jumps))
    return stack if good.all() or len(stack) - np.count_nonzero(good) > max(1, len(stack) // 8) else stack[good]


def median(values: Array) -> Array:
    """(n, ...) -> (...), along the first axis. `numpy.median` says the same, and imports masked arrays."""
    ordered = np.sort(values, axis=0)
    middle = len(ordered) // 2
    return np.asarray(ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2)


def _quantile(values: Array, share: float) -> float:
    """Of (N,) values, as `numpy.quantile` has it, to the last bit, without its masked arrays."""
    ordered = np.sort(values)
    below = int(share * (len(ordered) - 1))
    beyond = share * (len(ordered) - 1) - below
    low, high = float(ordered[below]), float(ordered[min(below + 1, len(ordered) - 1)])
    return low + (high - low) * beyond if beyond < 0.5 else high - (high - low) * (1 - beyond)


def quantum(stack: Array, jumps: Array) -> float:
    """One quantisation step of the sensor in counts: 1 for integers, else the smallest change seen, never 0."""
    if np.array_equal(stack, np.rint(stack)) and np.abs(stack).max() < 2**52:
        return 1.0
    seen = jumps[jumps > 0]
    top = float(median(np.abs(stack).max(axis=1)))  # of most frames: one spike must not rule
    return max(float(seen.min()) if seen.size else 0.0, top * 1e-6, LEAST_STEP)
