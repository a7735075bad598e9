"""What lies still on a sensor whose contact was given up, an arm or a finger that holds; and what moves beside it."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from gestured.core.spots import Spot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PART_S = 0.5  # of the time in which a taxel must not have changed
PARTS = 2  # such times, so a second
CHANGE = 0.35  # of a taxel's level: what changes by less trembles
RESTLESS = 8.0  # noise units: nor is that a change
LEFT = 0.9  # of the level at which it lay: below that a finger has left its place
BESIDE = 3.0  # pitches: what comes up so near to a finger that has left its place is that finger


class Lying:
    """One sensor of so many rows and columns since `t` s, when its contact was given up."""

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
