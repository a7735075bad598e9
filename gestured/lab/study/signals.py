"""One performance of each gesture as the sensor gave it, for the report's drawings."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.dataset import TRIALS
from gestured.lab.study.cohort import SEED
from gestured.simulator import GESTURES, Take, cohort_take

PARTICIPANT = 0
AROUND_S = 0.3  # shown before and after the gesture


def _take(gesture: str) -> Take:
    """The participant's performance at normal speed in the middle pose."""
    wanted = (PARTICIPANT, gesture, "normal", 1)
    trial = next(t for t in TRIALS if (t.participant, t.gesture, t.speed, t.inclination) == wanted)
    return cohort_take(trial, SEED)


def _shown(take: Take) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(T,) seconds from the onset, (T, R, C) counts above what the idle sensor showed."""
    event = take.events[0]
    idle = np.median(take.frames[take.times < event.onset_s - 0.1].astype(np.float64), axis=0)
    shown = (take.times >= event.onset_s - AROUND_S) & (take.times <= event.offset_s + AROUND_S)
    return take.times[shown] - event.onset_s, take.frames[shown].astype(np.float64) - idle


def signals() -> dict[str, dict[str, list[float]]]:
    """Each gesture's counts, summed over the taxels, over time."""
    out = {}
    for gesture in GESTURES:
        times, frames = _shown(_take(gesture))
        out[gesture] = {"times_s": times.round(4).tolist(), "sum": frames.sum(axis=(1, 2)).round(1).tolist()}
    return out


def double_tap() -> dict[str, Any]:
    """One double tap: the sum over time, and some of its frames: before, both peaks, the gap, after."""
    times, frames = _shown(_take("double_tap"))
    total = frames.sum(axis=(1, 2))
    touched = np.flatnonzero(total > 0.3 * total.max())
    gap = touched[:-1][np.diff(touched) > 1]
    between = int(gap[0]) + 1 if len(gap) else int(touched.mean())
    first, second = int(total[:between].argmax()), between + int(total[between:].argmax())
    at = sorted({max(int(touched[0]) - 1, 0), first, between, second, min(int(touched[-1]) + 1, len(times) - 1)})
    return {
        "times_s": times.round(4).tolist(), "sum": total.round(1).tolist(),
        "snapshots": [{"t_s": round(float(times[k]), 4), "frame": frames[k].round(1).tolist()} for k in at],
    }  # fmt: skip
