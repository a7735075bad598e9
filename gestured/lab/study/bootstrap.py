"""95 % intervals by resampling participants: gestures of one person are alike, so people are what was drawn."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

DRAWS = 1000
CONFIDENCE_LEVEL = 0.95


def interval(right: ArrayLike, people: ArrayLike) -> tuple[float, float, float]:
    """(N,) answers right or not, (N,) who gave the gesture -> share right, and its interval's ends.

    The percentile bootstrap (Efron 1979) over participants. Three times NaN for no gesture at all.
    """
    hits, owners = np.asarray(right, np.float64), np.asarray(people)
    if not len(hits):
        return float("nan"), float("nan"), float("nan")
    _, person = np.unique(owners, return_inverse=True)
    good, all_of = np.bincount(person, hits), np.bincount(person)
    rng = np.random.default_rng([0, 0xB0])
    drawn = rng.integers(0, len(all_of), (DRAWS, len(all_of)))
    shares: NDArray[np.float64] = good[drawn].sum(axis=1) / all_of[drawn].sum(axis=1)
    low, high = np.quantile(shares, [(1 - CONFIDENCE_LEVEL) / 2, (1 + CONFIDENCE_LEVEL) / 2])
    return float(hits.mean()), float(low), float(high)


def summary(right: ArrayLike, people: ArrayLike) -> dict[str, float]:
    """The same with names, rounded to a hundredth of a per cent; None where there is nothing."""
    values = interval(right, people)
    return {name: round(value, 4) for name, value in zip(("right", "low", "high"), values, strict=True)}
