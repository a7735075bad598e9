"""Addresses, grids and sensors' names as texts: HOST:PORT, ROWSxCOLUMNS, a name. This module needs no numpy."""

from typing import NamedTuple

SIDES = (2, 64)  # taxels: the least and the most that a side of a grid may have
NAME_CHARACTERS = 64  # the most that a sensor's name may have
NAME_LETTERS = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-")


def is_sensor(name: str) -> bool:
    """Whether `name` can be a sensor's: `[A-Za-z0-9_-]{1,64}`."""
    return 0 < len(name) <= NAME_CHARACTERS and NAME_LETTERS.issuperset(name)


class Address(NamedTuple):
    """A host (name or literal) and a port; port 0 means any free one. As a text an IPv6 literal stands in brackets."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @classmethod
    def parse(cls, text: str) -> "Address":
        """HOST:PORT or [HOST]:PORT. ValueError, which says what was expected, for anything else."""
        host, _, port = text.rpartition(":")
        bracketed = host.startswith("[") and host.endswith("]")
        name = host[1:-1] if bracketed else host
        wrong = set("[]/" if bracketed else "[]/:")
        if not name or any(c in wrong or c.isspace() for c in name) or not _is_port(port):
            raise ValueError("HOST:PORT with a port from 0 to 65535, such as 127.0.0.1:9000 or [::1]:9000")
        return cls(name, int(port))


def _is_port(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) <= 5 and int(text) < 65536


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
