"""Readings: the state of a sensor for status, metrics and views; and its vitals, such as jitter, over time."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.events import Gate
from gestured.core.frames import SMALLEST
from gestured.core.front_end import FrontEnd
from gestured.core.quantiles import median
from gestured.core.where import digits

# The states of a sensor, from good to bad.
STATES = ("ok", "starting", "degraded", "intermittent", "inverted", "stale", "no_data", "faulty")
SILENT = ("no_data", "stale")  # states of sensors that are not there now
SHORT_S = 5.0  # a shorter stretch of frames between two silences may hold only a few gestures
STRETCHES = 3  # after so many short stretches in a row a sensor is said to send only while it is touched
FAULTY = 0.25  # of the taxels: if more are bad, what is bridged between them is guesswork
LOUD = 10.0  # times the least noise that the sensor has had: with as much noise, touches are missed
WEIGHT = 1 / 16  # weight of the newest interval in the jitter (RFC 3550, 6.4.1)


@dataclass(frozen=True, slots=True)
class Reading:
    """One sensor at a moment; if it was never heard, all but state, grid and gate are 0 or None.

    `state`: "no_data" (in the configuration, never heard), "starting", "ok", "degraded" (`reason` says why), "faulty"
    (too many taxels are bad), "intermittent" (it falls silent between touches), "inverted" (its counts fall when it is
    touched) or "stale" (heard, but not now).
    """

    state: str
    grid: tuple[int, int]  # as it is sent
    interval_s: float = 0.0  # from frame to frame as they came; 0 before it is known
    jitter_s: float = 0.0
    bad_taxels: int = 0
    noise: float = 0.0  # counts
    gate: Gate | None = None  # what it listens to
    source: tuple[str, int] | None = None
    heard: float = 0.0  # s, on the hub's clock
    lost: int = 0  # frames that went missing
    lost_at: float | None = None  # s, on the hub's clock: when the last of them went missing
    exchanged: bool = False  # whether contacts look like a finger only with rows and columns exchanged
    touched: bool = False
    contact: int | None = None  # id of the contact that was not released yet
    sequence: int = 0  # of its last gesture
    segments: int = 0  # number of segments so far, which is the id of the last one
    first: NDArray[np.float64] | None = None  # (N,) counts: the first baseline that was learned
    baseline: NDArray[np.float64] | None = None  # (N,) counts: the baseline now
    reason: str = ""  # of "starting" and "degraded", in a sentence: what is wrong, or what the sensor waits for

    @property
    def rate_hz(self) -> float:
        """Frames a second; 0 before the rate is known, and while the sensor is silent."""
        return 1.0 / self.interval_s if self.interval_s > 0 and self.state not in SILENT else 0.0

    @property
    def drift(self) -> float:
        """The median of the taxels' distances from the first baseline, in units of noise."""
        if self.first is None or self.baseline is None or self.first.shape != self.baseline.shape:
            return 0.0
        return float(median(np.abs(self.baseline - self.first))) / max(self.noise, SMALLEST)


