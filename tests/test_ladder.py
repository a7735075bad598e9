"""The ladder: a rung that fails hands the same segment on, and a better one comes back."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured.core.classifier import Scores
from gestured.core.errors import ModelError
from gestured.core.frames import Segment
from gestured.model.ladder import RETRY_S, SLOW_RUNS, SLOW_S, Ladder, ladder_for
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER
from tests.small_model import GESTURES, STRICTER, Clock, build, operating_points, segment


@dataclass
class Fake(Model):
    """A model that does what its test says, and remembers what it was given."""

    name: str
    clock: Clock
    answer: float = 0.9
    takes_s: float = 0.0
    error: Exception | None = None
    gestures: tuple[str, ...] = GESTURES
    rows: int = 9
    columns: int = 9
    seen: list[Segment] = field(default_factory=list)

    def classify(self, segment: Segment) -> Scores:
        self.seen.append(segment)
        self.clock.now += self.takes_s
        if self.error is not None:
            raise self.error
        return Scores(np.array([self.answer, 1 - self.answer], np.float32), 0.0, self.name)


@pytest.fixture
def clock() -> Clock:
    return Clock(1000.0)


@pytest.fixture
def three(clock: Clock) -> list[Fake]:
    return [Fake(name, clock) for name in ("best", "second", "third")]


@pytest.mark.parametrize("how", [ModelError("broken"), RuntimeError("worse"), None])
def test_failing_rung_hands_the_same_segment_on(three: list[Fake], clock: Clock, how: Exception | None) -> None:
    three[0].error = how
    if how is None:
        three[0].answer = np.nan
    said: list[str] = []
    ladder = Ladder(three, clock=clock, report=said.append)
    one = segment()
    scores = ladder.classify(one)
    assert (scores.model, scores.degraded) == ("second", True)
    assert three[0].seen[0] is one and three[1].seen[0] is one
    assert (ladder.active, ladder.degraded) == ("second", True)
    assert said[0].startswith("best is put aside") and len(said) == 2


def test_better_rung_is_tried_again_after_a_while(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock)
    three[0].error = ModelError("broken")
    ladder.classify(segment())
    three[0].error = None
    clock.now += RETRY_S - 1.0
    assert ladder.classify(segment()).model == "second"
    clock.now += 2.0
    scores = ladder.classify(segment())
    assert (scores.model, scores.degraded) == ("best", False)
    assert not ladder.degraded


def test_slow_rung_is_put_aside_after_several_slow_runs_and_comes_back(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock)
    three[0].takes_s = 1.2 * SLOW_S
    assert [ladder.classify(segment()).model for _ in range(SLOW_RUNS + 1)] == ["best"] * SLOW_RUNS + ["second"]
    three[0].takes_s = 0.0
    clock.now += RETRY_S + 1.0
    scores = ladder.classify(segment())
    assert scores.model == "best" and scores.took_s == 0.0


def test_slow_runs_that_are_not_in_a_row_change_nothing(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock)
    for takes_s in (*[1.2 * SLOW_S] * (SLOW_RUNS - 1), 0.2 * SLOW_S) * 3:
        three[0].takes_s = takes_s
        scores = ladder.classify(segment())
        assert scores.model == "best" and scores.took_s == pytest.approx(takes_s)


def test_slow_rung_answers_where_nothing_else_does(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock)
    three[0].takes_s = 1.0
    for _ in range(SLOW_RUNS):
        ladder.classify(segment())
    three[1].error = three[2].error = ModelError("broken")
    assert ladder.classify(segment()).model == "best"


@pytest.mark.parametrize("others", [("one_tap",), ("swipe_up", "one_tap"), (*GESTURES, "double_tap")])
def test_a_fallback_with_other_gestures_is_left_aside_for_good(clock: Clock, others: tuple[str, ...]) -> None:
    said: list[str] = []
    best, other = Fake("best", clock), Fake("second", clock, gestures=others)
    ladder = Ladder([best, other, Fake("third", clock)], clock=clock, report=said.append)
    (sentence,) = said
    assert sentence.startswith("second is put aside until a reload: ") and f"found {', '.join(others)}" in sentence
    best.error = ModelError("broken")
    clock.now += 2 * RETRY_S
    assert ladder.classify(segment()).model == "third" and not other.seen


@given(st.lists(st.tuples(st.lists(st.booleans(), min_size=3, max_size=3), st.floats(0, 40)), max_size=30))
def test_some_rung_answers_whenever_one_can(story: list[tuple[list[bool], float]]) -> None:
    clock = Clock()
    rungs = [Fake(name, clock) for name in ("best", "second", "third")]
    ladder = Ladder(rungs, clock=clock)
    for broken, pause in story:
        clock.now += pause
        for rung, is_broken in zip(rungs, broken, strict=True):
            rung.error = ModelError("broken") if is_broken else None
        if all(broken):
            with pytest.raises(ModelError, match="best, second, third"):
                ladder.classify(segment())
            continue
        scores = ladder.classify(segment())
        assert scores.degraded == (scores.model != "best")
        assert ladder.active == scores.model
        assert not broken[["best", "second", "third"].index(scores.model)]


def test_fallback_is_opened_only_when_it_is_needed(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(
        "gestured.model.rung.open_model", lambda source, *more: opened.append(str(source)) or open_model(source, *more)
    )
    ladder = ladder_for("cnn_lstm")
    ladder.classify(segment())
    assert opened == ["cnn_lstm"]
    assert ladder.model.gestures == GESTURES


def test_shipped_model_has_the_shipped_rungs_below_it(shelf: Path) -> None:
    (shelf / "lstm.onnx").write_bytes(b"damaged")
    (shelf / "cnn_lstm.onnx").unlink()
    ladder = ladder_for("cnn_lstm")
    scores = ladder.classify(segment())
    assert (scores.model, scores.degraded, ladder.name) == ("touch_pattern_rf", True, "cnn_lstm")
    assert ladder_for("touch_pattern_rf").classify(segment()).degraded is False


def test_shipped_rungs_are_not_files_of_that_name_nearby(shelf: Path) -> None:
    build(Path("lstm"), version="mine", gestures='["a", "b"]')
    said: list[str] = []
    ladder_for("cnn_lstm", report=said.append)  # would put a fallback aside that has other gestures
    assert said == []


def test_each_rung_answers_with_its_own_operating_points_or_its_one_threshold(tmp_path: Path, clock: Clock) -> None:
    some = open_model(build(tmp_path / "some.onnx", operating_points=operating_points()))
    none = open_model(build(tmp_path / "none.onnx", calibration='{"threshold": 0.7}'))
    best = Fake("best", clock, error=ModelError("broken"))
    points = Ladder([best, some, none], clock=clock).classify(segment()).points
    assert points is not None and points["strict"].thresholds == dict.fromkeys(GESTURES, STRICTER["strict"])
    scores = Ladder([best, none, some], clock=clock).classify(segment())
    assert (scores.points, scores.threshold) == (None, 0.7)


@pytest.mark.parametrize("strictness", ["eager", "normal", "strict", None])
def test_a_strictness_that_the_model_does_not_have_is_said_where_it_is_set(
    tmp_path: Path, strictness: str | None
) -> None:
    said: list[str] = []
    path = build(tmp_path / "some.onnx", operating_points=operating_points())
    ladder_for(path, report=said.append).report_missing_points(("strict", strictness))
    assert said == []
    path = build(tmp_path / "none.onnx")
    ladder_for(path, report=said.append).report_missing_points((None, "normal", strictness))
    sentence = "none has no operating points: whatever the strictness, it takes its one threshold"
    assert said == ([sentence] if strictness in ("eager", "strict") else [])


def test_own_model_has_no_fallback_but_those_that_are_named(shelf: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.onnx"
    path.write_bytes(b"damaged")
    with pytest.raises(ModelError, match=r"mine\.onnx"):
        ladder_for(path)
    assert ladder_for(path, ["lstm"]).classify(segment()).model == "lstm"


def test_a_models_file_has_a_path_that_is_valid_in_any_folder(shelf: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    build(Path("mine.onnx"))
    assert ladder_for("mine.onnx").source == ladder_for(Path("mine.onnx")).source == str(tmp_path / "mine.onnx")
    assert [ladder_for(name).source for name in ("lstm", "lstm.onnx")] == ["lstm", "lstm.onnx"]
    build(Path("lstm.onnx"))
    assert ladder_for("lstm.onnx").source == str(tmp_path / "lstm.onnx")


def test_shipped_model_with_no_fallbacks_named(shelf: Path) -> None:
    (shelf / "cnn_lstm.onnx").unlink()
    with pytest.raises(ModelError, match=r"cnn_lstm\.onnx"):
        ladder_for("cnn_lstm", [])


def test_all_rungs_that_cannot_be_opened_are_named(shelf: Path) -> None:
    for name in LADDER:
        (shelf / f"{name}.onnx").write_bytes(b"damaged")
    with pytest.raises(ModelError) as caught:
        ladder_for("cnn_lstm")
    assert all(f"{name}.onnx" in str(caught.value) for name in LADDER)


def test_a_fallback_of_ones_own_is_open_before_it_is_needed_whatever_becomes_of_its_file(
    shelf: Path, tmp_path: Path, monkeypatch
) -> None:
    one, other = build(tmp_path / "one.onnx"), build(tmp_path / "other.onnx")
    ladder = ladder_for(one, [other])
    other.unlink()
    monkeypatch.setattr("gestured.model.opening.try_out", lambda data: pytest.fail("while an answer is waited for"))
    ladder.rungs[0].model = Fake("one", Clock(), error=ModelError("broken"))
    assert ladder.classify(segment()).model == "other"


def test_a_file_of_ones_own_that_was_refused_is_not_tried_again_before_a_reload(
    shelf: Path, tmp_path: Path, monkeypatch
) -> None:
    clock = Clock()
    said: list[str] = []
    bad, good = tmp_path / "bad.onnx", build(tmp_path / "good.onnx")
    bad.write_bytes(b"damaged")
    ladder = ladder_for(str(bad), [good], clock=clock, report=said.append)
    assert said[0].startswith("bad is put aside until a reload")
    monkeypatch.setattr("gestured.model.opening.try_out", lambda data: pytest.fail("while an answer is waited for"))
    build(bad)
    clock.now += 1000.0
    assert ladder.classify(segment()).model == "good"
