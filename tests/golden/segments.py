"""What the path up to the segments makes of a tape, so that a change is found where it occurs.

Every hundredth frame of a sensor gives a line about all since the last one (its stamps, and what is known of the idle
sensor), every contact its lines, and every segment the digests of its arrays and of the window that a model would see.
"""

import hashlib
from typing import Any

import numpy as np

from gestured.core.front_end import Cut
from gestured.model.ladder import Ladder
from tests.golden import path
from tests.golden.path import Line
from tests.golden.tape import Tape

EVERY = 100  # frames


class _Seen:
    """What was seen of one sensor since the last line about it."""

    def __init__(self) -> None:
        self.frames = 0
        self.stamps: list[Any] = []
        self.looks: list[Any] = []

    def line(self, sensor: str) -> Line:
        found = {
            "type": "Look", "sensor": sensor, "frames": self.frames, "t": self.stamps[-1][0],
            "stamps": _digest(repr(self.stamps).encode()), "looks": _digest(repr(self.looks).encode()),
            "noise": self.looks[-1][2], "bad_taxels": self.looks[-1][3],
        }  # fmt: skip
        self.stamps, self.looks = [], []
        return found


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def found(tape: Tape, model: Ladder) -> list[Line]:
    """The lines of a tape."""
    lines: list[Line] = []
    seen: dict[str, _Seen] = {}
    for name, front_end, stamp, contacts in path.front_ends(tape):
        sensor = seen.setdefault(name, _Seen())
        sensor.frames += 1
        sensor.stamps.append(tuple(stamp))
        sensor.looks.append((front_end.ready, front_end.touched, front_end.noise, front_end.bad_taxels))
        lines += [_line(name, number, contact, model) for number, contact in contacts]
        if sensor.frames % EVERY == 0:
            lines.append(sensor.line(name))
    return [*lines, *(sensor.line(name) for name, sensor in seen.items() if sensor.stamps)]


def _line(sensor: str, number: int, contact: Any, model: Ladder) -> Line:
    if not isinstance(contact, Cut):
        return path.contact_line(sensor, number, contact)
    segment, window = contact.segment, path.window(contact.segment, model)
    arrays = {"frames": segment.frames, "times": segment.times, "window": window}
    return {
        "type": "Cut", "sensor": sensor, "id": number, "onset": segment.onset, "offset": segment.offset,
        "decided": contact.decided, "hole_s": contact.hole_s, "first": segment.first, "last": segment.last,
        "lost": segment.lost, "noise": segment.noise,
        "shapes": {name: list(array.shape) for name, array in arrays.items()},
        "sums": {name: float(np.sum(array, dtype=np.float64)) for name, array in arrays.items()},
        "digests": {name: _digest(np.ascontiguousarray(array).tobytes()) for name, array in arrays.items()},
    }  # fmt: skip
