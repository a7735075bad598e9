"""Bad taxels: which are stuck, frozen under a finger, flickering or noisy, and how they are bridged."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
# (N,) taxels that did not change during a contact, and those of them whose neighbours were pressed.
Still = tuple[Mask, Mask]

NOISY = 8.0  # times the sensor's noise: a taxel with more is bad
FROZEN_S = 0.4  # a pressed taxel that stays the same to the last digit for so long shows no finger, which trembles
FROZEN_NOISE = 3.0  # times a taxel's own noise: above this a taxel counts as pressed
STRIKES = 2  # a taxel is stuck after so many contacts in which it stood still while its neighbours were pressed
STRUCK_SHARE = 0.4  # of the contact's peak: a taxel's neighbours that reach a smaller share are not pressed
STRUCK_NOISE = 8.0  # times the sensor's noise: neighbours below this level are not pressed in any case
TURNS = 5  # a taxel flickers after so many jumps up and down in one contact, since no finger does that
TURNS_TOO = 3  # so many jumps suffice if another taxel flickers already, since taxels seldom flicker alone
TURN_FRAMES = 15  # after so many frames without a turn a taxel's turns are counted anew
TURN_SHARE = 0.15  # of the taxel's peak in the contact: smaller jumps are a finger's tremble
ALONE = 4.0  # times its neighbours' peaks: no finger presses one taxel so much more than those beside it
HELD_SHARE = 0.5  # of the highest other taxel's peak: a flickering taxel above it may have made the contact alone
RUBBISH_ONE_IN = 2  # if more than one taxel in so many jumps, the frames are rubbish
RUBBISH_S = 1.0  # only a contact that has lasted so long can be rubbish for its many jumping taxels: a burst passes
STEADY_FRAMES = 30  # after so many frames without a turn a taxel flickers no more
NEAR, DIAGONAL = 2.0, 1.0  # weights of a taxel's neighbours beside it and at its corners


class Frozen:
    """The taxels that show the same pressure to the last digit, below the sensor's limit, though a finger trembles."""

    def __init__(self, taxels: int) -> None:
        self.mask: Mask = np.zeros(taxels, dtype=bool)
        self.any = False
        self._tells = False  # whether a finger's tremble shows in this sensor's last digit
        self._still_since = np.zeros(taxels)  # s
        self._previous: Array = np.full(taxels, math.nan)  # raw counts; in the first frame all have changed
        self._limit = -math.inf  # the largest raw count under a touch, at which a sound taxel may stand still

    def learn(self, *, fine: bool) -> None:
        """The sensor was learned anew: nothing is frozen. `fine`: a finger's tremble shows in its last digit."""
        self._tells = fine
        self._set(np.zeros_like(self.mask))

    def watch(self, t: float, raw: Array, above: Array, sigma: Array) -> bool:
        """Take a frame of (N,) `raw` counts, `above` the baseline, with noise `sigma`; true if `mask` has changed.

        Called while the sensor is touched, and later as long as a taxel is frozen.
        """
        self._still_since[raw != self._previous] = t
        self._previous = raw
        if not self._tells:
            return False
        self._limit = max(self._limit, raw.item(raw.argmax()))
        if not self.any and t - self._still_since.item(self._still_since.argmin()) < FROZEN_S:  # most frames end here
            return False
        frozen = (t - self._still_since >= FROZEN_S) & (above > FROZEN_NOISE * sigma) & (raw < self._limit)
        return self._set(frozen)

    def _set(self, mask: Mask) -> bool:
        changed = bool((mask != self.mask).any())
        self.mask, self.any = mask, bool(mask.any())
        return changed


class Flickering:
    """The taxels that jump up and down from frame to frame while their neighbours do not: no finger does that."""

    def __init__(self, rows: int, columns: int) -> None:
        self._shape = rows, columns
        self.mask: Mask = np.zeros(rows * columns, dtype=bool)
        self.any = False
        self.rubbish = False  # whether the contact is no touch: most taxels jumped so, or those that made the contact
        self._frames = 0  # frames that were seen
        self._turned = np.zeros(rows * columns, dtype=np.int64)  # the frame in which each taxel turned round last
        self.begin(0.0)

    def begin(self, t: float) -> None:
        """A contact begins at `t` s: turns are counted anew, unless a taxel flickers already."""
        self._began, self.rubbish = t, False
        if not self.any:
            size = self.mask.size
            self._turns = np.zeros(size, dtype=np.int64)
            self._peak, self._above, self._jump = np.zeros(size), np.zeros(size), np.zeros(size)

    def learn(self) -> None:
        """The sensor was learned anew: nothing flickers."""
        self._set(np.zeros_like(self.mask))

    def watch(self, t: float, above: Array, noise: float, bad: Mask) -> bool:
        """Take a frame of (N,) counts `above` the baseline at `t` s; true if `mask` has changed.

        Called while the sensor is touched, and later as long as a taxel flickers. `noise` is the sensor's, in counts;
        `bad` (N,) taxels can have made no contact.
        """
        jump, before = above - self._above, self._jump
        back = jump * before
        self._frames += 1
        self._above, self._jump = above, jump
        self._peak = np.maximum(self._peak, above)
        clear = NOISY * noise
        if not self.any and back.item(back.argmin()) > -clear * clear:  # most frames end here
            return False
        turned = (back < 0) & (np.minimum(np.abs(jump), np.abs(before)) > np.maximum(TURN_SHARE * self._peak, clear))
        self._turns *= self._frames - self._turned < TURN_FRAMES
        self._turns += turned
        self._turned[turned] = self._frames
        if not self.any and self._turns.item(self._turns.argmax()) < TURNS:  # most of the other frames end here
            return False
        mask = self.mask & (self._frames - self._turned < STEADY_FRAMES)
        often = self._turns >= (TURNS_TOO if self.any else TURNS)
        if often.any():
            around = neighbour_mean(self._peak.reshape(self._shape), np.ones(self._shape, dtype=bool)).ravel()
            mask |= often & (self._peak > ALONE * around)
            held = self._peak[~bad & mask].max(initial=0.0) > HELD_SHARE * self._peak[~bad & ~mask].max(initial=0.0)
            most = int(np.count_nonzero(often)) * RUBBISH_ONE_IN > often.size
            self.rubbish = self.rubbish or bool(held) or (most and t - self._began >= RUBBISH_S)
        return self._set(mask)

    def _set(self, mask: Mask) -> bool:
        changed = bool((mask != self.mask).any())
        self.mask, self.any = mask, bool(mask.any())
        return changed


