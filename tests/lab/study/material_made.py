"""A few gestures of some people, small enough to learn from in a moment."""

import numpy as np

from gestured.lab.samples import Sample, Samples, collect
from gestured.lab.study.material import Data
from gestured.model.context import CALM
from gestured.simulator import GESTURES
from tests.lab.made import gestures


def samples(people: int = 6) -> Samples:
    """Each of the ten gestures twice by each person, with that person's own place and a little noise."""
    rng = np.random.default_rng(4)
    made = []
    for person in range(people):
        for turn in range(2):
            windows = gestures(0.1 * person)
            for name in GESTURES:
                frames = windows[name] + 0.02 * rng.random(windows[name].shape).astype(np.float32)
                frames = np.concatenate([frames, np.zeros((turn, 9, 9), np.float32)])
                window = (frames / frames.max()).astype(np.float16)
                touched = np.flatnonzero(frames.max(axis=(1, 2)) > 0.3)
                made.append(Sample(window, name, name, person, 20.0, int(touched[0]), int(touched[-1]), CALM))
    return collect(made)


def data(people: int = 6) -> Data:
    """The same as the study takes it."""
    return Data.of(samples(people))
