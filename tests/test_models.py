"""Opening models: what is good is used as trained, what is not is refused in one sentence; and the ladder."""

import hashlib
import json
import os
import resource
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gestured import model_file, models
from gestured.core.errors import ModelError
from gestured.core.features import feature_names, touch_pattern
from gestured.core.frames import Segment
from gestured.core.recognizer import Scores
from gestured.core.window import Window
from gestured.models import LADDER, Ladder, ladder_for, open_model

WINDOW = Window(rows=9, columns=9, rate_hz=15.0, smooth_frames=1, lead_s=0.1, tail_s=0.1, floor=4.0)
GESTURES = ("one_tap", "swipe_up")


def segment(frames: int = 6, level: float = 100.0) -> Segment:
    """A finger that moves along a row."""
    values = np.zeros((frames, 9, 9), np.float32)
    for t in range(frames):
        values[t, 4, min(t, 8)] = level
    return Segment(values, np.arange(frames) / 15.0, 0, frames - 1, 1.0)


def softmax(x: np.ndarray) -> np.ndarray:
    e = np.exp(x - x.max(axis=1, keepdims=True))
    return e / e.sum(axis=1, keepdims=True)


def oracle(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the test's model computes: scores from the mean of its input, unknown from the largest value."""
    axes = tuple(range(1, inputs.ndim))
    mean = inputs.mean(axis=axes)
    return softmax(np.stack([40 * mean, 0 * mean], 1)), 1 / (1 + np.exp(2 * inputs.max(axis=axes)))


def build(
    path: Path,
    *,
    takes: str = "frames",
    shape: tuple | None = None,
    number: str = "float",
    outputs: tuple[str, ...] = ("scores", "unknown"),
    gain: float = 40.0,
    classes: int = 2,
    extra: str = "",
    drop: tuple[str, ...] = (),
    keep_graph: bool = True,
    twice: str = "",
    **metadata: str,
) -> Path:
    """A small real ONNX model with everything that the contract asks for; the arguments break it."""
    pytest.importorskip("onnx", reason="building test models needs the extra [lab]")
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    features = takes == "features"
    names = feature_names(9, 9)
    if shape is None:
        shape = ("B", len(names)) if features else ("B", "T", 9, 9)
    dtype = {"float": TensorProto.FLOAT, "double": TensorProto.DOUBLE}[number]
    scalar = {"float": np.float32, "double": np.float64}[number]
    axes = list(range(1, len(shape)))
    weights = np.zeros((1, classes), scalar)
    weights[0, 0] = gain
    nodes = [
        helper.make_node("ReduceMean", [takes], ["mean"], axes=axes, keepdims=0),
        helper.make_node("ReduceMax", [takes], ["max"], axes=axes, keepdims=0),
        helper.make_node("Unsqueeze", ["mean", "one"], ["column"]),
        helper.make_node("MatMul", ["column", "weights"], ["logits"]),
        helper.make_node("Softmax", ["logits"], [outputs[0]], axis=1),
        helper.make_node("Mul", ["max", "minus_two"], ["negative"]),
        helper.make_node("Sigmoid", ["negative"], [outputs[1]]),
    ]
    tensors = [
        numpy_helper.from_array(np.array([1], np.int64), "one"),
        numpy_helper.from_array(weights, "weights"),
        numpy_helper.from_array(scalar(-2), "minus_two"),
    ]
    if extra == "no probabilities":
        nodes[4] = helper.make_node("Identity", ["logits"], [outputs[0]])
    if extra == "bomb":  # 16 GiB, asked for in a few bytes
        tensors.append(numpy_helper.from_array(np.array([1 << 32], np.int64), "huge"))
        nodes += [
            helper.make_node("ConstantOfShape", ["huge"], ["big"]),
            helper.make_node("ReduceSum", ["big"], ["nothing"], keepdims=0),
            helper.make_node("Add", ["negative", "nothing"], ["boom"]),
        ]
        nodes = nodes[:6] + nodes[7:] + [helper.make_node("Sigmoid", ["boom"], [outputs[1]])]
    if extra == "external":
        tensors[2].ClearField("raw_data")
        tensors[2].data_location = TensorProto.EXTERNAL
        tensors[2].external_data.add(key="location", value="/etc/hostname")
    if extra == "lying dims":
        tensors[1].dims[0] = 1 << 32
    if extra == "sparse":
        tensors.pop()
    inputs = [helper.make_tensor_value_info(takes, dtype, shape)]
    if extra == "two inputs":
        inputs.append(helper.make_tensor_value_info("more", dtype, shape))
        nodes.append(helper.make_node("Identity", ["more"], ["unused"]))
    graph = helper.make_graph(
        nodes,
        "test",
        inputs,
        [
            helper.make_tensor_value_info(outputs[0], dtype, ["B", classes]),
            helper.make_tensor_value_info(outputs[1], dtype, ["B"]),
        ],
        tensors,
    )
    if extra == "sparse":
        graph.sparse_initializer.add(
            values=numpy_helper.from_array(np.array([-2], np.float32), "minus_two"),
            indices=numpy_helper.from_array(np.array([0], np.int64), "at"),
            dims=[1],
        )
    proto = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    random = np.random.default_rng(1)
    example = 0.05 * random.random((2, len(names)) if features else (2, 5, 9, 9), np.float32)
    props = {
        "gestures": json.dumps(GESTURES),
        "kind": "test_net",
        "version": "3",
        "rows": "9",
        "columns": "9",
        "rate_hz": "15.0",
        "window": WINDOW.to_json(),
        "calibration": '{"temperature": 1.5}',
        "self_test": model_file.SelfTest(example, *oracle(example)).to_json(),
        "training_data": "0" * 64,
        "quantiles": '{"duration_s": [0.1, 0.5]}',
    }
    if features:
        props["features"] = json.dumps(names)
    props |= metadata
    helper.set_model_props(proto, {k: v for k, v in props.items() if k not in drop})
    if twice:
        proto.metadata_props.add(key=twice, value=props[twice])
    if not keep_graph:
        proto.ClearField("graph")
    path.write_bytes(proto.SerializeToString())
    assert onnx is not None
    return path


def refusal(path: Path | str) -> str:
    with pytest.raises(ModelError) as caught:
        open_model(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


# --- models that are good ---


def test_frames_model_scores_the_window_that_its_metadata_describe(tmp_path: Path) -> None:
    model = open_model(build(tmp_path / "mine.onnx"))
    scores = model.classify(segment())
    values, unknown = oracle(WINDOW.apply(segment())[np.newaxis])
    np.testing.assert_allclose(scores.values, values[0], atol=1e-6)
    assert scores.unknown == pytest.approx(float(unknown[0]), abs=1e-6)
    assert scores.model == model.name == "mine"
    assert model.gestures == GESTURES
    assert (model.rows, model.columns) == (9, 9)
    assert model.quantiles == {"duration_s": [0.1, 0.5]}
    assert model.sha256 == hashlib.sha256((tmp_path / "mine.onnx").read_bytes()).hexdigest()


def test_features_model_scores_the_touch_pattern_of_its_window(tmp_path: Path) -> None:
    model = open_model(build(tmp_path / "forest.onnx", takes="features"))
    scores = model.classify(segment())
    values, unknown = oracle(touch_pattern(WINDOW.apply(segment()), 15.0)[np.newaxis])
    np.testing.assert_allclose(scores.values, values[0], atol=1e-6)
    assert scores.unknown == pytest.approx(float(unknown[0]), abs=1e-6)


@pytest.mark.parametrize("level", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("takes", ["frames", "features"])
def test_values_that_are_not_finite_are_unknown(tmp_path: Path, takes: str, level: float) -> None:
    model = open_model(build(tmp_path / "m.onnx", takes=takes))
    scores = model.classify(segment(level=level))
    assert scores.unknown == 1.0
    np.testing.assert_allclose(scores.values, [0.5, 0.5])


def test_report_is_json_and_says_what_the_file_is(tmp_path: Path) -> None:
    path = build(tmp_path / "m.onnx")
    report = json.loads(json.dumps(models.check(str(path))))
    assert report["file"] == str(path)
    assert report["kind"] == "test_net"
    assert report["gestures"] == list(GESTURES)
    assert report["window"] == json.loads(WINDOW.to_json())
    assert report["size"] == path.stat().st_size
    assert not report["shipped"]
    assert 0 <= report["self_test"]["largest_difference"] <= report["self_test"]["tolerance"]


def test_opening_writes_nothing_prints_nothing_and_loads_no_lab(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    good, bad = build(tmp_path / "good.onnx"), build(tmp_path / "bad.onnx", extra="bomb")
    script = (
        "import sys\nfrom gestured.models import open_model, ModelError\nopen_model(sys.argv[1])\n"
        "try: open_model(sys.argv[2])\nexcept ModelError: pass\nelse: sys.exit('opened the bad one')\n"
        "sys.exit(str({'torch', 'onnx', 'sklearn'} & set(sys.modules) or ''))"
    )
    environment = {"HOME": str(home), "PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", script, good, bad],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr.strip()) == ("", "")
    assert list(home.rglob("*")) == []


# --- models that are not ---


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.9999])
def test_truncated(tmp_path: Path, share: float) -> None:
    data = build(tmp_path / "whole.onnx").read_bytes()
    path = tmp_path / "cut.onnx"
    path.write_bytes(data[: int(len(data) * share)])
    refusal(path)


KEYS = (
    "gestures", "kind", "version", "rows", "columns", "rate_hz", "window", "calibration", "self_test",
    "training_data", "quantiles",
)  # fmt: skip


@pytest.mark.parametrize("key", KEYS)
def test_missing_metadata_is_named(tmp_path: Path, key: str) -> None:
    assert repr(key) in refusal(build(tmp_path / "m.onnx", drop=(key,)))


def test_no_metadata_at_all(tmp_path: Path) -> None:
    assert "'gestures', 'kind'" in refusal(build(tmp_path / "m.onnx", drop=KEYS))


OTHER_WINDOW = json.dumps(json.loads(WINDOW.to_json()) | {"rows": 8})
HALF_WINDOW = json.dumps({"rows": 9})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("gestures", "one_tap, swipe_up"),
        ("gestures", '{"one_tap": 1}'),
        ("gestures", '["one_tap"]'),
        ("gestures", '["one_tap", "one_tap"]'),
        ("gestures", '["one_tap", "Swipe Up"]'),
        ("gestures", '["one_tap", ""]'),
        ("gestures", '["one_tap", 3]'),
        ("gestures", json.dumps([f"g{i}" for i in range(65)])),
        ("gestures", "[" * 100_000),
        ("kind", "A kind"),
        ("version", ""),
        ("version", "1\n2"),
        ("rows", "8"),
        ("rows", "nine"),
        ("columns", "10"),
        ("rate_hz", "nan"),
        ("window", "{}"),
        ("window", HALF_WINDOW),
        ("rows", OTHER_WINDOW),
        ("calibration", "[1]"),
        ("calibration", '{"temperature": NaN}'),
        ("training_data", "yesterday"),
        ("quantiles", "null"),
        ("self_test", "{}"),
        ("self_test", '{"shape": [1], "values": "", "scores": [], "unknown": []}'),
        ("self_test", '{"shape": [1000, 1000, 1000, 9], "values": "", "scores": [], "unknown": []}'),
        ("self_test", '{"shape": [1, 1, 9, 9], "values": "AAAA", "scores": [[1, 0]], "unknown": [0]}'),
        ("self_test", '{"shape": [1, 1, 9, 9], "values": "*", "scores": [[1, 0]], "unknown": [0]}'),
        ("self_test", '{"shape": [1, 1, 9, 9], "values": 7, "scores": "x", "unknown": {}}'),
        ("features", '["mean_pressure"]'),
    ],
)
def test_malformed_metadata_is_named(tmp_path: Path, key: str, value: str) -> None:
    assert f"'{key}'" in refusal(build(tmp_path / "m.onnx", **{key: value}))


