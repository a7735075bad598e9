"""What the idle sensor shows, how much it moves, and in which step it counts.

That is learned from a second in which nothing moved, then followed while the sensor is idle.
"""

import math

import numpy as np
from numpy.typing import NDArray

from gestured.core.quantiles import median, quantile
from gestured.core.settling import LEAST_STEP, RESOLUTION, SIGMA_PER_DEVIATION, Learned, Settling

Array = NDArray[np.float64]

BASELINE_TAU_S = 2.0  # time constant of the idle sensor: drift of hours and warmth of minutes are followed
RECOVERY_TAU_S = 0.4  # time constant just after a contact: textile comes back slowly, and that is no touch
NOISE_TAU_S = 30.0  # the time constant with which noise is followed: it changes slowly
REVIEW_S = 0.5  # the pause between two looks at the noise; they would cost too much at each frame
UNSEEN_S = 4.0  # the most that one look counts of the time under a contact or in silence
OUTLIER = 4.0  # times a taxel's noise: the furthest that it counts as off its baseline, since one outlier must not rule
QUIETER = 10.0  # where frames move so many times less than the noise that was learned, that was no idle sensor's
SHARED = 0.1  # the quantile of the taxels' change that is taken for drift of them all
LOADED = 10.0  # times a taxel's noise: where no taxel is further above the bare sensor, nothing rests on it any more
GLANCE_S = 0.19  # the pause between two glances at how much frames move
GLANCE, GLANCE_REPEATED, GLANCES = 3, 1, 9  # of a quieter frame, of a repeated one; the sum that puts it in doubt


class Idle:
    """What one sensor shows while nobody touches it, and how much it moves.

    All of it stands still under a contact: a tracker that went on would erase the hand.
    """

    def __init__(self, taxels: int) -> None:
        self.counts: Array = np.zeros(taxels)  # the baseline; replaced, never changed in place
        self.sigma: Array = np.ones(taxels)  # counts, each taxel's standard deviation
        self.level = 1.0  # counts, the median taxel's standard deviation
        self.step = 0.0  # counts, one quantisation step: below it noise cannot be known
        self.lively = False  # whether no frame of the idle sensor repeated the one before it
        self.known = False  # whether an idle second was learned
        self.provisional = False  # whether what was learned is in doubt, and the next stable second replaces it
        self.glance = math.inf  # s, when `mistaken` is to be asked next
        self.smallest = 0.0  # counts, the smallest change of a sensor that stood still when it was learned; else 0
        # `counts` and `sigma` before something was laid on the sensor that has since become part of the baseline.
        self.bare: tuple[Array, Array] | None = None
        self.settling = Settling()  # the frames that `settle` was offered
        self.followed: float | None = None  # s, the last idle frame; None after a contact or a silence
        self.reviewed = 0.0  # s, when the noise was last looked at
        self.learned = 1.0  # counts, `level` as it was learned
        self.quieter = 0  # sum of the weights of the last glances that were quieter
        self.compared: Array = np.zeros(taxels)  # (N,) raw counts that those of the next glance are compared with

    def settle(self, t: float, raw: Array, *, rests: bool = False, restless: bool = False) -> Learned | None:
        """Offer (N,) counts that may be idle; what was learned, if a stable second ends here.

        `rests`: something lies there that was not when it was learned; `restless`: it may never lie still.
        """
        learned = self.settling.push(t, raw, patience=restless or not self.known)
        if learned is not None:
            bare = (self.counts, self.sigma) if rests and self.bare is None else self.bare
            if bare is not None:
                counts, sigma = bare
                if not self.known:  # the bare sensor was seen for a moment: what all taxels share is drift
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
            self.glance = t + GLANCE_S if self.level >= QUIETER * self.step else math.inf  # what moves, moves by a step
        return learned

    @property
    def doubtful(self) -> bool:
        """Whether the noise was learned from what was no idle sensor, as frames since then show."""
        return self.quieter >= GLANCES

    def mistaken(self, t: float, raw: Array) -> bool:
        """Whether (N,) counts at `t` s and those before them show that no idle sensor was learned; then it is in doubt.

        A finger moves few taxels, so it may be there meanwhile. A repeated frame says less than another one, since the
        sensor may have frozen, and nothing where the idle sensor repeats itself.
        """
        if self.provisional:
            return False
        jumps = np.abs(raw - self.compared)
        jumps = jumps[jumps > 0]
        self.glance, self.compared = t + GLANCE_S, raw
        if jumps.size and QUIETER * median(jumps) >= self.learned:
            self.quieter = 0
        elif jumps.size or self.lively:
            self.quieter += GLANCE if jumps.size else GLANCE_REPEATED
        if self.doubtful:
            self.doubt()
        return self.doubtful

    def learns_step(self, raw: Array) -> bool:
        """Learn the quantisation step, and with it the noise, from (N,) counts of a sensor that stood still so far.

        Asked where there is a `smallest` change. True if these counts change by less than that.
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
        """Follow the sensor, idle from `since` until `t` s and then (N,) counts `above` its baseline."""
        tau = RECOVERY_TAU_S if recovering else BASELINE_TAU_S
        self.counts = self.counts + above * -math.expm1((since - t) / tau)

    def follow_noise(self, t: float, above: Array) -> bool:
        """Follow how much the sensor moves, idle and (N,) counts off its baseline at `t` s; whether it was time to."""
        if t - self.reviewed < REVIEW_S:
            return False
        since = max(self.reviewed, t - UNSEEN_S)
        sigma = self.sigma + (seen(above, self.sigma) - self.sigma) * -math.expm1((since - t) / NOISE_TAU_S)
        self._set(np.maximum(sigma, self.step / 2))  # what shows no noise may have some all the same
        self.reviewed = t
        return True

    def doubt(self) -> None:
        """Put what was learned in doubt: it holds until the next stable second replaces it."""
        self.provisional, self.followed = True, None

    def unload(self, raw: Array) -> None:
        """What rested has left, as (N,) counts show: the sensor is as it was before, until the next stable second."""
        assert self.bare is not None
        (counts, sigma), self.bare = self.bare, None
        self.counts = np.minimum(counts, raw)
        self._set(sigma)
        self.settling.clear()
        self.doubt()

    def forget(self, *, keep: bool, shown: Array | None = None) -> None:
        """Learn the next stable second. `keep`: the frames that `settle` was offered count for it.

        `shown` (N,) counts: what the sensor shows meanwhile, if a hand may come before it is learned.
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
    """What a glance adds to `quieter` of each of n sensors (n,), whose (N,) counts have changed so much since the last.

    It is what `Idle.mistaken` finds of one.
    """
    jumps = np.sort(np.abs(changes), axis=1)
    moved = np.count_nonzero(jumps, axis=1)  # the taxels that did not move are sorted before them
    first, rows = jumps.shape[1] - moved, np.arange(len(jumps))
    usual = (jumps[rows, first + (moved - 1) // 2] + jumps[rows, (first + moved // 2) % jumps.shape[1]]) / 2
    loud = (moved > 0) & (QUIETER * usual >= learned)
    return np.where(loud, -quieter, np.where(moved > 0, GLANCE, np.where(lively, GLANCE_REPEATED, 0)))


def seen(above: Array, sigma: Array) -> Array:
    """(..., N) counts, the noise of each taxel as one frame shows it; `sigma`: the noise so far."""
    return np.minimum(np.abs(above), OUTLIER * sigma) * SIGMA_PER_DEVIATION
