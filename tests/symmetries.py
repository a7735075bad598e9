"""What must not change when the input changes so, and what must change with it: the whole path, on simulated gestures.

In the front end the promise is exact: the same segments at the same frames, bit for bit, but for the change itself.
Where a learned net decides it is a share of labels.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from gestured.core.frames import Segment
from gestured.lab.stability.extremes import Array, Series

MIRRORED = {
    "swipe_left": "swipe_right",
    "swipe_right": "swipe_left",
    "circle_clockwise": "circle_counter_clockwise",
    "circle_counter_clockwise": "circle_clockwise",
}
TURNED = {
    "swipe_left": "swipe_right",
    "swipe_right": "swipe_left",
    "swipe_up": "swipe_down",
    "swipe_down": "swipe_up",
    "swipe_up_two_fingers": "swipe_down_two_fingers",
    "swipe_down_two_fingers": "swipe_up_two_fingers",
}
GRID_S = 1 / 4096  # times on it can be shifted without rounding


@dataclass(frozen=True, slots=True)
class Property:
    """A change of what comes in, and what it does to what goes out."""

    name: str
    times: Callable[[Array], Array] = field(default=lambda times: times)
    frames: Callable[[Array], Array] = field(default=lambda frames: frames)
    names: Mapping[str, str] = field(default_factory=dict)  # labels that become others
    picture: Callable[[Array], Array] = field(default=lambda frames: frames)  # the same change of counts above idle
    exact: bool = True  # in the front end
    rounded: bool = False  # whether a constant takes away a baseline's last digits: one step of float32 at the peak

    def apply(self, stream: Series) -> Series:
        """The stream as this property changes it."""
        return Series(self.times(stream.times), self.frames(stream.frames))

    def holds(self, before: list[Segment], after: list[Segment]) -> bool:
        """Whether the front end's segments are the same ones, changed."""
        return len(before) == len(after) and all(map(self._same, before, after))

    def _same(self, one: Segment, two: Segment) -> bool:
        return (
            (one.first, one.last) == (two.first, two.last)
            and np.array_equal(self.times(one.times), two.times)
            and self._same_frames(self.picture(one.frames), two.frames)
        )

    def _same_frames(self, one: Array, two: Array) -> bool:
        if not self.rounded:
            return np.array_equal(one, two)
        step = np.spacing(np.float32(np.abs(one).max()))
        return one.shape == two.shape and bool((np.abs(one - two) <= step).all())


def postponed(seconds: float) -> Property:
    """The property that all times are later by so many seconds."""
    return Property(f"{seconds:g} s later", times=lambda times: times + seconds)


def scaled(gain: float) -> Property:
    """All counts times `gain`; exact for powers of two."""
    return Property(
        f"gain {gain:g}",
        frames=lambda frames: frames * gain,
        picture=lambda frames: frames * np.float32(gain),
        exact=float(np.log2(gain)).is_integer(),
    )


def raised(counts: float) -> Property:
    """A constant added to all counts; exact, but for rounding, unless it is much larger than they are."""
    return Property(
        f"{counts:g} counts added", frames=lambda frames: frames + counts, exact=abs(counts) <= 1e4, rounded=True
    )


def _doubled(times: Array) -> Array:
    middle = times[:-1] + np.diff(times) / 2
    return np.append(np.stack([times[:-1], middle], axis=1).reshape(-1), times[-1])


def mirrored() -> Property:
    """Left and right swapped."""

    def flip(frames: Array) -> Array:
        return frames[..., ::-1]

    return Property("mirrored", frames=flip, picture=flip, names=MIRRORED)


def upside_down() -> Property:
    """Turned by 180 degrees."""

    def turn(frames: Array) -> Array:
        return frames[..., ::-1, ::-1]

    return Property("turned by 180 degrees", frames=turn, picture=turn, names=TURNED)


def doubled() -> Property:
    """Each frame sent twice, at twice the rate."""
    return Property(
        "each frame twice, twice the rate",
        times=_doubled,
        frames=lambda frames: np.repeat(frames, 2, axis=0)[:-1],
        exact=False,
    )


def on_grid(stream: Series) -> Series:
    """The same with times that can be shifted exactly."""
    times = np.rint(stream.times / GRID_S) * GRID_S
    keep = np.append(True, np.diff(times) > 0)
    return Series(times[keep], stream.frames[keep])


def renamed(found: tuple[str, ...], names: Mapping[str, str]) -> tuple[str, ...]:
    """Labels as they must be after the change."""
    return tuple(names.get(label, label) for label in found)
