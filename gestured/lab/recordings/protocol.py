"""Who performs what in which order: gestures x inclinations x speeds, each `repeats` times, and non-gestures."""

import argparse
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gestured.record.recordings import Recordings
from gestured.simulator import NONE, SPEEDS

INCLINATION_NAMES = ("flat", "tilted", "upright")  # of the sensor; recordings hold their numbers 0, 1, 2
PSEUDONYM = re.compile(r"[A-Za-z0-9_-]{1,32}")
MERE_SPELLING = re.compile(r"(?<![0-9.])0+(?=[0-9])|\.0+$")  # in a pseudonym: zeros that do not change a number


class Exercise(NamedTuple):
    """One trial: what to perform, and how."""

    gesture: str
    speed: str
    inclination: int
    none: bool = False  # a non-gesture, `gesture` is its kind

    @property
    def label(self) -> str:
        """The label of a recording of the trial."""
        return NONE if self.none else self.gesture

    def __str__(self) -> str:
        what = f"{self.gesture} (no gesture)" if self.none else self.gesture
        return f"{what}, {self.speed}, sensor {INCLINATION_NAMES[self.inclination]}"


def pseudonym(text: str) -> str:
    """A participant's pseudonym; for argparse."""
    if PSEUDONYM.fullmatch(text) is None:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected 1 to 32 of A-Z a-z 0-9 _ -, such as 07: a participant is a pseudonym, never a name, "
            "and it becomes the name of a file"
        )
    return text


def one_spelling(name: str) -> str:
    """The same text for all spellings that may mean one person: `07`, `7` and `7.0`, or `A` and `a`."""
    return MERE_SPELLING.sub("", name.casefold())


def order(
    participant: str, seed: int, gestures: Sequence[str], repeats: int, others: Sequence[str] = ()
) -> list[Exercise]:
    """All trials in this participant's own order: the same for the same arguments.

    Inclinations come in blocks, in random order, since a sensor that was moved must lie still for a while before it can
    be used again. Within a block gestures and speeds are shuffled, each once before any comes again, and so are
    `others`, kinds of non-gestures, at one speed.
    """
    rng = np.random.default_rng([seed, *participant.encode()])
    trials: list[Exercise] = []
    for inclination in rng.permutation(len(INCLINATION_NAMES)).tolist():
        block = [Exercise(gesture, speed, inclination) for gesture in gestures for speed in SPEEDS]
        block += [Exercise(kind, "normal", inclination, none=True) for kind in others]
        for _ in range(repeats):
            trials += [block[k] for k in rng.permutation(len(block))]
    return trials


def left(trials: Sequence[Exercise], kept: Recordings | None) -> list[Exercise]:
    """The `trials` that are still to be done, in order; `kept` holds earlier recordings."""
    done = Counter(_performed(kept)) if kept is not None else Counter()
    todo = []
    for trial in trials:
        if done[trial]:
            done[trial] -= 1
        else:
            todo.append(trial)
    return todo


def _performed(kept: Recordings) -> list[Exercise]:
    if kept.speeds is None or kept.inclinations is None:
        return []
    kinds = kept.labels if kept.kinds is None else kept.kinds
    # In a file that also holds recordings of unknown inclination, the numbers are texts.
    inclinations = [int(n) if isinstance(n, str) and n.isdecimal() else n for n in kept.inclinations.tolist()]
    fields = (kept.labels.tolist(), kinds.tolist(), kept.speeds.tolist(), inclinations)
    return [
        Exercise(kind if label == NONE else label, speed, inclination, label == NONE)
        for label, kind, speed, inclination in zip(*fields, strict=True)
    ]
