"""The code's filters against 50 digits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.lab.stability.filters import FILTERS, Filter
from gestured.lab.stability.relaxation import DECADES, error, exact

DRIVEN = [
    (filter_, dtype, decade)
    for filter_ in FILTERS
    for dtype in filter_.dtypes
    for decade in (*DECADES, None)
    if decade is not None or not filter_.even  # the simulator's frames are evenly spaced
]
CUT = 2e-5  # what the simulator's remanence takes for nothing


@pytest.mark.parametrize(
    ("filter_", "dtype", "decade"), DRIVEN, ids=[f"{f.name}, {np.dtype(d).name}, {e}" for f, d, e in DRIVEN]
)
def test_every_filter_is_exact_at_every_step(filter_: Filter, dtype: type, decade: int | None) -> None:
    found, inside = error(filter_, decade, dtype, 40)
    assert inside
    assert found < 40 * float(np.finfo(dtype).eps) + (CUT if filter_.name.startswith("remanence") else 0.0)


@settings(max_examples=60)
@given(
    steps=st.lists(st.floats(0.0, 1e12), min_size=1, max_size=20),
    start=st.floats(1e-3, 1e9),
    filter_=st.sampled_from([f for f in FILTERS if f.name.startswith(("baseline", "idle"))]),
    values=st.data(),
)
def test_no_filter_leaves_the_range_of_what_came_in(
    steps: list[float], start: float, filter_: Filter, values: st.DataObject
) -> None:
    times = start + np.cumsum(steps)  # some of them repeated
    inputs = np.array(values.draw(st.lists(st.floats(0.0, 1.0), min_size=len(steps), max_size=len(steps))))
    out = filter_.run(times, inputs)
    assert np.isfinite(out).all()
    assert out.min() >= 0.0
    assert out.max() <= inputs.max() * (1 + 1e-15)


def test_the_reference_knows_a_decay_by_heart() -> None:
    found = exact(np.array([0.0, 1.0, 3.0]), np.zeros(3), 2.0, 1.0)
    assert found == pytest.approx([math.exp(-0.5), math.exp(-1.5)], rel=1e-16)
