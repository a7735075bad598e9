"""95 % intervals over people: gestures of one person are alike, so people are the sample.

The percentile bootstrap over six or ten people covers the true value too seldom. Here the spread of a ratio over people
(linearised, with their number less one) is taken with Student's t, on the logit of a share and on the logarithm of a
rate. At a share of exactly 0 or 1 the spread over people is not known. The rule of three over gestures stands in for
it, and is too narrow where people differ and each of them made many gestures.
"""

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

CONFIDENCE_LEVEL = 0.95
RULE_OF_THREE = 3.0  # if none of n was counted, the true share is at most 3 / n, at 95 %


def interval(right: ArrayLike, people: ArrayLike) -> tuple[float, float, float]:
    """(N,) answers right or not, (N,) who gave the gesture -> the share right, and the ends of its interval.

    All three are NaN without any gesture; the interval is 0 to 1 for one person.
    """
    hits, owners = np.asarray(right, np.float64), np.asarray(people)
    if not len(hits):
        return float("nan"), float("nan"), float("nan")
    _, person = np.unique(owners, return_inverse=True)
    good, all_of = np.bincount(person, hits).astype(np.float64), np.bincount(person).astype(np.float64)
    share = float(hits.mean())
    if len(all_of) < 2:
        return share, 0.0, 1.0
    if share in (0.0, 1.0):
        edge = min(RULE_OF_THREE / len(hits), 1.0)
        return (share, 0.0, edge) if share == 0.0 else (share, 1.0 - edge, 1.0)
    wide = _half_width(good, all_of) / (1.0 - share)  # on the logit
    middle = math.log(share / (1.0 - share))
    low, high = (1.0 / (1.0 + math.exp(-(middle + way * min(wide, 50.0)))) for way in (-1.0, 1.0))
    return share, low, high


def rate(counts: ArrayLike, hours: ArrayLike) -> tuple[float, float]:
    """(P,) counts of each person in (P,) hours -> the ends of the rate's interval.

    If nothing was counted, the upper end is that of a Poisson count. For one person the interval is that of chance
    alone.
    """
    found, spent = np.asarray(counts, np.float64), np.asarray(hours, np.float64)
    if not found.any():
        return 0.0, RULE_OF_THREE / float(spent.sum())
    mean = float(found.sum() / spent.sum())
    chance = NormalDist().inv_cdf((1 + CONFIDENCE_LEVEL) / 2) / math.sqrt(found.sum())
    wide = _half_width(found, spent) if len(found) > 1 else chance
    return mean * math.exp(-min(wide, 50.0)), mean * math.exp(min(wide, 50.0))


def summary(right: ArrayLike, people: ArrayLike) -> dict[str, float]:
    """As `interval`, with names, rounded to a hundredth of a per cent; NaN without any gesture."""
    values = interval(right, people)
    return {name: round(value, 4) for name, value in zip(("right", "low", "high"), values, strict=True)}


def _half_width(part: NDArray[np.float64], whole: NDArray[np.float64]) -> float:
    """Half of the interval of log(sum of part / sum of whole) over (P,) people."""
    people = len(whole)
    left = part - part.sum() / whole.sum() * whole
    spread = math.sqrt(people / (people - 1) * float((left**2).sum())) / float(part.sum())
    return student(people - 1) * spread


def student(degrees: int) -> float:
    """The t with P(|T| < t) = CONFIDENCE_LEVEL, for Student's distribution of so many `degrees` of freedom.

    It needs no scipy, which the daemon's environment lacks: users judge their own hours there, too.
    """
    low, high = 0.0, math.pi / 2  # of atan(t / sqrt(degrees))
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _within(middle, degrees) < CONFIDENCE_LEVEL else (low, middle)
    return math.sqrt(degrees) * math.tan((low + high) / 2)


def _within(angle: float, degrees: int) -> float:
    """P(|T| < sqrt(degrees) tan(angle)), by the finite series for whole degrees (Abramowitz and Stegun, 26.7.3)."""
    sine, cosine = math.sin(angle), math.cos(angle)
    odd = degrees % 2
    term = cosine if odd else 1.0
    total = 0.0
    for k in range(1 + odd, degrees, 2):  # each term is that of k and the one after it
        total += term
        term *= cosine * cosine * k / (k + 1)
    return (angle + sine * total) * 2 / math.pi if odd else sine * total
