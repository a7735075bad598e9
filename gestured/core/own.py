"""Gestures of the user's own: their examples, and the JSON values in which they are stored.

An example is kept as the window of the model that was there at its enrolment: regridded, retimed and normalised. So
any model can make its own embedding of it.
"""

import base64
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.address import SIDES
from gestured.core.frames import Segment
from gestured.core.quantiles import median
from gestured.core.timing import RANGE_HZ
from gestured.core.window import LEAST_PEAK, Window

LETTERS = "abcdefghijklmnopqrstuvwxyz"
LONGEST_NAME = 32  # characters
RESERVED = ("use", "unknown", "none")  # words that configuration, answers and recordings use
A_NAME = f"a-z, then a-z, 0-9 and _, at most {LONGEST_NAME}, and none of {', '.join(RESERVED)}"  # as `is_name` has it
MOST = 20  # the most gestures of the user's own
EXAMPLES = 5  # the most examples of one gesture
MOST_FRAMES = 200  # the most of an example; the longest contact takes some 80 at 15 Hz
MOST_S = 8.0  # the longest example; a contact is given up after five seconds, and has quiet frames around it
MOST_VALUES = 16_384  # the most of an example


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Example:
    """One performance, as a window. Raises ValueError, which names the field, for values that no performance has."""

    frames: NDArray[np.float16]  # (T, R, C), 1 at its peak
    rate_hz: float
    first: int  # index of the first touched frame
    last: int  # index of the last touched frame
    noise: float  # of an idle taxel, one standard deviation, in units of the peak

    def __post_init__(self) -> None:
        count, rows, columns = self.frames.shape
        for name, value, least, most in (
            ("rate_hz", self.rate_hz, *RANGE_HZ),
            ("frames", count, 1, min(MOST_FRAMES, MOST_S * self.rate_hz)),
            ("rows", rows, *SIDES),
            ("columns", columns, *SIDES),
            ("values", self.frames.size, 1, MOST_VALUES),
            ("first", self.first, 0, count - 1),
            ("last", self.last, self.first, count - 1),
            ("noise", self.noise, 0, 1),
            ("lowest value", float(self.frames.min(initial=0.0)), 0, 1),
            ("highest value", float(self.frames.max(initial=0.0)), 0, 1),
        ):
            if not least <= value <= most:  # NaN is in no range
                raise ValueError(f"{name}: expected {least:g} to {most:g}, found {value!r:.40}")

    @classmethod
    def of(cls, segment: Segment, window: Window) -> "Example | None":
        """The example of a segment, as a model's window; None for a segment that is too long, or not finite."""
        frames = window.apply(segment)
        if not len(frames):
            return None
        usual = float(median(np.diff(segment.times))) if len(segment.times) > 1 else math.inf
        rate_hz = 1.0 / usual if window.keeps(usual) else window.rate_hz
        start = float(segment.times[window.span(segment)[0]])  # s, the window's first frame
        first, last = (
            min(max(round((t - start) * rate_hz), 0), len(frames) - 1) for t in (segment.onset, segment.offset)
        )
        peak = max(float(segment.frames.max()), window.floor * segment.noise, LEAST_PEAK)
        try:
            return cls(frames.astype(np.float16), rate_hz, first, last, min(segment.noise / peak, 1.0))
        except ValueError:
            return None

    def segment(self) -> Segment:
        """The example as a segment, which a model can classify."""
        times = np.arange(len(self.frames)) / self.rate_hz
        return Segment(self.frames.astype(np.float32), times, self.first, self.last, self.noise)


Examples = Mapping[str, tuple[Example, ...]]  # by the gesture's name


def to_dict(gestures: Examples) -> dict[str, Any]:
    """Gestures and their examples as JSON values."""
    return {
        name: [
            {
                "shape": list(one.frames.shape),
                "rate_hz": one.rate_hz,
                "first": one.first,
                "last": one.last,
                "noise": round(one.noise, 6),
                "frames": base64.b64encode(np.ascontiguousarray(one.frames, "<f2").tobytes()).decode(),
            }
            for one in examples
        ]
        for name, examples in gestures.items()
    }


def from_dict(told: object) -> Examples:
    """The gestures that `to_dict` gave. Raises ValueError, which names the place and says what was expected."""
    if not isinstance(told, dict) or len(told) > MOST:
        raise ValueError(f"gestures: expected an object of at most {MOST} gestures")
    found: dict[str, tuple[Example, ...]] = {}
    for name, examples in told.items():
        if not is_name(name):
            raise ValueError(f"gestures: {name[:40]!r} is no name of a gesture, expected {A_NAME}")
        if not isinstance(examples, list) or not 1 <= len(examples) <= EXAMPLES:
            raise ValueError(f"gestures.{name}: expected a list of 1 to {EXAMPLES} examples")
        found[name] = tuple(_example(one, f"gestures.{name}[{k}]") for k, one in enumerate(examples))
    return found


def is_name(name: str) -> bool:
    """Whether a gesture of the user's own may have that name."""
    plain = set(name) <= set(LETTERS + "0123456789_") and 0 < len(name) <= LONGEST_NAME
    return plain and name[0] in LETTERS and name not in RESERVED


def _example(told: Any, place: str) -> Example:
    try:
        frames = np.frombuffer(base64.b64decode(told["frames"], validate=True), "<f2").astype(np.float16)
        rows, columns = told["shape"][1:]
        frames = frames.reshape(told["shape"][0], rows, columns)
        numbers = float(told["rate_hz"]), int(told["first"]), int(told["last"]), float(told["noise"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(f"{place}: expected shape, rate_hz, first, last, noise and frames of an example") from None
    try:
        return Example(frames, *numbers)
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None
