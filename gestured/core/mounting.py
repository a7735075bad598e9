"""How a sensor is mounted, so that `swipe_up` is up for the person in front of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Mounting:
    """How a sensor is mounted. A frame is inverted first, then mirrored left to right, then turned clockwise."""

    rotate: int = 0  # degrees clockwise: 0, 90, 180, 270
    mirror: bool = False
    invert: bool = False  # whether the sensor's counts fall under pressure

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
        """(..., R, C) as sent -> (..., R', C') as a person in front of the sensor sees it."""
        if self.invert:
            values = -values.astype(np.float64)
        if self.mirror:
            values = values[..., ::-1]
        return np.rot90(values, -(self.rotate // 90), axes=(-2, -1)) if self.rotate else values
