"""The curve over people is right itself: it compares where so many are wrong, over all groups of people."""

import numpy as np
import pytest

from gestured.lab.adapt.judging import Answers
from tests.lab.adapt.curve import BASE, SHIPPED, Said, table


def said(groups: int, sure: list[float], right: list[bool], least: float) -> Said:
    """Each group is one person, who performs the same gestures."""
    found = Said()
    for person in range(groups):
        answers = Answers(np.ones(len(sure), bool), np.array(right), np.array(sure), np.full(len(sure), person))
        found.take(answers, least)
    return found


def test_models_are_compared_where_they_are_wrong_equally_often() -> None:
    # Both have the same threshold; the second is surer of everything, and orders its answers no better.
    right = [True, True, False, True, False]
    careful = said(2, [0.9, 0.8, 0.6, 0.4, 0.3], right, 0.5)
    bold = said(2, [0.99, 0.9, 0.8, 0.7, 0.6], right, 0.5)
    assert careful.shares().right[0] == pytest.approx(0.4) and careful.shares().wrong[0] == pytest.approx(0.2)
    assert bold.shares().right[0] == pytest.approx(0.6) and bold.shares().wrong[0] == pytest.approx(0.4)
    for wrong, expected in ((0.0, 0.4), (0.2, 0.6), (0.4, 0.6)):
        assert careful.right_at(wrong)[0] == pytest.approx(bold.right_at(wrong)[0]) == pytest.approx(expected)
    text = table({BASE: careful, SHIPPED: bold})
    assert "right at 0.200 wrong" in text and "2 people with 10 gestures and 0 non-gestures" in text
    first, second = (line for line in text.splitlines() if line.startswith((f"| {BASE}", f"| {SHIPPED}")))
    assert "0.600 (0.600 to 0.600)" in first and "0.600 (0.600 to 0.600)" in second
