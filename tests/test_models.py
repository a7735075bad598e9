"""Opening models: what is good is used as trained, what is not is refused in one sentence."""

import hashlib
import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import inside
from benchmarks.traffic import touched
from gestured.core.errors import ModelError
from gestured.core.frames import Before
from gestured.core.own import EXAMPLES
from gestured.model import file as model_file
from gestured.model import process as model_process
from gestured.model.features import touch_pattern
from gestured.model.metadata import Metadata
from gestured.model.model import Model
from gestured.model.opening import check, open_model
from gestured.model.prototypes import Space
from gestured.model.session import Session
from gestured.model.shipped import LADDER
from tests.daemon import tiny_model
from tests.hostile import bad_models
from tests.opening import NO_FILES, no_file
from tests.small_model import GESTURES, WINDOW, build, operating_points, oracle, properties, segment


def refusal(path: Path | str) -> str:
    with pytest.raises(ModelError) as caught:
        open_model(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def wrong(path: Path) -> str:
    """What is wrong with a file, found in this process: onnxruntime does not come to grief over it."""
    with pytest.raises(ValueError) as caught:
        Model(path.read_bytes(), path.stem)
    assert "\n" not in str(caught.value)
    return str(caught.value)


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
    assert model.metadata.quantiles == {"duration_s": [0.1, 0.5]}
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


@pytest.mark.parametrize("name", LADDER)
@pytest.mark.parametrize("rest", [-1e6, -1.0, 0.0, 1e6])
def test_a_segment_is_answered_whatever_went_on_before_it(name: str, rest: float) -> None:
    """What has rested may by now weigh less than nothing: a sensor that cools sinks below what it showed when bare."""
    before = Before(quiet_s=0.0, recent=400, length_s=1e6, covered=1.0, rest=rest)
    model = open_model(name)
    scores = model.classify(replace(segment(), before=before))
    assert (model.gestures, model.rows, model.columns) == (tiny_model.GESTURES, 9, 9)
    assert np.isfinite(scores.values).all() and 0.0 <= scores.unknown <= 1.0


def test_report_is_json_and_says_what_the_file_is(tmp_path: Path) -> None:
    path = build(tmp_path / "m.onnx")
    report = json.loads(json.dumps(check(str(path))))
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
        "import sys\nfrom gestured.core.errors import ModelError\nfrom gestured.model.opening import open_model\n"
        "open_model(sys.argv[1])\n"
        "try: open_model(sys.argv[2])\nexcept ModelError: pass\nelse: sys.exit('opened the bad one')\n"
        "sys.exit(str({'torch', 'onnx', 'sklearn'} & set(sys.modules) or ''))"
    )
    environment = {"HOME": str(home), "PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", script, good, bad], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr.strip()) == ("", "")
    assert list(home.rglob("*")) == []


# --- models that are not ---


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.9999])
def test_truncated(tmp_path: Path, share: float) -> None:
    data = build(tmp_path / "whole.onnx").read_bytes()
    path = tmp_path / "cut.onnx"
    path.write_bytes(data[: int(len(data) * share)])
    wrong(path)


def test_a_few_bytes_are_no_digest(tmp_path: Path) -> None:
    (tmp_path / "note.onnx").write_bytes(b"note")
    assert "digest" not in wrong(tmp_path / "note.onnx")


# --- metadata ---


def told(**changes: Any) -> Metadata:
    return Metadata.parse({key: value for key, value in (properties() | changes).items() if value is not None})


@pytest.mark.parametrize("key", properties())
def test_missing_metadata_is_named(key: str) -> None:
    with pytest.raises(ValueError, match=f"has no metadata '{key}', expected"):
        told(**{key: None})


ONE = np.ones(1)
ENTRIES = {
    "window": WINDOW.to_json(),
    "own": Space(ONE, ONE[None], ONE, np.ones((2, 2, 1)), (0.0,) * EXAMPLES, 1.0, 0.0).to_json(),
    "operating_points": operating_points(),
    "provisional": json.dumps(
        {"in_a_row": 2, "elapsed_s": [0, 0.2], "thresholds": [0.9, None], "gestures": {"one_tap": [1, 0]}, "tap": None}
    ),
    "self_test": json.dumps({"shape": [1, 1], "values": "AAAAAA==", "scores": [[1, 0]], "unknown": [0]}),
}


def changed(entry: str, **changes: Any) -> str:
    """One of the entries that are objects, with other values."""
    return json.dumps(json.loads(ENTRIES[entry]) | changes)


