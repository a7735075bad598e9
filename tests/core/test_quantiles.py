"""Medians and quantiles are numpy's to the last bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gestured.core.quantiles import median, quantile


@given(rows=st.integers(1, 20), columns=st.integers(1, 20), seed=st.integers(0, 999))
def test_the_median_is_numpys(rows: int, columns: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(0, 1, (rows, columns))
    assert median(values).tolist() == np.median(values, axis=0).tolist()
    assert float(median(values[0])) == np.median(values[0])
    for share in (0.5, 0.75):
        assert quantile(values[0], share) == np.quantile(values[0], share)
