"""Behaviours as text (tests/scenarios/*.txt), and what must hold for every stream of frames."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.core.front_end import Cut, Ended, Opened, Void
from tests.scenario import Player, Scenario, load, parse

MANY = 4000  # frames of a scenario, which hold as much chance as several short ones
SCENARIOS = sorted((Path(__file__).parent / "scenarios").glob("*.txt"))


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_scenario(path: Path) -> None:
    scenario = load(path)
    assert any(step.verb == "expect" for step in scenario.steps)
    frames = scenario.sensor.rate * sum(step.seconds for step in scenario.steps)
    for seed in range(3 if frames < MANY else 1):
        assert Player(scenario, seed).play() == []


# --- any stream

seconds = st.sampled_from(["30ms", "1 frame", "2 frames", "130ms", "300ms", "700ms", "1500ms", "6s"])
places = st.tuples(st.integers(0, 8), st.integers(0, 8)).map(lambda p: f"{p[0]},{p[1]}")
forces = st.sampled_from(["0.004", "0.01", "0.02", "0.1", "0.5", "1.0", "5"])
lines = st.one_of(
    seconds.map("quiet for {}".format),
    st.tuples(places, forces, seconds).map(lambda x: "press {} {} for {}".format(*x)),
    st.tuples(places, forces, places, forces, seconds).map(lambda x: "press {} {} and {} {} for {}".format(*x)),
    st.tuples(places, places, forces, seconds).map(lambda x: "move {} to {} {} in {}".format(*x)),
    st.tuples(places, forces).map(lambda x: "object {} {}".format(*x)),
    seconds.map("silence for {}".format),
    st.sampled_from(["clear", "lose 2", "lose 9", "dead 1,1", "shift 200", "shift 400", "restart 500", "end"]),
)
sensors = st.tuples(
    st.sampled_from(["9x9", "2x2", "3x12"]),
    st.sampled_from(["5", "15", "60"]),
    st.sampled_from(["0", "2", "20"]),
    st.sampled_from(["0ms", "8ms"]),
    st.sampled_from(["yes", "no"]),
).map(lambda x: "sensor grid {} rate {} noise {} jitter {} waiting {}".format(*x))
streams = st.builds(
    lambda sensor, first, rest: parse("any", "\n".join([sensor, first, *rest, "end"])),
    sensors,
    st.sampled_from(["quiet for 1500ms", "press 4,4 0.5 for 300ms"]),
    st.lists(lines, max_size=12),
)
seeds = st.integers(0, 9)


@settings(max_examples=100, deadline=None)
@given(streams, seeds)
def test_every_onset_has_one_answer_and_one_release(scenario: Scenario, seed: int) -> None:
    player = Player(scenario, seed)
    events = player.play()
    assert not player.front_end.touched
    assert len(events) % 3 == 0
    before = -np.inf
    for at in range(0, len(events), 3):
        onset, answer, release = events[at : at + 3]
        assert isinstance(onset, Opened) and isinstance(answer, Cut | Void) and isinstance(release, Ended)
        assert before < onset.onset <= release.offset
        before = release.offset
        if isinstance(answer, Cut):
            segment = answer.segment
            assert onset.onset <= segment.onset <= segment.offset == release.offset <= answer.decided
            assert segment.frames.shape == (len(segment.times), scenario.sensor.rows, scenario.sensor.columns)
            assert np.isfinite(segment.frames).all() and (np.diff(segment.times) > 0).all()


@settings(max_examples=30, deadline=None)
@given(streams, seeds)
def test_a_stream_that_comes_back_after_a_silence_is_as_good_as_new(scenario: Scenario, seed: int) -> None:
    after = parse("after", "clear\nsilence for 2s\nquiet for 9s\nend\ncheck ready, not touched")
    player = Player(replace(scenario, steps=scenario.steps + after.steps), seed)
    player.play()
