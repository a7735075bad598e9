"""The fingers of the contact that goes on: where each is, from frame to frame, for whoever asks to follow them.

A touch event is no answer, and nothing that decides an answer reads what is written here. While a contact may become a
gesture, all that presses is followed. Once it was given up (`held`), a finger that has stood still for a second is told
to be up with the reason `learned`: from then on it is part of what lies there, and what moves beside it is followed. A
finger that was learned and moves on comes down again.
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

EACH_S = 0.0166  # from one move of a finger to the next: 60 a second, a little less than 1/60 because times are rounded
GONE_S = 0.1  # a finger that was not seen for so long has left, as in `Timing.release_s`; at 15 Hz two frames
PART_S = 0.5  # s, the length of one part of the time in which a taxel must not have changed
PARTS = 2  # parts of PART_S: a taxel that has not changed for a second lies still
CHANGE = 0.35  # of a taxel's level: a taxel that changes by less trembles, and lies still all the same
RESTLESS = 8.0  # noise units: a taxel that changes by less than that lies still, too
LEFT = 0.9  # of the level at which a finger lay: where its taxel shows less, the finger has left that place
BESIDE = 3.0  # taxel pitches: a touch that begins so near to a place that a finger has left is that finger

# A touch event before it is told: one is made of each frame, and a frozen dataclass takes six times as long to make.
_Draft: Any = make_dataclass("_Draft", Touch.__slots__, slots=True)


class Lying:
    """What lies still on a sensor of so many rows and columns, and what moves beside it.

    It begins at `t` s, when a contact was given up: an arm, or a finger that holds.
    """

    def __init__(self, t: float, shape: tuple[int, int]) -> None:
        self._grid = np.indices(shape)
        self._image: Array = np.zeros(shape)  # counts of what lies still
        self._parts: deque[tuple[Array, Array]] = deque(maxlen=PARTS + 1)  # lowest and highest counts, latest last
        self._begun = t  # s, when the last part began
        self._fingers: list[tuple[tuple[int, int], float]] = []  # those that lie there: strongest taxel, and its counts

    def moving(self, frame: Array, t: float, least: float) -> Array | None:
        """What moves in (R, C) counts at `t` s, in counts; None where that is hardly more than `least`."""
        if not self._parts or t - self._begun >= PART_S:
            self._parts.append((frame, frame))
            self._begun = t
        low, high = self._parts[-1]
        self._parts[-1] = np.minimum(low, frame), np.maximum(high, frame)
        self._image = np.minimum(self._image, frame)  # it may leave, or give way
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
        """Learn what has not changed for a second, unless a moving finger is near; returns the fingers among it."""
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
    """A finger's place and the taxels beside it."""
    row, column = round(spot.row), round(spot.column)
    return slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2)


@dataclass(slots=True, eq=False)
class Finger:
    """One finger as it was seen last."""

    spot: Spot
    t: float  # s
    told: Touch | None = None  # what was told of it last


class Fingers:
    """The fingers of one sensor's contact, and what is told of them."""

    def __init__(self, sensor: str, zones: Mapping[str, Zone]) -> None:
        self._sensor, self.zones = sensor, zones
        self.asked = False  # whether somebody follows them
        self.begin(0)

    def begin(self, number: int) -> None:
        """Another contact begins; `number` is its id."""
        self._id, self._count = number, 0
        self._fingers: list[Finger] = []
        self._looked = -math.inf  # s, the last frame that was looked at
        self._lying: Lying | None = None  # since the contact was given up
        self._baseline: Array | None = None  # (N,) counts, as it was before anything of the contact was learned
        self._fine = (
            1.0  # parts of a count to which pressure is told, a power of ten: a hundredth of the noise, or less
        )

    def end(self, baseline: Array | None = None) -> list[Touch]:
        """The contact is over: `up` for each finger that was told of. The (N,) `baseline` shows which were learned."""
        fingers, self._fingers = [one for one in self._fingers if one.told], []
        if baseline is None or self._baseline is None or baseline is self._baseline:
            return [self._tell(one, "up") for one in fingers]
        learned = (baseline - self._baseline).reshape(self._shape)
        lie = [learned[round(one.spot.row), round(one.spot.column)] > one.spot.peak / 2 for one in fingers]
        return [self._tell(one, "up", "learned" if lies else None) for one, lies in zip(fingers, lie, strict=True)]

    def see(self, front_end: FrontEnd) -> list[Touch]:
        """The last frame of a front end, in which a contact goes on."""
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
        frame = taxels.bridge(look.above[None]).ravel() if taxels.count else look.above
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
        """Which finger is which, and what became of each."""
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
            if len(self._fingers) == 1:  # a second one may be a flaw of one frame
                told.append(self._tell(new))
        return told

    def _tell(self, one: Finger, phase: str = "move", reason: str | None = None) -> Touch:
        """What is told of a finger now; at first that it is down."""
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
    """The fingers with the spots that they most probably are now; at most two of each."""
    if len(fingers) == 2 and len(found) == 2:
        straight = _apart(fingers[0].spot, found[0]) + _apart(fingers[1].spot, found[1])
        crossed = _apart(fingers[0].spot, found[1]) + _apart(fingers[1].spot, found[0])
        return list(zip(fingers, found if straight <= crossed else found[::-1], strict=True))
    pairs = [(one, spot) for one in fingers for spot in found]
    return [min(pairs, key=lambda pair: _apart(pair[0].spot, pair[1]))] if pairs else []


def _apart(one: Spot, other: Spot) -> float:
    return math.hypot(one.row - other.row, one.column - other.column)
