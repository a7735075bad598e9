"""How a sensor is built and mounted: its grid, and what makes `swipe_up` up for the person in front of it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SIDES = (2, 64)  # taxels of a grid's side, least and most


class Grid(NamedTuple):
    """Rows and columns of a sensor's frames as they are sent, before rotation."""

    rows: int
    columns: int

    def __str__(self) -> str:
        return f"{self.rows}x{self.columns}"

    @classmethod
    def parse(cls, text: str) -> "Grid":
        """ROWSxCOLUMNS. ValueError, which says what was expected, for anything else."""
        rows, _, columns = text.partition("x")
        sides = [int(side) if side.isascii() and side.isdecimal() and len(side) <= 3 else 0 for side in (rows, columns)]
        if not all(SIDES[0] <= side <= SIDES[1] for side in sides):
            raise ValueError(f"ROWSxCOLUMNS, each from {SIDES[0]} to {SIDES[1]}, such as 9x9 or 27x15")
        return cls(*sides)


@dataclass(frozen=True, slots=True)
class Mounting:
    """How a sensor is mounted: first mirrored left to right, then turned clockwise."""

    rotate: int = 0  # degrees clockwise: 0, 90, 180, 270
    mirror: bool = False
    invert: bool = False  # its counts fall under pressure

    def __post_init__(self) -> None:
        if self.rotate not in (0, 90, 180, 270):
            raise ValueError(f"rotate: expected 0, 90, 180 or 270, found {self.rotate!r}")
        for name, value in (("mirror", self.mirror), ("invert", self.invert)):
            if value not in (True, False):
                raise ValueError(f"{name}: expected true or false, found {value!r}")

    def shape(self, rows: int, columns: int) -> tuple[int, int]:
        """The grid (R, C) after mounting."""
        return (columns, rows) if self.rotate in (90, 270) else (rows, columns)

    def frame(self, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """(R, C) as sent -> (R', C') as a person in front of the sensor sees it."""
        if self.invert:
            values = -values.astype(np.float64)
        if self.mirror:
            values = values[:, ::-1]
        return np.rot90(values, -(self.rotate // 90)) if self.rotate else values