class Vitals:
    """Jitter, silences and first baseline of one sensor."""

    def __init__(self) -> None:
        self.jitter_s = 0.0
        self.interval_s = 0.0  # from frame to frame, as of the last tick; 0 before it is known
        self.first: NDArray[np.float64] | None = None  # (N,) counts
        self._quietest = np.inf  # counts: the least noise so far
        self.last: float | None = None  # s, when frames came last
        # Of the frames that arrived at `last`: the jitter before them, the pause before them in s (infinite if not
        # known), and how many they are so far.
        self.together = 0.0, math.inf, 0
        self._began = 0.0  # s, the first frame after the last silence
        self.stretches = 0  # stretches in a row that were shorter than SHORT_S

    @property
    def intermittent(self) -> bool:
        """Whether the sensor falls silent again and again, after a few seconds each time."""
        return self.stretches >= STRETCHES and (self.last is None or self.last - self._began < SHORT_S)

    def arrived(self, now: float, frames: int, *, missed: bool) -> None:
        """Take note of `frames` that came together at `now` s, and update the jitter as RTP does (RFC 3550, 6.4.1).

        `missed`: this machine may have had no room for frames before these. Then the silence before them need not be
        the sensor's own, and short stretches are counted anew.
        """
        if missed:
            self.stretches = 0
        if self.last is None:
            self._began = now
        if now != self.last:
            self.together = self.jitter_s, math.inf if self.last is None else now - self.last, 0
        before, pause, came = self.together
        self.together = before, pause, came + frames
        if pause < math.inf and self.interval_s > 0:
            self.jitter_s = before + (abs(pause - (came + frames) * self.interval_s) - before) * WEIGHT
        self.last = now

    def review(self, front_end: FrontEnd) -> None:
        """Keep the first baseline, the least noise and the interval; called with each tick, not with each frame."""
        self.interval_s = front_end.pace.interval_s
        if self.first is None and front_end.ready:
            self.first = front_end.baseline
        if front_end.conditioner.idle.lively:  # the noise of other sensors is a guess
            self._quietest = min(self._quietest, front_end.noise)

    def silent(self) -> None:
        """The sensor has fallen silent: the next interval says nothing of its jitter."""
        if self.last is not None:
            self.stretches = self.stretches + 1 if self.last - self._began < SHORT_S else 0
        self.last = None

    def restart(self) -> None:
        """Forget the first baseline and the least noise: the sensor is learned anew."""
        self.first, self._quietest = None, np.inf

    def condition(self, front_end: FrontEnd, *, inverted: bool) -> tuple[str, str]:
        """The state of a sensor that is not silent, and the reason if it is "starting" or "degraded"; see `Reading`."""
        conditioner, phase = front_end.conditioner, front_end.segmenter.phase
        if not front_end.ready or conditioner.idle.doubtful:
            return "starting", "it is being learned, and waits for a second in which nothing moves on it"
        if inverted:
            return "inverted", ""
        if front_end.bad_taxels > FAULTY * front_end.rows * front_end.columns:
            return "faulty", ""
        if phase.touched and conditioner.taxels.flickering.rubbish:
            return "degraded", "taxels jump from frame to frame, and it waits until they calm down"
        if phase.touched and not phase.pending:
            return "degraded", "it was pressed for 5 s, and waits to be let go, or for a second in which nothing moves"
        if front_end.noise >= LOUD * self._quietest:
            louder = front_end.noise / self._quietest
            return "degraded", f"its noise is {louder:.0f} times what it was, and only stronger touches count"
        if front_end.bad_taxels:
            return "degraded", f"bad taxels are bridged: {front_end.bad_taxels}"
        return "ok", ""


def view_of(front_end: FrontEnd, *, raw: bool) -> dict[str, Any] | None:
    """The last frame and what the segmenter makes of it, as JSON values; None before the first frame.

    Grids are row by row and as mounted, but `raw` is as sent. `values` are counts above the baseline with bad taxels
    bridged, None before it is learned. Activity is in noise units; the centroid (row, column) is None without a touch.
    """
    shown, look, t = front_end.last_sent, front_end.look, front_end.pace.last
    if shown is None or t is None:
        return None
    conditioner, segmenter = front_end.conditioner, front_end.segmenter
    values = bad = centroid = None
    on, off = segmenter.levels(t)
    decimals = max(2, 1 - math.floor(math.log10(max(front_end.noise, SMALLEST))))
    if look is not None:
        values, bad = conditioner.taxels.bridge(look.above[None])[0], conditioner.taxels.bad
        centroid = conditioner.place(look) if look.activity >= off else None
    return {
        "t": t,
        "grid": list(front_end.grid_sent if values is None else values.shape),
        "values": None if values is None else _rounded(values, decimals),
        "bad": [] if bad is None else np.flatnonzero(bad).tolist(),
        "raw_grid": list(front_end.grid_sent),
        "raw": _rounded(shown, decimals) if raw else None,
        "noise": digits(front_end.noise),
        "activity": 0.0 if look is None else round(look.activity, 2),
        "on": round(on, 2),
        "off": round(off, 2),
        "phase": segmenter.phase.name,
        "centroid": None if centroid is None else [round(place, 3) for place in centroid],
    }


def _rounded(grid: NDArray[Any], decimals: int) -> list[float]:
    numbers: list[float] = np.round(grid.astype(np.float64), decimals).reshape(-1).tolist()
    return numbers
