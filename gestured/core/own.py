"""Gestures of the user's own: their examples, and how they are written down.

An example is kept as a window, so that any model can make its own embedding of it: regridded, retimed and normalised as
the model that was there when it was enrolled had it.
"""

import base64
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Segment
from gestured.core.prototypes import EXAMPLES
from gestured.core.window import LEAST_PEAK, Window

LETTERS = "abcdefghijklmnopqrstuvwxyz"
LONGEST_NAME = 32  # characters
RESERVED = ("use", "unknown", "none")  # of the configuration, of answers, and of recordings
MOST = 20  # gestures
MOST_FRAMES = 200  # of an example; the longest contact takes some 80 at 15 Hz
MOST_VALUES = 16_384  # of an example


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """One performance, as a window."""

    frames: NDArray[np.float16]  # (T, R, C), 1 at its peak
    rate_hz: float
    first: int  # the first touched frame,
    last: int  # and the last
    noise: float  # of an idle taxel, one standard deviation, in units of the peak

    @classmethod
    def of(cls, segment: Segment, window: Window) -> "Example | None":
        """A segment as a model's window; None for one that is too long, or not finite."""
        frames = window.apply(segment)
        if not (0 < len(frames) <= MOST_FRAMES and frames.size <= MOST_VALUES and np.isfinite(frames).all()):
            return None
        start = float(segment.times[window.span(segment)[0]])  # s, the window's first frame
        first, last = (
            min(max(round((t - start) * window.rate_hz), 0), len(frames) - 1) for t in (segment.onset, segment.offset)
        )
        peak = max(float(segment.frames.max()), window.floor * segment.noise, LEAST_PEAK)
        return cls(frames.astype(np.float16), window.rate_hz, first, last, min(segment.noise / peak, 1.0))

    def segment(self) -> Segment:
        """The same for a model to look at."""
        times = np.arange(len(self.frames)) / self.rate_hz
        return Segment(self.frames.astype(np.float32), times, self.first, self.last, self.noise)


Examples = Mapping[str, tuple[Example, ...]]  # by the gesture's name


def to_dict(gestures: Examples) -> dict[str, Any]:
    """Gestures as JSON values."""
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
    """What `to_dict` gave; ValueError says what is wrong."""
    if not isinstance(told, dict) or len(told) > MOST:
        raise ValueError(f"gestures: expected an object of at most {MOST} gestures")
    found: dict[str, tuple[Example, ...]] = {}
    for name, examples in told.items():
        if not is_name(name):
            raise ValueError(f"gestures: {name[:40]!r} is no name of a gesture, expected a-z, 0-9, _ and 32 at most")
        if not isinstance(examples, list) or not 1 <= len(examples) <= EXAMPLES:
            raise ValueError(f"gestures.{name}: expected a list of 1 to {EXAMPLES} examples")
        found[name] = tuple(_example(one, f"gestures.{name}[{k}]") for k, one in enumerate(examples))
    return found


def is_name(name: str) -> bool:
    """Whether a gesture of the user's own may be called that."""
    plain = set(name) <= set(LETTERS + "0123456789_") and 0 < len(name) <= LONGEST_NAME
    return plain and name[0] in LETTERS and name not in RESERVED


def _example(told: Any, place: str) -> Example:
    try:
        shape = tuple(int(n) for n in told["shape"])
        rate_hz, noise = float(told["rate_hz"]), float(told["noise"])
        first, last = int(told["first"]), int(told["last"])
        if len(shape) != 3 or min(shape) < 1 or shape[0] > MOST_FRAMES or math.prod(shape) > MOST_VALUES:
            raise ValueError
        data = base64.b64decode(told["frames"], validate=True)
        frames = np.frombuffer(data, "<f2").reshape(shape).astype(np.float16)
        if not (0 <= first <= last < shape[0] and 0 < rate_hz <= 1000 and 0 <= noise <= 1):
            raise ValueError
        if not (np.isfinite(frames).all() and 0 <= frames.min() and frames.max() <= 1):
            raise ValueError
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(f"{place}: expected shape, rate_hz, first, last, noise and frames of an example") from None
    return Example(frames, rate_hz, first, last, noise)
