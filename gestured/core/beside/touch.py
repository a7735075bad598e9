"""The fingers of the open contact: touch events that say where each finger is, from frame to frame, if asked for.

A touch event is no answer, and no answer depends on it. While a contact may become a gesture, all that presses is
followed. After it was given up (`held`), a finger that has stood still for a second gets an `up` with the reason
`learned`: from then on it is part of what lies there, and only what moves beside it is followed. If that finger moves
on, it comes down again.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, make_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.events import Place, Touch
from gestured.core.frames import SMALLEST
from gestured.core.front_end import FrontEnd
from gestured.core.spots import Spot, spots
from gestured.core.where import FINE, Zone, fractions, zone_at

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

EACH_S = 0.0166  # the time between a finger's moves, 60 a second: a little less than 1/60 s because times are rounded
GONE_S = 0.1  # a finger that was not seen for so long has left, as in `Timing.release_s`; at 15 Hz two frames
PART_S = 0.5  # the length of one of the PARTS in which the lowest and highest counts of taxels are kept
PARTS = 2  # a taxel that has not changed for so many parts, which is a second, lies still
CHANGE = 0.35  # of a taxel's level: a taxel that changes by less only trembles, and counts as lying still
RESTLESS = 8.0  # noise units: a taxel that changes by less counts as lying still
LEFT = 0.9  # of the level at which a finger lay: if its taxel shows less, the finger has left that place
BESIDE = 3.0  # taxel pitches: a touch that begins so near to a place that a finger has left is that finger

# A touch event while it is made, one for each frame: a frozen dataclass takes six times as long to make.
_Draft: Any = make_dataclass("_Draft", Touch.__slots__, slots=True)


class Lying:
    """What lies still on a sensor of R x C taxels, such as an arm or a finger that holds, and what moves beside it.

    It begins at `t` s, when a contact was given up.
    """

    def __init__(self, t: float, shape: tuple[int, int]) -> None:
        self._grid = np.indices(shape)
        self._image: Array = np.zeros(shape)  # counts of what lies still
        self._parts: deque[tuple[Array, Array]] = deque(maxlen=PARTS + 1)  # lowest and highest counts, latest last
        self._begun = t  # s, when the last part began
        self._fingers: list[tuple[tuple[int, int], float]] = []  # those that lie there: strongest taxel, its counts

    def moving(self, frame: Array, t: float, least: float) -> Array | None:
        """The counts of what moves in an (R, C) frame at `t` s; None if all are below `least`, or only tremble."""
        if not self._parts or t - self._begun >= PART_S:
            self._parts.append((frame, frame))
            self._begun = t
        low, high = self._parts[-1]
        self._parts[-1] = np.minimum(low, frame), np.maximum(high, frame)
        self._image = np.minimum(self._image, frame)  # what lies there may leave, or give way
        moving = frame - self._image
        row, column = divmod(int(moving.argmax()), frame.shape[1])
        around = self._image[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3].max()
        if moving[row, column] < max(least, CHANGE * around):
            return None
        for at, level in [one for one in self._fingers if frame[one[0]] < LEFT * one[1]]:
            if np.hypot(at[0] - row, at[1] - column) < BESIDE:
                self._fingers.remove((at, level))
                self._image[self._near(*at) | self._near(row, column)] = 0.0
                moving = frame - self._image
        return moving

    def learn(self, fingers: list[Spot], frame: Array, noise: float) -> list[Spot]:
        """Learn what has not changed for a second, unless a moving finger is near; returns the fingers learned."""
        if len(self._parts) <= PARTS:
            return []
        low = np.min([low for low, _ in self._parts], axis=0)
        high = np.max([high for _, high in self._parts], axis=0)
        still = high - low < np.maximum(CHANGE * high, RESTLESS * noise)
        lie = [one for one in fingers if still[_taxels(one)].all()]
        for one in fingers:
            if one in lie:
                at = round(one.row), round(one.column)
                self._fingers.append((at, float(frame[at])))
            else:
                still &= ~self._near(one.row, one.column)
        self._image = np.where(still, np.maximum(np.minimum(low, frame), 0.0), self._image)
        return lie

    def _near(self, row: float, column: float) -> Mask:
        return np.asarray(np.hypot(self._grid[0] - row, self._grid[1] - column) < BESIDE)


def _taxels(spot: Spot) -> tuple[slice, slice]:
    """The taxels of a finger: the one at its place, and those beside it."""
    row, column = round(spot.row), round(spot.column)
    return slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2)


@dataclass(slots=True, eq=False)
class Finger:
    """One finger as it was seen last."""

    spot: Spot
    t: float  # s
    told: Touch | None = None  # the last event of this finger


class Fingers:
    """The fingers of one sensor's open contact, and their touch events."""

    def __init__(self, sensor: str, zones: Mapping[str, Zone]) -> None:
        self._sensor, self.zones = sensor, zones
        self.asked = False  # whether somebody asks for touch events
        self.begin(0)

    def begin(self, number: int) -> None:
        """Begin another contact; `number` is its id."""
        self._id, self._count = number, 0
        self._fingers: list[Finger] = []
        self._looked = -math.inf  # s, the last frame that was looked at
        self._lying: Lying | None = None  # since the contact was given up
        self._baseline: Array | None = None  # (N,) counts, as it was before anything of the contact was learned
        self._fine = (
            1.0  # parts of a count to which pressure is rounded: a power of ten, to a hundredth of the noise or finer
        )

    def end(self, baseline: Array | None = None) -> list[Touch]:
        """End the contact: an `up` for each finger with an event. The new (N,) `baseline` shows which were learned."""
        fingers, self._fingers = [one for one in self._fingers if one.told], []
        if baseline is None or self._baseline is None or baseline is self._baseline:
            return [self._tell(one, "up") for one in fingers]
        learned = (baseline - self._baseline).reshape(self._shape)
        lie = [learned[round(one.spot.row), round(one.spot.column)] > one.spot.peak / 2 for one in fingers]
        return [self._tell(one, "up", "learned" if lies else None) for one, lies in zip(fingers, lie, strict=True)]

    def see(self, front_end: FrontEnd) -> list[Touch]:
        """The touch events of a front end's last frame, in which a contact goes on."""
        look, segmenter = front_end.look, front_end.segmenter
        if look is None or look.shifted:
            return []
        phase, lying = segmenter.phase, self._lying
        if self._baseline is None:
            self._baseline, self._shape = front_end.baseline, (front_end.rows, front_end.columns)
            self._fine = 10.0 ** max(2 - math.floor(math.log10(max(front_end.noise, SMALLEST))), 0)
        if lying is None and not phase.pending:
            self._lying = lying = Lying(look.t, self._shape)
        if look.t - self._looked < EACH_S:
            return []
        self._looked = look.t
        conditioner = front_end.conditioner
        taxels, noise = conditioner.taxels, conditioner.idle.level
        frame = taxels.bridge(look.above[None]).ravel()
        if lying is None:
            return self._follow([] if phase.let_go else spots(frame, self._shape, noise), look.t)
        frame = frame.reshape(self._shape)
        quiet = look.activity < segmenter.levels(look.t)[1]
        felt = lying.moving(frame, look.t, (segmenter.off if self._fingers else segmenter.on) * noise)
        told = self._follow([] if quiet or felt is None else spots(felt.ravel(), self._shape, noise), look.t)
        lie = lying.learn([one.spot for one in self._fingers], frame, noise)
        for one in [one for one in self._fingers if one.spot in lie]:
            self._fingers.remove(one)
            told += [self._tell(one, "up", "learned")] if one.told else []
        return told

    def _follow(self, found: list[Spot], t: float) -> list[Touch]:
        """The events of the fingers, after each spot that was `found` at `t` s is given to its finger."""
        if len(found) == 1 == len(self._fingers):  # nearly all frames
            one = self._fingers[0]
            one.spot, one.t = found[0], t
            return [self._tell(one)]
        told, left = [], list(self._fingers)
        for one, spot in _paired(left, found):
            left.remove(one)
            found.remove(spot)
            one.spot, one.t = spot, t
            told.append(self._tell(one))
        for one in left:
            if one.told is None or t - one.t >= GONE_S:
                self._fingers.remove(one)
                told += [self._tell(one, "up")] if one.told else []
        for spot in found:
            new = Finger(spot, t)
            self._fingers.append(new)
            if len(self._fingers) == 1:  # a second finger may be a flaw of one frame, so it waits for another
                told.append(self._tell(new))
        return told

    def _tell(self, one: Finger, phase: str = "move", reason: str | None = None) -> Touch:
        """The event of a finger now; its first one is `down`."""
        row, column, peak, area = one.spot
        x, y = fractions(*self._shape, row, column)
        if (last := one.told) is None:
            number, phase, dx, dy, zone = self._count, "down", 0.0, 0.0, zone_at(self.zones, Place(x, y))
            self._count += 1
        else:
            dx, dy = round((x - last.x) * FINE) / FINE, round((y - last.y) * FINE) / FINE
            number, zone = last.touch, last.zone
        pressure = round(peak * self._fine) / self._fine
        told: Touch = _Draft(self._sensor, self._id, number, phase, one.t, x, y, dx, dy, pressure, area, zone, reason)
        told.__class__ = Touch
        one.told = told
        return told


def _paired(fingers: list[Finger], found: list[Spot]) -> list[tuple[Finger, Spot]]:
    """The pairs of fingers and spots that most probably belong together, of at most two of each."""
    if len(fingers) == 2 and len(found) == 2:
        straight = _apart(fingers[0].spot, found[0]) + _apart(fingers[1].spot, found[1])
        crossed = _apart(fingers[0].spot, found[1]) + _apart(fingers[1].spot, found[0])
        return list(zip(fingers, found if straight <= crossed else found[::-1], strict=True))
    pairs = [(one, spot) for one in fingers for spot in found]
    return [min(pairs, key=lambda pair: _apart(pair[0].spot, pair[1]))] if pairs else []


def _apart(one: Spot, other: Spot) -> float:
    return math.hypot(one.row - other.row, one.column - other.column)