WRONG = {  # by key, what it may not be
    "gestures": [
        "one_tap, swipe_up", '{"one_tap": 1}', '["one_tap"]', '["one_tap", "one_tap"]', '["one_tap", "Swipe Up"]',
        '["one_tap", ""]', '["one_tap", 3]', json.dumps([f"g{i}" for i in range(65)]), "[" * 100_000,
    ],
    "kind": ["A kind"], "version": ["", "1\n2"], "training_data": ["yesterday"], "rate_hz": ["nan"], "columns": ["10"],
    "rows": ["8", "nine", changed("window", rows=8)], "window": ["{}", '{"rows": 9}'], "quantiles": ["null"],
    "calibration": ["[1]", '{"temperature": NaN}', '{"threshold": 1.5}'],
    "features": ['["mean_pressure"]'], "context": ['["weather"]'],
    "self_test": ["{}", '{"shape": [1, 1]}'], "operating_points": ["[]"], "provisional": ["[]", "{}"],
}  # fmt: skip


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, several in WRONG.items() for value in several])
def test_malformed_metadata_is_named(key: str, value: str) -> None:
    with pytest.raises(ValueError, match=f"'{key}'.* expected "):
        told(**{key: value})


POINT = json.loads(operating_points())["normal"]
NO_CONFIDENCES = (2, -1, "0.5", [], True, 10**400)
WRONG_PARTS: list[tuple[str, str, Sequence[Any]]] = [
    ("own", "slope", (10**400,)), ("own", "thresholds", ([10**400] * EXAMPLES,)),
    ("self_test", "shape", ([1], [], [1000, 1000, 1000, 9], 5)), ("self_test", "values", ("AAAA", "*", 7, "AADAfw==")),
    ("self_test", "scores", ("x", [1, 0])), ("self_test", "unknown", ([0.5, 0.5], {})),
    ("operating_points", "lax", (POINT,)), ("operating_points", "strict", (None, POINT | {"more": 1})),
    ("operating_points", "eager", [POINT | {key: value} for key in POINT for value in NO_CONFIDENCES[1:]]),
    ("operating_points", "normal", [POINT | {"thresholds": value} for value in (
        {"one_tap": 0.5}, *({"one_tap": 0.5, "swipe_up": value} for value in NO_CONFIDENCES)
    )]),
    ("operating_points", "curve", ([], [[0.5, 0.1]], [[0.5, 0.1, 3], [0.5, 0.2, 2]])),
    ("provisional", "more", (1,)), ("provisional", "in_a_row", (0, -1, 1.5, True, "2", None, 10**9)),
    ("provisional", "elapsed_s", ([], None, [0.1, 0.2], [0, 0], ["0", 1], [0, True], [0, 1e300])),
    ("provisional", "thresholds", ([], [0.9], [0.9] * 3, {}, *([value, None] for value in NO_CONFIDENCES))),
    ("provisional", "gestures", ({"zigzag": [0.9, 0.9]}, {"one_tap": [0.9]}, [1])),
    ("provisional", "tap", NO_CONFIDENCES),
]  # fmt: skip


@pytest.mark.parametrize(("entry", "part", "values"), WRONG_PARTS)
def test_a_wrong_part_of_an_entry_is_named(entry: str, part: str, values: Sequence[Any]) -> None:
    named = "" if entry in ("own", "self_test") else f"{part}|an object with"
    for value in values:
        with pytest.raises(ValueError, match=f"'{entry}'.*({named})"):
            told(**{entry: changed(entry, **{part: value})})


def test_entries_that_may_be_missing_are_understood() -> None:
    found = told(**{key: ENTRIES[key] for key in ("own", "operating_points", "provisional")})
    assert found.own is not None and found.points is not None and found.provisional is not None
    assert [found.provisional.needed("swipe_up", t) for t in (0.0, 0.19, 0.2, 9.0)] == [0.9, 0.9, None, None]
    assert [found.provisional.needed("one_tap", t) for t in (0.0, 0.3)] == [1.0, 0.0]
    assert (told().own, told().points, told().provisional, told().threshold) == (None, None, None, 0.5)


