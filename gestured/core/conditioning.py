"""The conditioner of one sensor: from raw counts to counts above the baseline, and what a frame shows.

What is known of a sensor has three parts: what the idle sensor shows and how much it moves (`Idle`), how active it
usually is (`Activity`), and which taxels are bad (`Taxels`).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.activity import Activity, hardly_ever
from gestured.core.contact import ON_SHARE, AfterEffect
from gestured.core.idle import LOADED, Idle
from gestured.core.quantiles import median
from gestured.core.taxels import Taxels

Array = NDArray[np.float64]

LEAST_SIGMA = 0.2  # of the sensor's noise: a taxel that hardly moves weighs at most five times as much as a usual one
BELOW_SHARE = 0.3  # of the highest taxel: beside a firm finger, taxels may lie below the baseline by up to that share
DRIFTED = 0.1  # of the activity of what rested: the bare sensor may have drifted by so much while it was covered
WIDE_PEAK = 0.5  # of the highest taxel: the taxels above that share tell how wide a contact is
WIDE, WIDE_TAXELS = 0.1, 6  # a share of all taxels, and a least number of taxels, that not even two fingers press
WIDE_S = 0.5  # s for which a contact counts as wide after a wide frame: an elbow presses about WIDE_TAXELS
SHIFTED, SHIFTED_OF = 3, 20  # no touch makes 3 taxels of 20, or more, lie far below the baseline


_new = tuple.__new__  # Look(...) takes twice the time


class Look(NamedTuple):
    """What one frame shows, against the idle sensor."""

    t: float  # s
    raw: Array  # (N,) counts
    above: Array  # (N,) counts above the baseline
    activity: float  # noise units, of the strongest spot
    sunken: bool  # a taxel lies clearly below its baseline, as after a hand that rested there while it was learned
    burst: bool  # a taxel lies deeper than textile swings after a contact, as after interference
    shifted: bool  # many taxels lie so deep; no touch does that: the sensor restarted, or a hand has left


class Conditioner:
    """What is known of one sensor of R x C taxels after mounting. Taxels are flat here: (N,) with N = R * C."""

    def __init__(self, rows: int, columns: int) -> None:
        self.idle = Idle(rows * columns)
        self.activity = Activity(rows, columns)
        self.taxels = Taxels(rows, columns)
        self.weight: Array = np.ones(rows * columns)  # 1 / noise, 0 for bad taxels
        self._wide = max(WIDE_TAXELS, WIDE * (rows * columns))  # so many taxels that are pressed are more than fingers
        self._wide_at = -math.inf  # s, when what presses was last wider than fingers
        self.deep = hardly_ever(rows * columns)  # noise units below the baseline that are no noise

    def look(self, t: float, raw: Array, after: AfterEffect) -> Look:
        """What (N,) counts at `t` s show. `after` says how far textile may still swing below its baseline."""
        if self.idle.smallest and self.idle.learns_step(raw):
            self.review()
        above = raw - self.idle.counts
        scaled = above * self.weight
        activity, lowest = self.activity.measure(scaled)
        if not lowest < -self.deep:
            return _new(Look, (t, raw, above, activity, False, False, False))
        level = max(self.deep, after.level(t))
        burst = lowest < -level
        return Look(t, raw, above, activity, True, burst, burst and _shifted(scaled, level))

    def unloaded(self, look: Look, after: AfterEffect) -> Look | None:
        """The look at the same frame after what rested on the sensor has left; None if it has not left.

        The baseline is then the one from before anything rested there, and the textile recovers as after a contact.
        """
        idle, bare = self.idle, self.idle.bare
        if bare is None:
            return None
        counts, sigma = bare
        weight = self._weigh(sigma, float(median(sigma)))
        left = (look.raw - counts) * weight
        rested = self.activity.measure((idle.counts - counts) * weight)[0]
        if left.min() < -max(self.deep, DRIFTED * rested) or self.activity.measure(left)[0] > ON_SHARE * rested:
            return None  # the thing lies there, is about to leave, or something else has happened
        idle.unload(look.raw)
        self.review()
        after.leave(rested, look.t)
        return self.look(look.t, look.raw, after)

    def resting(self) -> tuple[float, float]:
        """The share of the taxels on which something rests that the baseline has learned, and its activity."""
        if self.idle.bare is None:
            return 0.0, 0.0
        counts, sigma = self.idle.bare
        load = (self.idle.counts - counts) * self._weigh(sigma, float(median(sigma)))
        return float(np.count_nonzero(load > LOADED)) / load.size, self.activity.measure(load)[0]

    def fallen(self, look: Look) -> float:
        """The activity that the frame would have, were its counts inverted."""
        return self.activity.measure(-look.above * self.weight)[0]

    def place(self, look: Look) -> tuple[float, float]:
        """Where a frame is pressed, its centroid (row, column); bad taxels are left out."""
        return self.activity.place(self._good(look.above), self.idle.level)

    def wide(self, look: Look) -> bool:
        """Whether what presses is, or was a moment ago, wider than fingers: an arm, a hand, a body, a thing."""
        pressed = self._good(look.above)
        if np.count_nonzero(pressed >= WIDE_PEAK * pressed.item(pressed.argmax())) >= self._wide:
            self._wide_at = look.t
        return 0 <= look.t - self._wide_at < WIDE_S

    def _good(self, values: Array) -> Array:
        """(N,) values with 0 for bad taxels."""
        return np.where(self.taxels.bad, 0.0, values) if self.taxels.count else values

    def settle(self, t: float, raw: Array, *, rests: bool = False, restless: bool = False) -> bool:
        """Offer a frame that may be idle; true if the sensor was learned from the second that ends with it.

        `rests`: something lies on the sensor that was not there when it was learned. `restless`: that thing is no
        moving finger, so if it never lies still for a second, the sensor is learned with its trembling.
        """
        learned = self.idle.settle(t, raw, rests=rests, restless=restless)
        if learned is None:
            return False
        self.taxels.learn(learned.constant, fine=learned.fine)
        self.activity.unlearn()
        self.review()
        self.activity.learn((learned.frames - self.idle.counts) * self.weight)
        self.review()
        return True

    def untouched(self, look: Look, *, recovering: bool) -> None:
        """Let baseline and noise follow a frame without a touch. `recovering`: a contact has just ended."""
        idle, t = self.idle, look.t
        if idle.provisional or look.sunken:
            self.settle(t, look.raw)
        elif idle.settling.since is not None:
            idle.settling.clear()
        flickering = self.taxels.flickering
        if flickering.any or self.taxels.frozen.any:
            self._watch(look)
        since, idle.followed = idle.followed, t  # `since` is None after a contact or a silence
        if since is None:
            return
        self.activity.follow(t, since, look.activity)
        if not look.burst:  # a burst must not pull the baseline down
            above = np.where(flickering.mask, 0.0, look.above) if flickering.any else look.above
            idle.follow(t, since, above, recovering=recovering)
        if idle.follow_noise(t, look.above):
            self.review()

    def touched(self, look: Look) -> None:
        """The sensor is touched: the baseline stands still, and taxels that freeze or flicker are found."""
        self.idle.followed = None
        self._watch(look)

    @property
    def sound(self) -> bool:
        """Whether the idle sensor is known without doubt, nothing rests on it, and no taxel is bad."""
        idle, taxels = self.idle, self.taxels
        doubt = idle.provisional or idle.smallest or idle.bare is not None
        return not (doubt or taxels.count or taxels.frozen.any or taxels.flickering.any)

    def _watch(self, look: Look) -> None:
        taxels, idle = self.taxels, self.idle
        frozen = taxels.frozen.watch(look.t, look.raw, look.above, idle.sigma)
        if taxels.flickering.watch(look.t, look.above, idle.level, taxels.bad) or frozen:
            self.review()

    def review(self) -> None:
        """Weigh the taxels anew, from all that is known of them."""
        idle = self.idle
        self.taxels.review(idle.sigma, idle.level)
        self.activity.review()
        self.weight = self._weigh(idle.sigma, idle.level)

    def _weigh(self, sigma: Array, level: float) -> Array:
        """(N,) noise units of one count of each taxel, as `weigh` gives them; 0 if it is bad."""
        return self._good(weigh(sigma, level, self.activity.scale))


def weigh(sigma: Array, level: float | Array, scale: float | Array) -> Array:
    """(..., N) noise units of one count of each taxel, by its standard deviation and the sensor's `level` (counts)."""
    return np.asarray(1.0 / (scale * np.maximum(sigma, LEAST_SIGMA * level)))


def _shifted(scaled: Array, level: float) -> bool:
    """Whether many of (N,) taxels lie below the baseline by `level` noise units and by BELOW_SHARE of the highest."""
    below = scaled < -max(level, BELOW_SHARE * float(scaled.max()))
    return int(np.count_nonzero(below)) * SHIFTED_OF >= SHIFTED * scaled.size
