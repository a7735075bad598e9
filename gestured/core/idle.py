"""The idle sensor: its baseline, its noise and its quantisation step.

All three are learned from a second in which nothing moved, then followed while the sensor is idle.
"""

import math

import numpy as np
from numpy.typing import NDArray

from gestured.core.quantiles import median, quantile
from gestured.core.settling import LEAST_STEP, RESOLUTION, SIGMA_PER_DEVIATION, Learned, Settling

Array = NDArray[np.float64]

BASELINE_TAU_S = 2.0  # time constant of the baseline: it follows drift over hours and warmth over minutes
RECOVERY_TAU_S = 0.4  # time constant of the baseline just after a contact, since textile comes back slowly
NOISE_TAU_S = 30.0  # time constant of the noise, which changes slowly
REVIEW_S = 0.5  # the pause between two steps of the noise, which would cost too much with each frame
UNSEEN_S = 4.0  # the longest step of the noise: one frame says little of a long contact or silence before it
OUTLIER = 4.0  # times a taxel's noise: a frame counts as at most so far off the baseline, since no outlier must rule
QUIETER = 10.0  # if frames move so many times less than the noise that was learned, no idle sensor was learned
SHARED = 0.1  # the quantile of the taxels' changes that is taken for a drift of all taxels
LOADED = 10.0  # times a taxel's noise: if no taxel is further above the bare sensor, nothing rests on it any more
GLANCE_S = 0.19  # the pause between two glances at how much frames move
# Weights of a glance at a frame that moves QUIETER times less and at a repeated one; the sum that proves a mistake.
GLANCE, GLANCE_REPEATED, GLANCES = 3, 1, 9