def test_a_model_without_operating_points_is_as_before_and_one_with_them_reports_them(tmp_path: Path) -> None:
    assert open_model(build(tmp_path / "old.onnx")).points is None
    assert check(tmp_path / "old.onnx")["operating_points"] is None
    path = build(tmp_path / "new.onnx", operating_points=operating_points())
    model, stored = open_model(path), json.loads(operating_points())
    assert model.points is not None and [list(row) for row in model.metadata.curve] == stored.pop("curve")
    assert json.loads(json.dumps(check(path)))["operating_points"] == stored
    assert model.classify(segment()).points is model.points


def test_grid_of_the_window_must_be_that_of_the_graph(tmp_path: Path) -> None:
    path = build(tmp_path / "m.onnx", window=changed("window", rows=8), rows="8")
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
        ({"outputs": ("scores", "rejected")}, ["rejected", "'scores', 'unknown' and perhaps 'embedding'"]),
        ({"classes": 3}, ["'scores' has the shape (any, 3)", "expected (any, 2)"]),
        ({"gain": 39.0}, ["self-test", "expected 0.001"]),
        ({"extra": "no probabilities"}, ["self-test", "not probabilities"]),
        ({"extra": "two inputs"}, ["['frames', 'more']"]),
        ({"extra": "external"}, ["another file"]),
        ({"extra": "lying dims"}, ["onnxruntime cannot open it"]),
        ({"extra": "bomb"}, ["onnxruntime cannot"]),
        ({"extra": "small bomb"}, ["onnxruntime cannot"]),  # this machine has that much
        ({"keep_graph": False}, ["onnxruntime cannot open it"]),
    ],
)
def test_wrong_graph(tmp_path: Path, changes: dict[str, Any], words: list[str]) -> None:
    found = refusal if "extra" in changes else wrong  # the others do no harm to this process
    message = found(build(tmp_path / "m.onnx", **changes))
    for word in words:
        assert word in message


def test_self_test_of_another_shape_than_the_input(tmp_path: Path) -> None:
    example = np.zeros((1, 43), np.float32)
    stored = model_file.SelfTest(example, *oracle(example)).to_json()
    assert "self-test" in refusal(build(tmp_path / "m.onnx", self_test=stored))


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("quantiles", '{"at": [' + "[]," * 100_000 + "[]]}", "'quantiles'"),  # small as text, large as lists
        ("calibration", '{"a": ' + "[" * 50 + "]" * 50 + "}", "'calibration'"),
        ("learned_from", "x" * 3_000_000, "'learned_from'"),  # one that nobody reads
        ("window", "[" * 5000, "'window'"),
    ],
)
def test_metadata_are_bounded_before_they_are_parsed(tmp_path: Path, key: str, value: str, words: str) -> None:
    message = refusal(build(tmp_path / "m.onnx", **{key: value}))
    assert words in message and "expected at most" in message


def test_a_large_file_of_metadata_costs_little_more_than_its_size(tmp_path: Path) -> None:
    path = bad_models.verbose(build(tmp_path / "good.onnx"), tmp_path / "bad.onnx")
    # The largest size of the process itself is read from /proc: getrusage's would be ours, from before the exec.
    script = (
        "import re, resource, sys\nfrom gestured.core.errors import ModelError\n"
        "from gestured.model.opening import check\n"
        "try: check(sys.argv[1])\nexcept ModelError as error: print(error)\n"
        "print(max(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss,"
        " int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1])))"
    )
    done = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True, check=True)
    message, kib = done.stdout.splitlines()
    assert "'quantiles'" in message
    assert int(kib) < 300 << 10, kib


def test_a_file_whose_opening_never_ends_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_process, "OPEN_S", 2)
    path = bad_models.endless(tiny_model.make(tmp_path / "tiny.onnx"), tmp_path / "endless.onnx")
    assert "2 s" in refusal(path)


def test_what_kills_onnxruntime_kills_a_process_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_process, "START", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    (tmp_path / "m.onnx").write_bytes(b"any bytes")
    assert "SIGSEGV" in refusal(tmp_path / "m.onnx")


@pytest.mark.parametrize(("name", "value"), [("frozen", True), ("executable", None)])
def test_a_program_without_a_python_does_not_start_itself_to_try_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: object
) -> None:
    monkeypatch.setattr(sys, name, value, raising=False)
    monkeypatch.setattr(model_process, "Popen", lambda *_, **__: pytest.fail("it would try the file, too, and so on"))
    (tmp_path / "m.onnx").write_bytes(b"any bytes")
    assert "this program is frozen or embedded, and has no Python for that" in refusal(tmp_path / "m.onnx")