class Taxels:
    """The bad taxels of a sensor of R x C taxels. They are flat here: (N,) with N = R * C."""

    def __init__(self, rows: int, columns: int) -> None:
        self.rows, self.columns = rows, columns
        self._stuck: Mask = np.zeros(rows * columns, dtype=bool)  # taxels that show the same whatever presses them
        self._strikes = np.zeros(rows * columns, dtype=np.int64)
        self._blameless = False  # whether no taxel has strikes or is stuck
        self.frozen = Frozen(rows * columns)
        self.flickering = Flickering(rows, columns)
        self.bad: Mask = np.zeros(rows * columns, dtype=bool)  # replaced, never changed in place
        self.count = 0  # how many taxels are bad

    def learn(self, constant: Mask, *, fine: bool) -> None:
        """The sensor was learned anew. `constant`: (N,) taxels that never changed; `fine`: as in `Frozen.learn`."""
        self._stuck, self._blameless = constant, False
        self.frozen.learn(fine=fine)
        self.flickering.learn()

    def review(self, sigma: Array, noise: float) -> None:
        """Find the bad taxels by each one's noise (N,) and the sensor's. If all taxels are bad, none counts as bad."""
        self.bad = self._stuck | self.frozen.mask | self.flickering.mask | (sigma > NOISY * noise)
        self.count = int(np.count_nonzero(self.bad))
        if self.count == self.bad.size:
            self.bad, self.count = np.zeros_like(self.bad), 0

    def inspect(self, frames: Array, noise: float) -> Still:
        """The taxels that stood still in the frames of a contact: (T, N) counts above the baseline, not bridged."""
        peaks = frames.max(axis=0)
        still = peaks == frames.min(axis=0)
        if len(frames) < 2 or not still.any():
            return still, np.zeros_like(still)
        around = neighbour_mean(peaks.reshape(self.rows, self.columns), np.ones((self.rows, self.columns), dtype=bool))
        return still, still & (around.ravel() > max(STRUCK_SHARE * float(peaks.max()), STRUCK_NOISE * noise))

    def judge(self, seen: Still) -> bool:
        """A contact is over: a taxel that stood still in STRIKES of them is stuck. True if the stuck ones changed."""
        still, suspect = seen
        if self._blameless and not suspect.any():
            return False
        self._strikes[suspect] += 1
        self._strikes[~still] = 0
        stuck = (self._stuck & still) | (self._strikes >= STRIKES)
        self._blameless = not (stuck.any() or self._strikes.any())
        changed = bool((stuck != self._stuck).any())
        self._stuck = stuck
        return changed

    def bridge(self, frames: Array) -> Array:
        """(T, N) -> (T, R, C) with the bad taxels replaced by what their good neighbours show.

        A patch of bad taxels is filled from its rim inwards.
        """
        frames = frames.reshape(-1, self.rows, self.columns)
        if not self.count:
            return frames
        good = ~self.bad.reshape(self.rows, self.columns)
        frames = np.where(good, frames, 0.0)
        while not good.all():
            around = neighbour_mean(frames, good)
            fill = ~good & (neighbour_mean(good.astype(float), np.ones_like(good)) > 0)
            frames = np.where(fill, around, frames)
            good = good | fill
        return frames


def neighbour_mean(grid: NDArray[np.floating], good: Mask) -> Array:
    """(..., R, C) -> the weighted mean of each taxel's neighbours, of the (R, C) good ones; 0 if none is good."""
    rows, columns = good.shape
    values, weight = np.zeros((*grid.shape[:-2], rows + 2, columns + 2)), np.zeros((rows + 2, columns + 2))
    values[..., 1:-1, 1:-1], weight[1:-1, 1:-1] = np.where(good, grid, 0.0), good
    total = np.zeros(grid.shape)
    count = np.zeros(good.shape)
    for i in range(3):
        for j in range(3):
            if (i, j) != (1, 1):
                share = NEAR if 1 in (i, j) else DIAGONAL
                total += share * values[..., i : i + rows, j : j + columns]
                count += share * weight[i : i + rows, j : j + columns]
    return total / np.maximum(count, 1e-9)  # without a good neighbour the total is 0 as well
