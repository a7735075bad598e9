"""When an answer is said, and how often it is wrong: provisional and final, relative to the last touched frame.

A shipped model plays sessions of new people in this process, as the daemon would, frame by frame. A model without
thresholds for provisional answers gives final ones alone.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.classifier import Classifier
from gestured.core.events import Event, Gesture, Provisional
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab.online import takes
from gestured.lab.study.bootstrap import interval
from gestured.model.model import Model
from gestured.record.judge import NONE, Performed, owners
from gestured.simulator import Take

GROUPS = {
    "taps": ("one_tap", "double_tap"),
    "swipes": ("swipe_down", "swipe_up", "swipe_right", "swipe_left"),
    "circles": ("circle_clockwise", "circle_counter_clockwise"),
    "two fingers": ("swipe_up_two_fingers", "swipe_down_two_fingers"),
}
FIRST_PERSON = 940  # participants from here on: the sessions of `online` have others


def said(model: Model, minutes: float) -> list[dict[str, Any]]:
    """The section of study.json: for each group and kind of answer, when and how often wrong."""
    found: dict[tuple[str, str], list[tuple[float, bool, int]]] = {}
    for person, (_, take) in enumerate(takes(minutes, 0.0, FIRST_PERSON)):
        for kind, label, after_s, wrong in _answers(model, take):
            group = next(name for name, some in GROUPS.items() if label in some)
            found.setdefault((group, kind), []).append((after_s, wrong, person))
    return [
        {"group": group, "kind": kind, **_row(found[group, kind])}
        for group in GROUPS for kind in ("provisional", "final") if (group, kind) in found
    ]  # fmt: skip


def heard(times: NDArray[np.float64], frames: NDArray[np.generic], classifier: Classifier) -> list[Event]:
    """The events of a session, (N,) s and (N, R, C) counts, provisional ones among them."""
    sensor = Sensor("lab", Scene(classifier.gestures, frames.shape[1:]), classifier)
    sensor.foresee(asked=True)
    found = [one for t, values in zip(times, frames, strict=True) for one in sensor.push(Frame(float(t), values))]
    return events_of([*found, *sensor.flush(float(times[-1]) + 5.0)])


def _row(answers: list[tuple[float, bool, int]]) -> dict[str, Any]:
    after, wrong, people = (np.array(column) for column in zip(*answers, strict=True))
    share, low, high = interval(wrong, people)
    early, middle, late = np.quantile(after, [0.1, 0.5, 0.9])
    return {
        "n": len(after), "wrong": round(share, 4), "low": round(low, 4), "high": round(high, 4),
        "p10_s": round(float(early), 3), "p50_s": round(float(middle), 3), "p90_s": round(float(late), 3),
    }  # fmt: skip


def _answers(model: Model, take: Take) -> Iterator[tuple[str, str, float, bool]]:
    """(kind, what was performed, seconds after its last touched frame, wrong or not) of each answer to a gesture."""
    events = [e for e in heard(take.sensor_times, take.frames, model) if isinstance(e, Gesture | Provisional)]
    spans = [(event.onset, event.offset if isinstance(event, Gesture) else event.decided) for event in events]
    performed = [Performed(act.label, act.kind, act.onset_s, act.offset_s) for act in take.events]
    for event, act in zip(events, owners(spans, performed), strict=True):
        if act is not None and act.label != NONE:
            kind = "final" if isinstance(event, Gesture) else "provisional"
            yield kind, act.label, event.decided - act.offset, event.gesture != act.label
