"""What no sensor should send, through the very code that the daemon runs: does anything not finite come out?

The path is given streams of a finger that swipes to the right. Every warning counts as a fault.
"""

import warnings

from gestured.core.classifier import Classifier
from gestured.core.events import Gesture
from gestured.lab.stability.path import events, fault, labels
from gestured.lab.stability.streams import Case, streams
from gestured.lab.table import Table, Value

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
