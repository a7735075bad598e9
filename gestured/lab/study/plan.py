"""How much is computed: the full study, and a quick one for tests whose figures are worth little."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gestured.lab.dataset import TRIALS


@dataclass(frozen=True)
class Plan:
    """Every number that decides how long the study takes."""

    seed: int = 0
    quick: bool = False
    seeds: int = 3  # splits and trainings of each cell of the main tables, with `seed` and those after it
    folds: int = 4  # of participants, and of real subjects
    tuning_people: int = 12  # other participants, on whom hyperparameters are compared: nobody of them is judged
    tuning_folds: int = 5  # as the paper says
    new_people: int = 6  # participants whom nothing has learned from: they judge error against run time
    steps: int | None = None  # batches for every network; None: as its hyperparameters say
    tuning_steps: int = 250  # batches for networks while hyperparameters are compared
    real: int | None = None  # gestures of each real subject; None: all
    timed: int = 60  # gestures that the run time is measured on, each cold (after 67 ms) and warm
    minutes: float = 20.0  # of continuous sessions for each model

    @classmethod
    def small(cls, seed: int) -> "Plan":
        """What takes some minutes on two cores."""
        return cls(
            seed, True, 1, folds=2, tuning_people=0, new_people=1, steps=40, tuning_steps=0, real=40,
            timed=3, minutes=0.0,
        )  # fmt: skip

    def trials(self) -> NDArray[np.int64]:
        """Which of the cohort's trials are performed: all, or one in five of a third of the participants."""
        chosen = [t.index for t in TRIALS if not self.quick or (t.participant % 3 == 0 and t.inclination == 1)]
        return np.array(chosen, np.int64)

    def trials_of(self, people: int) -> NDArray[np.int64]:
        """All trials of the first so many participants of another cohort; few of them in a quick study."""
        chosen = [t.index for t in TRIALS if t.participant < people and (not self.quick or t.inclination == 1)]
        return np.array(chosen, np.int64)
