"""The waits that `--explain` names are those of the front end."""

import re

import numpy as np
import pytest

from gestured.core.frames import Frame
from gestured.core.front_end import Cut, FrontEnd
from gestured.core.timing import Timing
from gestured.daemon.explain import explain
from gestured.model.shipped import shipped
from tests.daemon.parts import settings_of

RATE_HZ = 15.0
JITTER_S = 0.003


def waited(tap_gap_s: float, seed: int) -> float:
    """Seconds from the last touched frame of a made tap to its answer."""
    rng = np.random.default_rng(seed)
    front = FrontEnd(9, 9, timing=Timing(tap_gap_s=tap_gap_s))
    down, right = np.ogrid[:9, :9]
    finger = 600 * np.exp(-((down - 4) ** 2 + (right - 4) ** 2) / 2)
    first, last = 30, 32
    for k in range(80):
        values = 300 + 2 * rng.standard_normal((9, 9)) + (finger if first <= k <= last else 0)
        moment = 1e5 + k / RATE_HZ + float(rng.uniform(-JITTER_S, JITTER_S))
        for found in front.push(Frame(moment, values)):
            if isinstance(found, Cut):
                return found.decided - found.segment.offset
    raise AssertionError("no answer")


@pytest.mark.parametrize("tap_gap_s", [0.2, 0.25, 0.3, 0.4, 0.45, 0.5, 0.6])
def test_a_tap_is_answered_when_explain_says(tap_gap_s: float) -> None:
    if not shipped()["cnn_lstm"].exists():
        pytest.skip("the shipped models are not there")
    text = explain(*settings_of("--tap-gap-s", tap_gap_s))
    (said,) = re.findall(r"at 15 Hz .* a tap ([0-9.]+) s after it", text)
    assert [waited(tap_gap_s, seed) for seed in range(12)] == [pytest.approx(float(said), abs=3 * JITTER_S)] * 12