def test_metadata_key_that_is_there_twice(tmp_path: Path) -> None:
    assert "'gestures' twice" in refusal(build(tmp_path / "m.onnx", twice="gestures"))


def test_grid_of_the_window_must_be_that_of_the_graph(tmp_path: Path) -> None:
    path = build(tmp_path / "m.onnx", window=OTHER_WINDOW, rows="8")
    assert "'frames' has the shape (any, any, 9, 9), expected (any, any, 8, 9)" in refusal(path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"takes": "pressure"}, ["['pressure']", "['frames']"]),
        ({"shape": ("B", "T", 9)}, ["'frames' has the shape (any, any, 9)"]),
        ({"shape": (1, "T", 9, 9)}, ["(1, any, 9, 9)", "expected (any, any, 9, 9)"]),
        ({"shape": ("B", 20, 9, 9)}, ["(any, 20, 9, 9)", "expected (any, any, 9, 9)"]),
        ({"shape": ("B", "T", "R", 9)}, ["'frames'", "expected (any, any, 9, 9)"]),
        ({"takes": "features", "shape": ("B", 3)}, ["'features' has the shape (any, 3)"]),
        ({"takes": "features", "drop": ("features",)}, ["['features']", "['frames']"]),
        ({"number": "double"}, ["tensor(double)", "tensor(float)"]),
        ({"outputs": ("scores", "rejected")}, ["rejected", "'scores' and 'unknown'"]),
        ({"classes": 3}, ["'scores' has the shape (any, 3)", "expected (any, 2)"]),
        ({"gain": 39.0}, ["self-test", "expected 0.001"]),
        ({"extra": "no probabilities"}, ["self-test", "not probabilities"]),
        ({"extra": "two inputs"}, ["['frames', 'more']"]),
        ({"extra": "external"}, ["another file"]),
        ({"extra": "lying dims"}, ["claims"]),
        ({"extra": "sparse"}, ["sparse"]),
        ({"extra": "bomb"}, ["onnxruntime cannot"]),
        ({"keep_graph": False}, ["not an ONNX model"]),
    ],
)
def test_wrong_graph(tmp_path: Path, changes: dict, words: list[str]) -> None:
    message = refusal(build(tmp_path / "m.onnx", **changes))
    for word in words:
        assert word in message