class Idle:
    """What one sensor shows while nobody touches it, and how much it moves.

    Nothing of this changes under a contact, since a baseline that went on following would erase the hand.
    """

    def __init__(self, taxels: int) -> None:
        self.counts: Array = np.zeros(taxels)  # the baseline; replaced, never changed in place
        self.sigma: Array = np.ones(taxels)  # counts, each taxel's standard deviation
        self.level = 1.0  # counts, the median taxel's standard deviation
        self.step = 0.0  # counts, one quantisation step: below it noise cannot be known
        self.lively = False  # whether no frame of the idle sensor repeated the one before it
        self.known = False  # whether an idle second was learned
        self.provisional = False  # whether what was learned is in doubt, so that the next stable second replaces it
        self.glance = math.inf  # s, when `mistaken` is to be asked next
        self.smallest = 0.0  # counts, the smallest change so far of a sensor that stood still when learned; else 0
        # `counts` and `sigma` of the bare sensor, if something rests on it that has become part of the baseline.
        self.bare: tuple[Array, Array] | None = None
        self.settling = Settling()  # the frames that `settle` was offered
        self.followed: float | None = None  # s, the last idle frame; None after a contact or a silence
        self.reviewed = 0.0  # s, the last step of the noise
        self.learned = 1.0  # counts, `level` as it was learned
        self.quieter = 0  # the sum of the weights of the glances since the last frame that moved as was learned
        self.compared: Array = np.zeros(taxels)  # (N,) raw counts with which the next glance compares its own

    def settle(self, t: float, raw: Array, *, rests: bool = False, restless: bool = False) -> Learned | None:
        """Offer (N,) counts at `t` s that may be idle; returns what was learned, if a stable second ends with them.

        `rests`: something lies there that was not there when the sensor was learned. `restless`: it may tremble.
        """
        learned = self.settling.push(t, raw, patience=restless or not self.known)
        if learned is not None:
            bare = (self.counts, self.sigma) if rests and self.bare is None else self.bare
            if bare is not None:
                counts, sigma = bare
                if not self.known:  # the bare counts are those of a moment, and what all taxels share since is drift
                    counts = counts + max(quantile(learned.baseline - counts, SHARED), 0.0)
                lies = (learned.baseline - counts > LOADED * sigma).any()
                bare = (counts, sigma) if lies else None
            self.bare = bare
            self.counts, self.step, self.lively = learned.baseline, learned.step, learned.lively
            self.known, self.provisional = True, not learned.stable
            self.followed = self.reviewed = t
            self.smallest, self.compared = math.inf if learned.still else 0.0, raw
            self._set(learned.noise)
            self.quieter, self.learned = 0, self.level
            # A frame that moves at all moves by a step, so with less noise no frame can be QUIETER times less.
            self.glance = t + GLANCE_S if self.level >= QUIETER * self.step else math.inf
        return learned

    @property
    def doubtful(self) -> bool:
        """Whether frames have shown that the noise was not learned from an idle sensor."""
        return self.quieter >= GLANCES

    def mistaken(self, t: float, raw: Array) -> bool:
        """Glance at (N,) counts at `t` s; whether no idle sensor was learned, in which case it is put in doubt.

        A finger may be there, since it moves few taxels. A repeated frame says less than another quiet one, since the
        sensor may have frozen; of a sensor that repeats frames when it is idle, it says nothing.
        """
        if self.provisional:
            return False
        jumps = np.abs(raw - self.compared)
        jumps.sort()
        moved = int(np.count_nonzero(jumps))  # the taxels that did not move are sorted before them
        usual = (jumps.item(-(moved // 2) - 1) + jumps.item(-((moved + 1) // 2))) / 2  # the median of those that moved
        self.glance, self.compared = t + GLANCE_S, raw
        if moved and QUIETER * usual >= self.learned:
            self.quieter = 0
        elif moved or self.lively:
            self.quieter += GLANCE if moved else GLANCE_REPEATED
        if self.doubtful:
            self.doubt()
        return self.doubtful

    def learns_step(self, raw: Array) -> bool:
        """Learn step and noise from (N,) counts of a sensor that stood still when it was learned.

        Called if `smallest` is not 0. True if these counts have changed by less than that.
        """
        moved = raw != self.compared
        changed = raw[moved] - self.compared[moved]
        self.compared = raw
        if not changed.size or np.array_equal(raw, np.rint(raw)):  # whole numbers count in ones, as in `quantum`
            return False
        smallest = max(float(np.abs(changed).min()), RESOLUTION * float(np.abs(raw).max()), LEAST_STEP)
        if smallest >= self.smallest:
            return False
        self.smallest = self.step = smallest
        self._set(np.full_like(self.sigma, smallest))
        return True

    def follow(self, t: float, since: float, above: Array, *, recovering: bool) -> None:
        """Let the baseline follow a sensor that was idle from `since` to `t` s and is (N,) counts `above` it at `t`."""
        tau = RECOVERY_TAU_S if recovering else BASELINE_TAU_S
        self.counts = self.counts + above * -math.expm1((since - t) / tau)

    def follow_noise(self, t: float, above: Array) -> bool:
        """Let the noise follow an idle sensor, (N,) counts `above` its baseline; false until REVIEW_S is over."""
        if t - self.reviewed < REVIEW_S:
            return False
        since = max(self.reviewed, t - UNSEEN_S)
        sigma = self.sigma + (seen(above, self.sigma) - self.sigma) * -math.expm1((since - t) / NOISE_TAU_S)
        self._set(np.maximum(sigma, self.step / 2))  # noise of less than half a step does not show
        self.reviewed = t
        return True

    def doubt(self) -> None:
        """Put what was learned in doubt; it is used until the next stable second replaces it."""
        self.provisional, self.followed = True, None

    def unload(self, raw: Array) -> None:
        """Go back to the bare sensor until the next stable second: what rested has left, as (N,) `raw` counts show."""
        assert self.bare is not None
        (counts, sigma), self.bare = self.bare, None
        self.counts = np.minimum(counts, raw)
        self._set(sigma)
        self.settling.clear()
        self.doubt()

    def forget(self, *, keep: bool, shown: Array | None = None) -> None:
        """Forget the idle sensor until the next stable second. `keep`: frames that `settle` was offered count for it.

        `shown`: (N,) counts of the bare sensor, in case a hand comes to rest before it is learned.
        """
        self.known = self.provisional = False
        self.bare = None if shown is None else (shown, self.sigma if self.bare is None else self.bare[1])
        self.followed = None
        if not keep:
            self.settling.clear()

    def _set(self, sigma: Array) -> None:
        self.sigma = sigma
        self.level = float(median(sigma))


def glances(changes: Array, learned: Array, lively: Array, quieter: Array) -> Array:
    """(n,) what a glance adds to `quieter` of each of n sensors, whose (n, N) counts have changed by `changes`.

    `Idle.mistaken` does the same for one sensor.
    """
    jumps = np.sort(np.abs(changes), axis=1)
    moved = np.count_nonzero(jumps, axis=1)  # the taxels that did not move are sorted before them
    first, rows = jumps.shape[1] - moved, np.arange(len(jumps))
    usual = (jumps[rows, first + (moved - 1) // 2] + jumps[rows, (first + moved // 2) % jumps.shape[1]]) / 2
    loud = (moved > 0) & (QUIETER * usual >= learned)
    return np.where(loud, -quieter, np.where(moved > 0, GLANCE, np.where(lively, GLANCE_REPEATED, 0)))


def seen(above: Array, sigma: Array) -> Array:
    """(..., N) counts, the noise of each taxel by one frame `above` the baseline; `sigma`: the noise so far."""
    return np.minimum(np.abs(above), OUTLIER * sigma) * SIGMA_PER_DEVIATION
