"""Half hours of the other generator for the judge of `gestured-lab everyday`, in a module that processes can import."""

import experiments.foreign.life as foreign
from gestured.core.frames import Frame
from gestured.core.points import Strictness
from gestured.core.scene import Setup
from gestured.lab.everyday.command import at
from gestured.lab.everyday.hours import Heard, hear
from gestured.lab.everyday.stretches import Stretch


def lived(level: str, seed: int) -> Stretch:
    """Half an hour of the other generator."""
    life = foreign.live(seed, level)
    frames = map(Frame, life.times.tolist(), life.frames)
    setup = Setup(grid=life.frames.shape[1:])
    return Stretch(life.place, str(seed), frames, setup, life.meant, life.taps, len(life.contacts))


def heard(level: str, model: str, strictness: Strictness, seed: int) -> Heard:
    """A model's answers in half an hour of the other generator."""
    return hear(lived(level, seed), at(model, strictness), strictness)
