"""The simulated takes of `adapt`: what it learns from and judges on beside own recordings."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gestured.lab.dataset import OTHER_TRIALS, simulated
from gestured.lab.samples import Samples, join
from gestured.simulator import NONE

PEOPLE = 6  # of the nominal simulated set, whom no training has met
SEED = 31  # of all that is simulated here


@dataclass(frozen=True)
class Simulated:
    """Simulated takes of people whom no training has met."""

    teach: Samples
    check: Samples  # to fit the decision
    early: Samples  # for the thresholds of provisional events, together with `check`
    nominal: Samples  # to judge
    missed: NDArray[np.int64]  # people of the nominal gestures that were never cut out


def simulate(cache: Path, jobs: int) -> Simulated:
    """A few thousand takes, from a seed; cut once, then from the cache."""
    teach = simulated(cache, "wide", SEED, 4_000, jobs)
    check = simulated(cache, "wide", SEED + 1, 1_500, jobs)
    early = simulated(cache, "wide", SEED + 2, 12_000, jobs)
    performed = 90 * PEOPLE
    others = len(OTHER_TRIALS) // 34 * PEOPLE
    nominal = join([simulated(cache, "cohort", SEED, performed, jobs), simulated(cache, "others", SEED, others, jobs)])
    lost = max(performed - int((nominal.labels != NONE).sum()), 0)
    return Simulated(teach, check, early, nominal, np.full(lost, nominal.people[0]))
