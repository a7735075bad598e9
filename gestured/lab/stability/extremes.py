"""What no sensor should send, through the very code that the daemon runs: does anything not finite come out?

Windows, features and models are given segments; the whole path is given streams of a finger that swipes to the
right. Every warning counts as a fault.
"""

import warnings
from collections.abc import Callable

import numpy as np

from gestured.core.classifier import Classifier
from gestured.core.events import Gesture
from gestured.core.frames import Segment
from gestured.core.window import Window
from gestured.lab.samples import WINDOW
from gestured.lab.stability.path import events, fault, labels
from gestured.lab.stability.segments import segment_cases
from gestured.lab.stability.streams import Case, streams
from gestured.lab.table import Table, Value
from gestured.model.features import touch_pattern
from gestured.model.model import Model

WINDOWS = (
    WINDOW,
    Window(9, 9, 15.0, 3, 1 / 15, 1 / 15, 4.0),
    Window(5, 7, 60.0, 1, 1 / 15, 1 / 15, 4.0),
    Window(27, 15, 5.0, 1, 1 / 15, 1 / 15, 0.0),
)
LONG = 1000  # frames: more than any front end gives, and for a model without the daemon's limit of time
FOUND = "swipe_right"  # what all swipes of `swipes` are


def swipes_found(case: Case, classifier: Classifier) -> tuple[int, str]:
    """(how many of the swipes were found, what is wrong otherwise)."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = events(case.stream, classifier)
        except (Warning, ArithmeticError, ValueError) as error:
            return 0, f"{type(error).__name__}: {error}"
    wrong = fault(found)
    if case.alone and len(labels(found)) != len(case.swipes):
        wrong = wrong or f"answered {', '.join(labels(found)) or 'nothing'}"
    named = [event.onset for event in found if isinstance(event, Gesture) and event.gesture == FOUND]
    return sum(any(abs(onset - at) < 0.5 for onset in named) for at in case.swipes), wrong


def whole_path_table(classifier: Classifier, quick: bool) -> Table:
    """Each family of streams: how many swipes were found, and what went wrong."""
    kept: dict[str, list[tuple[int, int, str]]] = {}
    for case in streams(quick):
        kept.setdefault(case.family, []).append((len(case.swipes), *swipes_found(case, classifier)))
    rows: list[tuple[Value, ...]] = []
    for family, verdicts in kept.items():
        wrong = [reason for _, _, reason in verdicts if reason]
        asked, found = sum(v[0] for v in verdicts), sum(v[1] for v in verdicts)
        rows.append(
            (family, len(verdicts), f"{found}/{asked}" if asked else "-", len(wrong), wrong[0] if wrong else "")
        )
    return Table(
        "Extremes: the whole path",
        ("streams", "how many", "swipes named rightly", "faults", "the first"),
        rows,
        (
            "A made finger swipes over made noise. Faults: a warning, an exception, scores that are no",
            "probabilities, an onset without its answer and release; and, where all swipes are asked for, any",
            "other answer.",
        ),
    )


def parts_table(models: list[Model], quick: bool) -> Table:
    """Windows, features and models on segments: cases, and what went wrong."""
    kept: dict[str, list[str]] = {}
    for family, segment in segment_cases(quick):
        kept.setdefault(family, []).append(_parts(segment, models))
    rows: list[tuple[Value, ...]] = [
        (family, len(found), sum(map(bool, found)), next(filter(None, found), "")) for family, found in kept.items()
    ]
    return Table(
        "Extremes: windows, features and models",
        ("segments", "how many", "faults", "the first"),
        rows,
        (
            f"Each segment through {len(WINDOWS)} windows, their features and the {len(models)} shipped models.",
            "Faults: a warning, a window outside 0 to 1, anything not finite, scores that are no probabilities.",
        ),
    )


def _parts(segment: Segment, models: list[Model]) -> str:
    checks: list[Callable[[], bool]] = [
        *(lambda window=window: _window(window, segment) for window in WINDOWS),
        *(lambda model=model: _scores(model, segment) for model in models),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for check in checks:
            try:
                if not check():
                    return "out of range"
            except (Warning, ArithmeticError, ValueError) as error:
                return f"{type(error).__name__}: {error}"
    return ""


def _window(window: Window, segment: Segment) -> bool:
    made = window.apply(segment)
    values = touch_pattern(made, window.rate_hz)
    return bool(len(made) and np.isfinite(values).all() and made.min() >= 0.0 and made.max() <= 1.0 + 1e-6)


def _scores(model: Model, segment: Segment) -> bool:
    if len(segment.frames) < LONG:
        answer = model.classify(segment)
        return bool(abs(float(answer.values.sum()) - 1.0) < 1e-3 and 0.0 <= answer.unknown <= 1.0)
    window = model.metadata.window.apply(segment)
    features = model.metadata.features is not None
    scores, unknown = model.run((touch_pattern(window, model.metadata.rate_hz) if features else window)[np.newaxis])
    return bool(abs(float(scores.sum()) - 1.0) < 1e-3 and 0.0 <= unknown[0] <= 1.0)