def test_self_test_of_another_shape_than_the_input(tmp_path: Path) -> None:
    example = np.zeros((1, 43), np.float32)
    stored = model_file.SelfTest(example, *oracle(example)).to_json()
    assert "self-test" in refusal(build(tmp_path / "m.onnx", self_test=stored))


def test_opening_leaves_the_limits_of_the_process_as_they_were(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    open_model(build(tmp_path / "good.onnx"))
    refusal(build(tmp_path / "bad.onnx", extra="bomb"))
    assert resource.getrlimit(resource.RLIMIT_AS) == before
    with ThreadPoolExecutor(2) as pool:  # as a reload does it beside the loop
        assert len(list(pool.map(open_model, [tmp_path / "good.onnx"] * 40))) == 40
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.parametrize("kind", ["missing", "directory", "fifo", "zero", "empty", "huge", "text", "nul"])
def test_what_is_no_model_file(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "m.onnx"
    if kind == "directory":
        path.mkdir()
    elif kind == "fifo":
        os.mkfifo(path)
    elif kind == "zero":
        path = Path("/dev/zero")
    elif kind == "empty":
        path.touch()
    elif kind == "huge":
        with path.open("wb") as file:
            file.truncate(model_file.MAX_BYTES + 1)
    elif kind == "text":
        path.write_text("this is not a model\n" * 1000)
    elif kind == "nul":
        path = Path("a/b\0c.onnx")
    refusal(path)


@given(st.binary(max_size=200))
def test_any_bytes_are_inspected_or_refused(data: bytes) -> None:
    try:
        assert isinstance(model_file.inspect(data), dict)
    except ValueError as error:
        assert str(error)


@pytest.fixture(scope="module")
def good_bytes(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return build(tmp_path_factory.mktemp("good") / "m.onnx").read_bytes()


@given(changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=8))
def test_altered_bytes_open_or_are_refused(good_bytes: bytes, changes: list[tuple[int, int]]) -> None:
    data = bytearray(good_bytes)
    for place, value in changes:
        data[place % len(data)] = value
    try:
        model = models.Model(bytes(data), "altered")
    except ValueError:
        return
    scores = model.classify(segment())  # what still opens has passed its self-test and gives probabilities
    assert scores.values.sum() == pytest.approx(1.0, abs=1e-3)


# --- shipped models ---


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of shipped models with a manifest, in place of the package's own."""
    directory = tmp_path / "shelf"
    directory.mkdir()
    for name in LADDER:
        build(directory / f"{name}.onnx", takes="features" if name == "touch_pattern_rf" else "frames")
    files = {p.name: {"sha256": hashlib.sha256(p.read_bytes()).hexdigest()} for p in directory.iterdir()}
    (directory / "manifest.json").write_text(json.dumps({"models": files}))
    monkeypatch.setattr(models, "_shipped_directory", lambda: directory)
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.chdir(empty)
    return directory


@pytest.mark.parametrize("source", ["lstm", "lstm.onnx"])
def test_bare_name_is_the_shipped_model(shelf: Path, source: str) -> None:
    assert open_model(source).name == "lstm"
    assert models.check(source)["shipped"]


def test_file_of_that_name_comes_before_the_shipped_model(shelf: Path) -> None:
    build(Path("lstm.onnx"), version="mine")
    assert open_model("lstm.onnx").metadata.version == "mine"
    assert open_model("lstm").metadata.version == "3"


def test_unknown_bare_name_lists_the_shipped_ones(shelf: Path) -> None:
    message = refusal("cnn_lsmt.onnx")
    assert all(name in message for name in LADDER)


def test_shipped_file_that_was_altered_is_refused(shelf: Path) -> None:
    build(shelf / "lstm.onnx", version="4")  # a good model, but not the one that was shipped
    with pytest.raises(ModelError, match=r"lstm\.onnx: .*sha256"):
        open_model("lstm")
    with pytest.raises(ModelError, match="sha256"):
        open_model(shelf / "lstm.onnx")


@pytest.mark.parametrize("manifest", [None, "", "{}", '{"models": {"lstm.onnx": {}}}', "[1]"])
def test_shipped_file_without_its_manifest_is_refused(shelf: Path, manifest: str | None) -> None:
    (shelf / "manifest.json").unlink()
    if manifest is not None:
        (shelf / "manifest.json").write_text(manifest)
    with pytest.raises(ModelError, match=r"manifest\.json"):
        open_model("lstm")


@pytest.mark.parametrize("name", LADDER)
def test_models_that_ship(name: str) -> None:
    if not models.shipped()[name].exists():
        pytest.skip(f"models/{name}.onnx has not been trained yet")
    model = open_model(name)
    assert model.gestures == (
        "one_tap", "double_tap", "swipe_down", "swipe_up", "swipe_right", "swipe_left", "circle_clockwise",
        "circle_counter_clockwise", "swipe_up_two_fingers", "swipe_down_two_fingers",
    )  # fmt: skip
    assert (model.rows, model.columns) == (9, 9)
    assert np.isfinite(model.classify(segment()).values).all()


# --- the ladder ---


@dataclass
class Clock:
    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Fake:
    """A rung that does what its test says, and remembers what it was given."""

    name: str
    clock: Clock
    answer: float = 0.9
    takes_s: float = 0.0
    error: Exception | None = None
    gestures: tuple[str, ...] = GESTURES
    seen: list[Segment] = field(default_factory=list)

    def classify(self, one: Segment) -> Scores:
        self.seen.append(one)
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


def test_best_rung_answers_alone(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock)
    scores = ladder.classify(segment())
    assert (scores.model, scores.degraded) == ("best", False)
    assert [len(rung.seen) for rung in three] == [1, 0, 0]
    assert (ladder.active, ladder.degraded, ladder.failures) == ("best", False, 0)


@pytest.mark.parametrize("how", [ModelError("broken"), RuntimeError("worse"), None])
def test_failing_rung_hands_the_same_segment_on(
    three: list[Fake], clock: Clock, how: Exception | None
) -> None:
    three[0].error = how
    if how is None:
        three[0].answer = np.nan
    said: list[str] = []
    ladder = Ladder(three, clock=clock, report=said.append)
    one = segment()
    scores = ladder.classify(one)
    assert (scores.model, scores.degraded) == ("second", True)
    assert three[0].seen[0] is one and three[1].seen[0] is one
    assert (ladder.active, ladder.degraded, ladder.failures) == ("second", True, 1)
    assert any("best" in sentence for sentence in said)


def test_better_rung_is_tried_again_after_a_while(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock, retry_after=30.0)
    three[0].error = ModelError("broken")
    ladder.classify(segment())
    three[0].error = None
    clock.now += 29.0
    assert ladder.classify(segment()).model == "second"
    clock.now += 2.0
    scores = ladder.classify(segment())
    assert (scores.model, scores.degraded) == ("best", False)
    assert not ladder.degraded


def test_slow_rung_is_put_aside_after_several_slow_runs_and_comes_back(
    three: list[Fake], clock: Clock
) -> None:
    ladder = Ladder(three, clock=clock, slow_s=0.05, slow_runs=3, retry_after=30.0)
    three[0].takes_s = 0.06
    assert [ladder.classify(segment()).model for _ in range(4)] == ["best"] * 3 + ["second"]
    three[0].takes_s = 0.0
    clock.now += 31.0
    assert ladder.classify(segment()).model == "best"
    assert ladder.last_run_s == 0.0


def test_slow_runs_that_are_not_in_a_row_change_nothing(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock, slow_s=0.05, slow_runs=3)
    for takes_s in (0.06, 0.06, 0.01) * 3:
        three[0].takes_s = takes_s
        assert ladder.classify(segment()).model == "best"
        assert ladder.last_run_s == pytest.approx(takes_s)


def test_slow_rung_answers_where_nothing_else_does(three: list[Fake], clock: Clock) -> None:
    ladder = Ladder(three, clock=clock, slow_runs=1)
    three[0].takes_s = 1.0
    ladder.classify(segment())
    three[1].error = three[2].error = ModelError("broken")
    assert ladder.classify(segment()).model == "best"


def test_all_rungs_failing_is_one_model_error(three: list[Fake], clock: Clock) -> None:
    for rung in three:
        rung.error = ModelError("broken")
    ladder = Ladder(three, clock=clock)
    with pytest.raises(ModelError, match="best, second, third"):
        ladder.classify(segment())
    assert ladder.failures == 3


@pytest.mark.parametrize("others", [("one_tap",), ("swipe_up", "one_tap"), (*GESTURES, "double_tap")])
def test_fallback_must_know_the_same_gestures(clock: Clock, others: tuple[str, ...]) -> None:
    with pytest.raises(ModelError, match=r"second: .*swipe_up.*found"):
        Ladder([Fake("best", clock), Fake("second", clock, gestures=others)], clock=clock)


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
            with pytest.raises(ModelError):
                ladder.classify(segment())
            continue
        scores = ladder.classify(segment())
        assert scores.degraded == (scores.model != "best")
        assert ladder.active == scores.model
        assert not broken[["best", "second", "third"].index(scores.model)]


def test_fallback_is_opened_only_when_it_is_needed(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    real = models.open_model
    monkeypatch.setattr(models, "open_model", lambda source: opened.append(str(source)) or real(source))
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
    ladder_for("cnn_lstm")  # would refuse a fallback with other gestures


def test_own_model_has_no_fallback_but_those_that_are_named(shelf: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.onnx"
    path.write_bytes(b"damaged")
    with pytest.raises(ModelError, match=r"mine\.onnx"):
        ladder_for(path)
    assert ladder_for(path, ["lstm"]).classify(segment()).model == "lstm"


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
