"""From raw counts to counts above the baseline: mounting, baseline, noise, bad taxels.

Nothing here smooths over time: at 15 Hz a tap is one to three frames. The baseline is what a second
without movement shows (`Settling`), followed slowly while the sensor is idle. Both steps are exact for
any time between frames: `-expm1(-dt / tau)`, never `dt / tau`.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.settling import LEAST_STEP, Settling, median

Array = NDArray[np.float64]

BASELINE_TAU_S = 2.0
RECOVERY_TAU_S = 0.4  # just after a contact: textile comes back slowly, and what is left of it is no touch
NOISE_TAU_S = 30.0
UNSEEN_S = 4.0  # at most so much of what passed under a contact or in silence counts as seen in one look
REVIEW_S = 0.5  # noise moves slowly: it is looked at twice a second
NOISY = 8.0  # a taxel with more than this many times the sensor's noise is bad
FROZEN_S = 0.4  # a pressed taxel that does not change by its noise for so long is no finger
COMMON = 4.0  # noise units of what all taxels share that are taken off; a palm must not cancel itself
BLOB = (0.5, 1.0, 0.5)  # a fingertip over three taxels, in rows and in columns
BLOB_GAIN = sum(BLOB) ** 2 / sum(b * b for b in BLOB)  # of a level that all taxels share
LIVELY = 10  # frames from which one can tell that a sensor with noise never sends the same one again
STRIKES = 2  # gestures in which a taxel stood still while its neighbours were pressed


@dataclass(frozen=True, slots=True)
class Mounting:
    """How a sensor is mounted: first mirrored left to right, then turned clockwise. Applied to frames and touches."""

    rotate: int = 0  # degrees clockwise: 0, 90, 180, 270
    mirror: bool = False

    def __post_init__(self) -> None:
        if self.rotate not in (0, 90, 180, 270):
            raise ValueError(f"rotate: expected 0, 90, 180 or 270, found {self.rotate!r}")

    def shape(self, rows: int, columns: int) -> tuple[int, int]:
        """The grid (R, C) after mounting."""
        return (columns, rows) if self.rotate in (90, 270) else (rows, columns)

    def frame(self, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """(R, C) as sent -> (R', C') as a person in front of the sensor sees it."""
        if self.mirror:
            values = values[:, ::-1]
        return np.rot90(values, -(self.rotate // 90)) if self.rotate else values

    def point(self, x: float, y: float, rows: int, columns: int) -> tuple[float, float]:
        """The same for a touch: x to the right, y upward, in taxel pitches of a sensor of R x C taxels as sent."""
        if self.mirror:
            x = columns - 1 - x
        if self.rotate == 90:
            return y, columns - 1 - x
        if self.rotate == 180:
            return columns - 1 - x, rows - 1 - y
        if self.rotate == 270:
            return rows - 1 - y, x
        return x, y


class Inspection(NamedTuple):
    """Of one contact."""

    still: NDArray[np.bool_]  # (N,) taxels that did not change
    suspect: NDArray[np.bool_]  # (N,) those of them whose neighbours were pressed
    any_suspect: bool


class Conditioner:
    """Baseline, noise and bad taxels of one sensor. Taxels are flat here: (N,) with N = R * C after mounting."""

    def __init__(self, rows: int, columns: int) -> None:
        self.rows = rows
        self.columns = columns
        self.ready = False
        self._settling = Settling()
        self._provisional = False  # the baseline is doubtful: take the next stable second instead
        self.baseline: Array = np.zeros(rows * columns)  # (N,) counts; replaced, never changed in place
        self._sigma: Array = np.ones(rows * columns)
        self._weight: Array = np.ones(rows * columns)  # 1 / noise, 0 for bad taxels
        self._stuck = np.zeros(rows * columns, dtype=bool)
        self._frozen = np.zeros(rows * columns, dtype=bool)
        self._still_since = np.full(rows * columns, math.inf)  # s
        self._previous: Array = np.zeros(rows * columns)  # raw counts
        self._rail = -math.inf  # the largest raw count seen under a touch
        self._step = 0.0  # counts, one quantisation step: below it noise cannot be known
        self._unit = 0.0  # counts, the smallest change that a sensor has shown which stood still when it was learned
        self._shown: Array = np.zeros(rows * columns)  # raw counts of its last frame
        self.lively = False  # whether no frame of the idle sensor was the one before again
        self._fine = False  # whether a finger's tremble shows in the last digit
        self._strikes = np.zeros(rows * columns, dtype=np.int64)
        self._blameless = False  # whether no taxel has strikes or is stuck
        self.bad = np.zeros(rows * columns, dtype=bool)
        self.noise = 1.0  # counts, the median taxel's standard deviation
        self._tracked: float | None = None
        self._reviewed = 0.0
        self._down, self._across = _blob(rows), _blob(columns)
        self._typical = 0.88 * math.sqrt(2 * math.log(rows * columns))  # median activity of N normal deviates
        self._usual = self._typical  # idle activity, as it is
        self._scale = 1.0  # by which single taxels' noise understates the idle activity

    def reset(self, *, keep: bool = False) -> None:
        """Forget the baseline: the next stable second is a new one. `keep`: what `settle` was offered counts for it."""
        self.ready = False
        self._provisional = False
        self._tracked = None
        if not keep:
            self._settling.clear()

    def doubt(self) -> None:
        """After a silence: go on with the baseline, but replace it by the next stable second."""
        self._provisional = True
        self._tracked = None

    def deviation(self, raw: Array) -> tuple[Array, float, float]:
        """(N,) raw counts -> (N,) counts above the baseline; activity and the lowest taxel in units of noise."""
        if self._unit > 0:
            self._learn_unit(raw)
        d = raw - self.baseline
        return d, *self.activity(d * self._weight)

    def activity(self, scaled: Array) -> tuple[float, float]:
        """Strongest spot (a taxel alone, or with its neighbours) and lowest taxel of (N,) deviations in units of noise.

        A finger between taxels gives each of them half of what it gives; weighing the neighbours in (the matched
        filter of a blob, normalised to the same noise) finds it all the same. What all taxels share is no finger.
        """
        # Every frame passes here. At this size one sort is cheaper than a minimum, a middle and a maximum, `dot` than
        # `@`, and `argmax` than `max`.
        ordered = scaled.copy()
        ordered.sort()
        spots = self._down.dot(scaled.reshape(self.rows, self.columns)).dot(self._across)
        strongest = spots.item(spots.argmax())
        common = min(max(ordered.item(ordered.size // 2), -COMMON), COMMON)
        return max(ordered.item(-1) - common, strongest - common * BLOB_GAIN), ordered.item(0)

    def place(self, d: Array) -> tuple[float, float]:
        """Centroid (row, column) of what clearly rises above baseline and noise, bad taxels left out."""
        pressed = np.where(self._weight > 0, d, 0.0)
        top = float(pressed.max())
        cut = 0.3 * top if 3.5 * self.noise >= top else max(0.3 * top, 3.5 * self.noise)
        grid = np.maximum(pressed - cut, 0.0).reshape(self.rows, self.columns)
        total = float(grid.sum())
        if not total > 0:
            return (self.rows - 1) / 2, (self.columns - 1) / 2
        return (
            float(grid.sum(axis=1) @ np.arange(self.rows)) / total,
            float(grid.sum(axis=0) @ np.arange(self.columns)) / total,
        )

    def settle(self, t: float, raw: Array) -> bool:
        """Offer a frame that may be idle; true when the baseline was learned from the second that ends here."""
        learned = self._settling.push(t, raw, patience=not self.ready)
        if learned is None:
            return False
        self.baseline, self._sigma, self._stuck = learned.baseline, learned.noise, learned.constant
        self._blameless = False
        self._fine, self._step = learned.fine, learned.step
        self.lively = len(learned.frames) >= LIVELY and bool(np.diff(learned.frames, axis=0).any(axis=1).all())
        self._unit, self._shown = math.inf if learned.still else 0.0, raw
        self._frozen[:] = False
        self._provisional = not learned.stable
        self.ready = True
        self._tracked = self._reviewed = t
        self._scale, self._usual = 1.0, 0.0
        self._review()
        scaled = (learned.frames - self.baseline) * self._weight
        self._usual = float(median(np.array([self.activity(row)[0] for row in scaled])))
        self._review()
        return True

    def shifted(self, d: Array, level: float) -> bool:
        """Many taxels lower than `level` times their noise below the baseline, and than what is pressed is above it.

        No touch does that: the sensor restarted, or a hand that lay there when the baseline was learned has left.
        """
        scaled = d * self._weight
        below = scaled < -max(level, 0.3 * float(scaled.max()))
        return int(np.count_nonzero(below)) * 20 >= 3 * d.size

    def idle(
        self, t: float, raw: Array, d: Array, activity: float, *, sunken: bool, burst: bool, recovering: bool
    ) -> None:
        """Follow the idle sensor: baseline with `BASELINE_TAU_S` (`RECOVERY_TAU_S`), noise with `NOISE_TAU_S`.

        `sunken`: some taxel lies clearly below its baseline, as after a hand that rested there when it was learned.
        `burst`: deeper than textile swings after a contact; one such reading must not pull the baseline down.
        """
        if self._provisional or sunken:
            self.settle(t, raw)
        elif self._settling.started:
            self._settling.clear()
        if np.count_nonzero(self._frozen):
            self._freeze(t, raw, d)
        if self._tracked is not None:
            self._reviewed = max(self._reviewed, t - UNSEEN_S)
            tau = RECOVERY_TAU_S if recovering else BASELINE_TAU_S
            self._usual += (min(activity, 2 * self._typical) * self._scale - self._usual) * -math.expm1(
                (self._tracked - t) / NOISE_TAU_S
            )
            if not burst:
                self.baseline = self.baseline + d * -math.expm1((self._tracked - t) / tau)
            if t - self._reviewed >= REVIEW_S:
                seen = np.minimum(np.abs(d), 4 * self._sigma) * 1.2533
                sigma = self._sigma + (seen - self._sigma) * -math.expm1((self._reviewed - t) / NOISE_TAU_S)
                self._sigma = np.maximum(sigma, self._step / 2)  # what shows no noise may have some all the same
                self._reviewed = t
                self._review()
        self._tracked = t

    def busy(self, t: float, raw: Array, d: Array) -> None:
        """The sensor is touched: the baseline stands still, and taxels that froze in mid-air are found."""
        self._tracked = None
        if self._settling.started:
            self._settling.clear()
        self._freeze(t, raw, d)

    def _freeze(self, t: float, raw: Array, d: Array) -> None:
        """A finger trembles; what stays pressed to the last digit, below the sensor's limit, is a fault."""
        changed = raw != self._previous
        self._previous = raw
        self._still_since = np.where(changed, t, np.minimum(self._still_since, t))
        if not self._fine:
            return
        self._rail = max(self._rail, float(raw.max()))
        frozen = (t - self._still_since >= FROZEN_S) & (d > 3 * self._sigma) & (raw < self._rail)
        if (frozen != self._frozen).any():
            self._frozen = frozen
            self._review()

    def inspect(self, frames: Array) -> Inspection:
        """Look at a contact (T, N), not yet bridged."""
        if len(frames) < 2:
            return Inspection(np.ones(frames.shape[1], dtype=bool), np.zeros(frames.shape[1], dtype=bool), False)
        peaks = frames.max(axis=0)
        around = _neighbour_mean(peaks.reshape(self.rows, self.columns), np.ones((self.rows, self.columns), dtype=bool))
        still = np.ptp(frames, axis=0) == 0
        suspect = still & (around.ravel() > max(0.4 * float(peaks.max()), 8 * self.noise))
        return Inspection(still, suspect, bool(suspect.any()))

    def judge(self, seen: Inspection) -> None:
        """The contact that was inspected is over: a taxel that stood still under pressure, twice, is stuck."""
        if self._blameless and not seen.any_suspect:
            return
        self._strikes[seen.suspect] += 1
        self._strikes[~seen.still] = 0
        stuck = (self._stuck & seen.still) | (self._strikes >= STRIKES)
        self._blameless = not (stuck.any() or self._strikes.any())
        if (stuck != self._stuck).any():
            self._stuck = stuck
            self._review()

    def bridge(self, frames: Array) -> Array:
        """(T, N) -> (T, R, C) with the bad taxels replaced by what their good neighbours show."""
        grid = frames.reshape(-1, self.rows, self.columns)
        good = ~self.bad.reshape(self.rows, self.columns)
        if good.all() or not good.any():
            return grid
        grid = np.where(good, grid, 0.0)
        while not good.all():
            around = _neighbour_mean(grid, good)
            fill = ~good & (_neighbour_mean(good.astype(float), np.ones_like(good)) > 0)
            grid = np.where(fill, around, grid)
            good = good | fill
        return grid

    def _learn_unit(self, raw: Array) -> None:
        """What has stood still tells its step when it moves. Whole numbers count in ones, as `quantum` has it."""
        changed = raw[raw != self._shown] - self._shown[raw != self._shown]
        self._shown = raw
        if not changed.size or np.array_equal(raw, np.rint(raw)):
            return
        unit = max(float(np.abs(changed).min()), 1e-6 * float(np.abs(raw).max()), LEAST_STEP)
        if unit < self._unit:
            self._unit = self._step = unit
            self._sigma = np.full_like(self._sigma, unit)
            self._review()

    def _review(self) -> None:
        """Weights, the sensor's noise and its bad taxels from what is known of each taxel."""
        self.noise = float(median(self._sigma))
        self.bad = self._stuck | self._frozen | (self._sigma > NOISY * self.noise)
        if self.bad.all():
            self.bad = np.zeros_like(self.bad)
        # Clipping, hum and bursts make idle maxima larger than normal deviates': activity is told in what is usual.
        self._scale = min(max(self._usual / self._typical, 1.0), 5.0)
        self._weight = np.where(self.bad, 0.0, 1.0 / (self._scale * np.maximum(self._sigma, 0.2 * self.noise)))


def _blob(size: int) -> Array:
    """(size, size) banded weights of `BLOB`, normalised so that white noise keeps its size."""
    side, middle, _ = BLOB
    band = middle * np.eye(size) + side * (np.eye(size, k=1) + np.eye(size, k=-1))
    return np.asarray(band / math.sqrt(sum(b * b for b in BLOB)))


def _neighbour_mean(grid: NDArray[np.floating], good: NDArray[np.bool_]) -> Array:
    """(..., R, C) -> mean over the good ones of the eight neighbours, nearer ones counting double; 0 without any."""
    pad = [(0, 0)] * (grid.ndim - 2) + [(1, 1), (1, 1)]
    values = np.pad(np.where(good, grid, 0.0), pad)
    weight = np.pad(good.astype(float), 1)
    rows, columns = good.shape
    total = np.zeros(grid.shape)
    count = np.zeros(good.shape)
    for i in range(3):
        for j in range(3):
            if (i, j) != (1, 1):
                share = 2.0 if 1 in (i, j) else 1.0
                total += share * values[..., i : i + rows, j : j + columns]
                count += share * weight[i : i + rows, j : j + columns]
    return total / np.maximum(count, 1e-9)
