"""Algorithm 1: where its copies lie, and when a copy is the gesture itself."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gestured.lab.study.material import EDGES, bounding_box, copies, shifted, shifts
from tests.lab.study.material_made import samples


@given(st.integers(0, 8), st.integers(0, 8), st.integers(1, 4), st.integers(1, 4))
def test_each_copy_touches_its_edge_and_loses_nothing(top: int, left: int, height: int, width: int) -> None:
    window = np.zeros((3, 9, 9), np.float32)
    window[1, top : top + height, left : left + width] = 0.7
    for edge, (rows, columns) in zip(EDGES, shifts(window), strict=True):
        moved = shifted(window, rows, columns)
        box = dict(zip(("top", "bottom", "left", "right"), bounding_box(moved), strict=True))
        assert box[edge] == (0 if edge in ("top", "left") else 8)
        assert np.count_nonzero(moved) == np.count_nonzero(window)


def test_a_shift_of_zero_is_the_gesture_itself_and_is_counted() -> None:
    made = samples(2)
    found, source, same = copies(made)
    assert len(found) == len(EDGES) * len(made)
    for k, of in enumerate(source.tolist()):
        assert found.labels[k] == made.labels[of]
        assert np.array_equal(found.window(k), made.window(of)) == same[k]
    assert 0 < same.sum() < len(same)


def test_with_a_threshold_of_zero_noise_fills_the_frame_and_every_copy_is_the_gesture() -> None:
    assert copies(samples(2), threshold=0.0)[2].mean() > 0.9
