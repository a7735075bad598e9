"""One sensor as it is felt at a moment, for whoever looks at it; nothing of it is made unless somebody does."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gestured.core.front_end import FrontEnd

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class View:
    """The last frame, and what the segmenter goes by. Grids are as mounted, but for `raw`."""

    t: float  # s, on the stream's clock
    phase: str
    on: float  # noise units: the activity from which there is a contact now
    off: float  # noise units: the activity below which there is none
    noise: float  # counts
    values: Array | None = None  # (R, C) counts above the baseline, bad taxels bridged; None before it is learned
    bad: NDArray[np.bool_] | None = None  # (R, C)
    activity: float = 0.0  # noise units
    centroid: tuple[float, float] | None = None  # row and column; None where it is not touched
    raw: NDArray[np.generic] | None = None  # (R, C) counts as they were sent; on request


def view_of(front_end: FrontEnd, *, raw: bool) -> View | None:
    """A sensor's view now; None before its first frame."""
    shown, look, t = front_end.shown, front_end.look, front_end.pace.last
    if shown is None or t is None:
        return None
    phase, (on, off) = front_end.levels(t)
    found = View(t, phase, on, off, front_end.noise, raw=shown if raw else None)
    if look is None:
        return found
    taxels = front_end.conditioner.taxels
    return replace(
        found,
        values=taxels.bridge(look.above[None])[0],
        bad=taxels.bad.reshape(taxels.rows, taxels.columns),
        activity=look.activity,
        centroid=front_end.conditioner.place(look) if look.activity >= off else None,
    )
