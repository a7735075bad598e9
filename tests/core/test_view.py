"""What is shown of a sensor at a moment is what its path goes by."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gestured.core.beside.reading import view_of
from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.mounting import Mounting
from gestured.core.segmenter import CONTACT, GAP, IDLE, RELEASING, SPENT, Segmenter, Signal
from tests.swipes import RATE_HZ, swipes


@given(
    st.sampled_from([IDLE, CONTACT, RELEASING, GAP, SPENT]), st.floats(0, 1000), st.floats(-1, 9), st.floats(0, 1000)
)
def test_the_thresholds_that_are_shown_are_those_that_decide(phase, peak: float, past: float, activity: float) -> None:
    segmenter = Segmenter(81, 1.0)
    segmenter.phase = phase
    segmenter.after.begin()
    segmenter.after.touch(peak)
    segmenter.after.fade(10.0)
    on, off = segmenter.levels(10.0 + past)
    said = phase.reads(segmenter, 10.0 + past, activity)
    assert said is (Signal.QUIET if activity < off else Signal.STRONG if activity >= on else Signal.WEAK)


def test_before_the_sensor_is_learned_its_counts_are_shown_alone() -> None:
    front_end = FrontEnd(9, 9)
    assert view_of(front_end, raw=False) is None
    frames = swipes(9, 9)
    front_end.push(Frame(0.0, frames[0]))
    shown = view_of(front_end, raw=True)
    assert shown is not None and shown["values"] is None and np.allclose(shown["raw"], frames[0].ravel(), atol=0.006)


def test_what_a_sensor_of_fractions_feels_is_shown() -> None:
    frames = swipes(9, 9) / 1e5
    front_end = FrontEnd(9, 9)
    peak, noise = 0.0, set()
    for n, values in enumerate(frames):
        front_end.push(Frame(n / RATE_HZ, values))
        shown = view_of(front_end, raw=True)
        assert shown is not None
        if shown["values"] is not None:
            peak, noise = max(peak, *shown["values"]), noise | {shown["noise"]}
            assert np.allclose(shown["raw"], values.ravel(), rtol=0.0, atol=front_end.noise / 10)
    assert peak > 10 * max(noise) > 0.0


def test_a_bad_taxel_is_marked_and_shows_what_it_is_bridged_with() -> None:
    rng = np.random.default_rng(0)
    frames = swipes(9, 9)
    frames[:, 2, 3] += rng.normal(0, 100, len(frames))
    front_end = FrontEnd(9, 9, mounting=Mounting(90))
    for n, values in enumerate(frames):
        front_end.push(Frame(n / RATE_HZ, values))
        shown = view_of(front_end, raw=True)
        if shown is not None and shown["bad"]:
            assert shown["bad"] == [3 * 9 + 6]  # turned by 90 degrees
            grid = np.array(shown["values"]).reshape(shown["grid"])
            around = [grid[r, c] for r in (2, 3, 4) for c in (5, 6, 7) if (r, c) != (3, 6)]
            assert min(around) - 0.01 <= grid[3, 6] <= max(around) + 0.01
            assert np.allclose(shown["raw"], values.ravel(), atol=0.006)  # as it was sent
    assert shown["bad"]
