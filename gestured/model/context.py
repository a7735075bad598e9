"""The context of a contact, as numbers for a model: the input `context` of its graph.

Some values come from the sensor's past (`core.frames.Before`). The others are measures of the segment that its window
does not hold, since a window is scaled by its own peak and cut off at the baseline.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import UNDISTURBED, Before, Segment
from gestured.core.window import Window

NAMES = (
    "quiet", "recent", "length", "covered", "rest",  # from before the contact
    "strength", "lowest", "below", "first", "last",  # measures of the segment
)  # fmt: skip
PAST = 5  # so many of the names, the first ones, are of values from before the contact
BELOW = 0.15  # of the peak: a taxel so far below the baseline was let go
DEEPEST = 3.0  # times the peak: taxels further below the baseline say nothing more
STRONGEST = 2000.0  # times the noise: a stronger contact, or a heavier thing at rest, says nothing more
LONGEST_S = 60.0  # a longer last contact says nothing more


def past(before: Before) -> tuple[float, ...]:
    """The first PAST values of `NAMES`, from what went on before a contact."""
    return (
        math.log(0.05 + max(before.quiet_s, 0.0)),
        math.log1p(before.recent),
        math.log1p(min(before.length_s, LONGEST_S)),
        before.covered,
        math.log1p(min(max(before.rest, 0.0), STRONGEST)),
    )


# The context of a clear gesture on an undisturbed sensor, which a model is given with a window that comes alone.
CALM = np.array([*past(UNDISTURBED), 4.0, -0.05, 0.0, 0.05, 0.1], np.float32)


def calm(batch: int, names: Sequence[str]) -> NDArray[np.float32]:
    """(B, K) the context of a clear gesture on an undisturbed sensor, for `batch` windows."""
    return np.tile(CALM[chosen(names)], (batch, 1))


def chosen(names: Sequence[str]) -> list[int]:
    """The indices in `NAMES` of these names. Raises ValueError for a name that is not there."""
    return [NAMES.index(name) for name in names]


def context(segment: Segment, signed: NDArray[np.float32], window: Window) -> NDArray[np.float32]:
    """(K,) the values of `NAMES` for a segment and its (T, R, C) window, `signed` as `Window.signed` gives it."""
    start = window.span(segment)[0]
    first = max(int(np.searchsorted(segment.times, segment.onset)) - start, 0)
    touched = segment.frames[segment.first : segment.last + 1]
    strength = float(touched.max()) / max(segment.noise, 1e-30)
    values = [
        *past(segment.before),
        math.log(min(max(strength, 1.0), STRONGEST)),
        max(float(signed.min()), -DEEPEST),
        float((signed < -BELOW).mean()),
        float(signed[:first].max()) if 0 < first <= len(signed) else 0.0,
        float(signed[-1].max()),
    ]
    return np.array(values, np.float32)
