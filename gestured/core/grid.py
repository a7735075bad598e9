"""ROWSxCOLUMNS: how a sensor's grid is written and read."""

from typing import NamedTuple

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
