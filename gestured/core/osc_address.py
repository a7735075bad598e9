"""The OSC addresses that sensors send to, and the names that a sensor can have in one."""

from collections.abc import Callable
from dataclasses import dataclass

MAX_NAME = 64
_NAME = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-")


def is_sensor(name: str) -> bool:
    """Whether `name` can be a sensor's: `[A-Za-z0-9_-]{1,64}`."""
    return 0 < len(name) <= MAX_NAME and _NAME.issuperset(name)


@dataclass(frozen=True, slots=True)
class Addresses:
    """The patterns of the addresses that sensors send to; `{sensor}` stands for the sensor's name.

    Raises ValueError naming the pattern.
    """

    pressure: str = "/{sensor}/pressure"
    trajectory: str = "/{sensor}/trajectory"

    def __post_init__(self) -> None:
        for key, pattern in (("pressure", self.pressure), ("trajectory", self.trajectory)):
            rest = pattern.replace("{sensor}", "", 1)
            if not pattern.startswith("/") or rest == pattern or not _plain(rest):
                raise ValueError(
                    f"{key}: expected an OSC address with one {{sensor}} and no wildcards, found {pattern!r}"
                )
        (before, after), (other_before, other_after) = (
            pattern.split("{sensor}") for pattern in (self.pressure, self.trajectory)
        )
        if _rest(before, other_before, str.removeprefix) and _rest(after, other_after, str.removesuffix):
            raise ValueError(f"trajectory: {self.trajectory!r} cannot be told from pressure {self.pressure!r}")

    def match(self, address: str) -> tuple[str, str] | None:
        """`("pressure" or "trajectory", sensor)`, or None for an address that is not ours."""
        for kind, pattern in (("pressure", self.pressure), ("trajectory", self.trajectory)):
            before, after = pattern.split("{sensor}")
            name = address[len(before) : len(address) - len(after)]
            if is_sensor(name) and address == before + name + after:
                return kind, name
        return None


def _plain(text: str) -> bool:
    return all("!" <= c <= "~" and c not in "#*,?[]{}" for c in text)


def _rest(a: str, b: str, cut: Callable[[str, str], str]) -> bool:
    """Whether one ends (or begins) with the other, and what is left could be part of a sensor's name."""
    short, long = sorted((a, b), key=len)
    rest = cut(long, short)
    return len(rest) == len(long) - len(short) and _NAME.issuperset(rest)