def test_a_file_is_tried_with_few_variables_and_no_descriptors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/somewhere")
    monkeypatch.setattr(
        model_process, "START",
        "import json, os, sys; print(json.dumps({'error': f'{sorted(os.environ)} {os.getcwd()} '"
        " + str(sorted(map(int, os.listdir('/proc/self/fd')))[:-1])}), flush=True)",
    )  # fmt: skip
    with open(tmp_path / "open", "w") as file:
        os.set_inheritable(file.fileno(), True)
        (tmp_path / "m.onnx").write_bytes(b"any bytes")
        message = refusal(tmp_path / "m.onnx")
    assert "ORT_DISABLE_TELEMETRY" in message and "NOTIFY_SOCKET" not in message and "HOME" not in message
    assert message.endswith(" / [0, 1, 2]")


def test_onnxruntimes_telemetry_is_switched_off_before_it_is_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ORT_DISABLE_TELEMETRY", raising=False)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ImportError):
        Session(b"")
    assert os.environ["ORT_DISABLE_TELEMETRY"] == "1"


def test_a_folder_of_the_same_name_is_not_taken_for_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gestured").mkdir()
    (tmp_path / "gestured" / "__init__.py").write_text("raise SystemExit('not this one')")
    build(tmp_path / "mine.onnx", maker="")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    assert open_model("mine.onnx").name == "mine"


def test_opening_leaves_the_limits_of_the_process_as_they_were(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    open_model(build(tmp_path / "good.onnx", maker=""))
    refusal(build(tmp_path / "bad.onnx", extra="bomb"))
    assert resource.getrlimit(resource.RLIMIT_AS) == before
    with ThreadPoolExecutor(2) as pool:  # as a reload does it beside the loop
        assert len(list(pool.map(open_model, [tmp_path / "good.onnx"] * 4))) == 4
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.parametrize("kind", NO_FILES)
def test_what_is_no_model_file(tmp_path: Path, kind: str) -> None:
    refusal(no_file(kind, tmp_path / "m.onnx"))


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "m.onnx"
    with path.open("wb") as file:
        file.truncate(model_file.MAX_MODEL_BYTES + 1)
    refusal(path)


# --- data in other files ---


def tensors_of_another_file(location: str | None) -> Iterator[tuple[str, Any]]:
    """A small graph for each place where a tensor may stand, whose data lie in another file; None names none."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    tensor = numpy_helper.from_array(np.zeros(256, np.float32), "w")
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    for key, value in {"location": location, "offset": "0", "length": "1024"}.items():
        if value is not None:
            tensor.external_data.add(key=key, value=value)
    one = onnx.TensorProto()
    one.CopyFrom(tensor)
    one.dims[0] = 1
    at = numpy_helper.from_array(np.arange(256), "at")
    sparse = onnx.SparseTensorProto(values=tensor, indices=at, dims=[256])
    x, y, w = (helper.make_tensor_value_info(name, TensorProto.FLOAT, [256]) for name in "xyw")
    node, opset = helper.make_node, helper.make_opsetid("", 17)
    add, shape = node("Add", ["x", "w"], ["y"]), numpy_helper.from_array(np.array([256]), "shape")
    inside = helper.make_graph([node("Add", ["x", "w"], ["z"])], "inside", [], [w], [tensor])
    inside.output[0].name = "z"
    constant = node("Constant", [], ["w"], value=tensor)
    sparse_constant = node("Constant", [], ["w"], sparse_value=sparse)
    function = helper.make_function("mine", "F", ["x"], ["y"], [constant, add], [opset])
    truth = numpy_helper.from_array(np.array(True), "truth")
    sparse_graph = helper.make_graph([add], "g", [x], [y])
    sparse_graph.sparse_initializer.append(sparse)
    graphs = {
        "initializer": helper.make_graph([add], "g", [x], [y], [tensor]),
        "constant": helper.make_graph([constant, add], "g", [x], [y]),
        "fill": helper.make_graph([node("ConstantOfShape", ["shape"], ["w"], value=one), add], "g", [x], [y], [shape]),
        "branch": helper.make_graph(
            [node("If", ["truth"], ["y"], then_branch=inside, else_branch=inside)], "g", [x], [y], [truth]
        ),
        "sparse initializer": sparse_graph,
        "sparse constant": helper.make_graph([sparse_constant, add], "g", [x], [y]),
        "function": helper.make_graph([node("F", ["x"], ["y"], domain="mine")], "g", [x], [y]),
    }
    for place, graph in graphs.items():
        functions = [function] if place == "function" else []
        opsets = [opset, helper.make_opsetid("mine", 1)]
        yield place, helper.make_model(graph, functions=functions, opset_imports=opsets, ir_version=8)


def test_data_of_other_files_are_refused_wherever_they_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "weights").write_bytes(np.arange(256, dtype=np.float32).tobytes())
    for place, proto in tensors_of_another_file("weights"):
        data = proto.SerializeToString()
        with pytest.raises(ValueError, match="another file"):
            Model(data, "")
        for length in (b"\x88\x00", b"\x88\x80\x00"):  # other ways to write it, which are one byte longer each
            with pytest.raises(ValueError, match="another file"):
                Model(data.replace(b"\x08location", length + b"location"), place)


def test_onnxruntime_opens_no_other_file_that_has_no_location() -> None:
    """What the refusal above leans on: without that name nothing is read, whichever tensor it is."""
    places = []
    for place, proto in tensors_of_another_file(None):
        with pytest.raises(ValueError, match="onnxruntime cannot open it"):
            Session(proto.SerializeToString())
        places.append(place)
    assert len(places) == 7


def test_a_recording_called_location_is_no_other_file(tmp_path: Path) -> None:
    assert open_model(build(tmp_path / "m.onnx", learned_from='[{"file": "location"}]')).name == "m"


def test_onnxruntimes_own_format_is_no_model(tmp_path: Path) -> None:
    """It holds no protobuf, and what it may name is known to onnxruntime alone."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(tmp_path / "own.ort")
    options.add_session_config_entry("session.save_model_format", "ORT")
    onnxruntime.InferenceSession(str(build(tmp_path / "m.onnx")), options, providers=["CPUExecutionProvider"])
    assert "onnxruntime cannot open it" in refusal(tmp_path / "own.ort")


# --- damage that a self-test does not see ---


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """As the laboratory writes it."""
    return model_file.sealed(build(tmp_path_factory.mktemp("good") / "m.onnx").read_bytes())


@given(
    places=st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=4, unique=True),
    near_the_end=st.booleans(),
    flip=st.integers(1, 255),
)
def test_no_damage_to_an_exported_model_goes_unnoticed(
    exported: bytes, places: list[float], near_the_end: bool, flip: int
) -> None:
    """Neither in the graph and the metadata nor in the digest itself, with its name."""
    first = len(exported) - 80 if near_the_end else 0
    data = bytearray(exported)
    for place in {first + int(share * (len(exported) - first)) for share in places}:
        data[place] ^= flip
    with pytest.raises(ValueError, match="damaged"):
        Model(bytes(data), "")


