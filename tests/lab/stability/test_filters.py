"""The core's filters against 50 digits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.lab.stability.filters import DECADES, FILTERS, Filter, error, exact

DRIVEN = [of for of in FILTERS if of.driven]


@pytest.mark.parametrize("decade", (*DECADES, None))
@pytest.mark.parametrize("of", FILTERS, ids=lambda of: of.name)
def test_every_filter_is_exact_at_every_step(of: Filter, decade: int | None) -> None:
    found, inside = error(of, decade, 40)
    assert inside and found < 40 * float(np.finfo(float).eps)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.floats(0.0, 1e12), st.floats(0.0, 1.0)), min_size=1, max_size=20), st.sampled_from(DRIVEN))
def test_no_filter_leaves_the_range_of_what_came_in(frames: list[tuple[float, float]], of: Filter) -> None:
    lengths, inputs = np.array(frames).T
    out = of.run(np.cumsum(lengths), inputs)
    assert np.isfinite(out).all() and out.min() >= 0.0
    assert out.max() <= max(inputs.max(), of.start) * (1 + 1e-15)


def test_the_reference_knows_a_decay_by_heart() -> None:
    found = exact(Filter("", 2.0, lambda times, inputs: inputs, 1.0), np.array([1.0, 3.0]), np.zeros(2))
    assert found == pytest.approx([math.exp(-0.5), math.exp(-1.5)], rel=1e-16)
