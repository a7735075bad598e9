"""A second generator of tactile recordings, conceived apart from `gestured.simulator`, to judge models with.

No model is ever trained or tuned on it, since it could then judge no longer. It is not reality either; it only errs in
other ways than the simulator does.
"""

from typing import Any

import numpy as np

from experiments.foreign.hands import GESTURES, LEVELS, NON_GESTURES, draw_person, perform
from experiments.foreign.sensors import draw_sensor, record

__all__ = ["GESTURES", "KINDS", "LEVELS", "NON_GESTURES", "session", "take"]

KINDS = GESTURES + NON_GESTURES


def _label(kind: str) -> str:
    return kind if kind in GESTURES else "none"


def take(kind: str, seed: int, level: str = "nominal") -> dict[str, Any]:
    """One gesture or non-gesture on a 9 x 9 sheet at about 15 Hz.

    Returns `frames` (N, 9, 9) raw counts, `times` (N,) s, `label` (`none` for non-gestures), `kind`, `onset` and
    `release` (s, true first and last contact), and `seen` (N,): the true signal over all noise in each frame; a touch
    below about 4 cannot be seen. `contacts` are the times (s) of each finger's contact. The sheet is idle for at least
    1.3 s before and after.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind), LEVELS.index(level), 9, 9])
    person, sensor = draw_person(rng, level), draw_sensor(rng, level)
    performed = perform(kind, rng, person)
    onset = 1.4 + float(rng.uniform(0.0, 0.4))
    release = onset + performed.duration
    frames, times, seen = record(sensor, rng, [(onset, performed)], release + 1.4)
    return {
        "frames": frames,
        "times": times,
        "label": _label(kind),
        "kind": kind,
        "onset": onset,
        "release": release,
        "seen": seen,
        "contacts": [(onset + float(p.t[0]), onset + float(p.t[-1])) for p in performed.pads],
    }


def session(
    seed: int, level: str = "nominal", seconds: float = 60.0, non_gesture_share: float = 0.25
) -> dict[str, Any]:
    """One person at one sheet for a while, with pauses of 0.7 to 3 s between performances.

    Returns `frames`, `times`, `seen` and `events`: dictionaries with `label`, `kind`, `onset`, `release` (s).
    """
    rng = np.random.default_rng([seed, 1000, LEVELS.index(level)])
    person, sensor = draw_person(rng, level), draw_sensor(rng, level)
    performances, events, t = [], [], 1.6
    while True:
        kinds = NON_GESTURES if rng.random() < non_gesture_share else GESTURES
        performed = perform(str(rng.choice(kinds)), rng, person)
        if t + performed.duration + 1.4 > seconds:
            break
        performances.append((t, performed))
        release = t + performed.duration
        events.append({"label": _label(performed.kind), "kind": performed.kind, "onset": t, "release": release})
        t = release + float(rng.uniform(0.7, 3.0))
    frames, times, seen = record(sensor, rng, performances, seconds)
    return {"frames": frames, "times": times, "seen": seen, "events": events}