def test_what_another_program_changed_after_the_export_is_refused(tmp_path: Path, exported: bytes) -> None:
    import onnx

    proto = onnx.load_model_from_string(exported)
    proto.metadata_props.add(key="note", value="mine")
    (tmp_path / "m.onnx").write_bytes(proto.SerializeToString())
    assert "'digest'" in refusal(tmp_path / "m.onnx")


# --- shipped models ---


@pytest.mark.parametrize("source", ["lstm", "lstm.onnx"])
def test_bare_name_is_the_shipped_model(shelf: Path, source: str) -> None:
    assert open_model(source).name == "lstm"
    assert check(source)["shipped"]


def test_a_name_without_a_suffix_is_a_shipped_models_always(shelf: Path) -> None:
    build(Path("lstm"), version="mine")
    assert open_model("lstm").metadata.version == "3"
    assert check("lstm")["shipped"]
    assert open_model("./lstm").metadata.version == "mine"


def test_a_file_whose_name_ends_in_onnx_comes_before_the_shipped_model(shelf: Path) -> None:
    build(Path("lstm.onnx"), version="mine")
    assert open_model("lstm.onnx").metadata.version == "mine"
    assert open_model("lstm").metadata.version == "3"


@pytest.mark.parametrize("source", ["cnn_lsmt.onnx", "cnn_lsmt", "mine"])
def test_unknown_bare_name_lists_the_shipped_ones(shelf: Path, source: str) -> None:
    build(Path("mine"))
    message = refusal(source)
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


def test_the_bench_asks_a_model_for_what_the_daemon_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    """A model may have a further input; the bare run that it is compared with must give it, too."""
    monkeypatch.setattr(inside, "touched", lambda seed, seconds: touched(seed, 10.0))
    row = inside.recognise("cnn_lstm")
    assert float(row.ratio.split()[0]) > 0
