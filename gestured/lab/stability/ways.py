"""Every way to run a shipped model, and the reference: the same graph in float64.

The reference evaluates the .onnx file itself with `onnx.reference` (numpy, operator by operator), all its weights,
constants and casts widened to float64. The torch modules are those that `adapt` starts from.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, numpy_helper
from onnx.reference import ReferenceEvaluator
from onnx.reference.op_run import OpRun

from gestured.core.features import touch_pattern
from gestured.lab.fit import RECURRENT
from gestured.lab.nets import Judged, read_at
from gestured.lab.samples import WINDOW
from gestured.model.model import Model

WindowList = Sequence[NDArray[np.float32]]  # (T, R, C) each
ScoreTable = NDArray[np.float64]  # (B, G + 1): the gestures' scores, then unknown
ModelRun = Callable[[NDArray[np.float32]], ScoreTable]  # (B, T, R, C) or (B, F)
Way = Callable[[WindowList], ScoreTable]


class GatherElements(OpRun):  # type: ignore[misc, unused-ignore]
    """onnx's own (1.23) bears 64 elements at most."""

    def _run(self, data: NDArray[Any], indices: NDArray[Any], axis: int) -> tuple[NDArray[Any]]:
        return (np.take_along_axis(data, indices, axis),)


def widened(data: bytes) -> onnx.ModelProto:
    """The graph with float64 wherever it has float32."""
    proto = onnx.load_from_string(data)

    def wide(tensor: onnx.TensorProto) -> onnx.TensorProto:
        if tensor.data_type != TensorProto.FLOAT:
            return tensor
        return numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float64), tensor.name)

    for tensor in proto.graph.initializer:
        tensor.CopyFrom(wide(tensor))
    for node in proto.graph.node:
        for attribute in node.attribute:
            if attribute.type == onnx.AttributeProto.TENSOR:
                attribute.t.CopyFrom(wide(attribute.t))
            if node.op_type == "Cast" and attribute.name == "to" and attribute.i == TensorProto.FLOAT:
                attribute.i = TensorProto.DOUBLE
    for value in (*proto.graph.input, *proto.graph.output, *proto.graph.value_info):
        if value.type.tensor_type.elem_type == TensorProto.FLOAT:
            value.type.tensor_type.elem_type = TensorProto.DOUBLE
    return proto


def inputs_of(name: str, windows: WindowList) -> WindowList:
    """What a shipped model takes of windows: themselves, or their features."""
    return windows if name in RECURRENT else [touch_pattern(window, WINDOW.rate_hz) for window in windows]


def in_a_row(windows: WindowList, frames: int) -> NDArray[np.float32]:
    """(frames, R, C): the windows one after the other, again and again."""
    return np.concatenate(list(windows) * (frames // sum(map(len, windows)) + 1))[:frames]


def by_reference(data: bytes) -> Way:
    """One after the other, in float64."""
    runner = ReferenceEvaluator(widened(data), new_ops=[GatherElements])
    (name,) = runner.input_names
    return each(lambda batch: _joined(*runner.run(["scores", "unknown"], {name: batch.astype(np.float64)})))


def by_onnxruntime(data: bytes, threads: int = 1, batch: bool = False) -> Way:
    """As the daemon does; or on more threads, or all at once."""
    model = Model(data, "stability")  # also sees to it that onnxruntime is imported without its telemetry
    run = _scores(model.run) if threads == 1 else unchecked(data, threads)
    return _whole(run) if batch else each(run)


def unchecked(data: bytes, threads: int = 1) -> ModelRun:
    """A graph whose outputs need not be those of its self-test."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    (name,) = (value.name for value in session.get_inputs())
    return _scores(lambda values: session.run(("scores", "unknown"), {name: values}))


def by_torch(module: Judged, dtype: torch.dtype = torch.float32, threads: int = 1, batch: bool = False) -> Way:
    """The modules that were exported."""

    def run(values: NDArray[np.float32]) -> ScoreTable:
        with torch.no_grad():
            scores, unknown, _ = module.to(dtype)(torch.from_numpy(values).to(dtype))
        return _joined(scores.numpy(), unknown.numpy())

    limited = _on_threads(threads, run)
    return _whole(limited) if batch else each(limited)


def by_frames(module: Judged) -> Way:
    """The recurrent net one frame at a time, its state carried from frame to frame; the second opinion at the end."""
    net: Any = module.net

    def run(values: NDArray[np.float32]) -> ScoreTable:
        with torch.no_grad():
            frames = torch.from_numpy(values)
            state, last = None, int(read_at(frames))
            kept = torch.zeros(1, net.head.in_features)
            for k in range(last + 1):
                kept, state = net.lstm(net.features(frames[:, k : k + 1]), state)
            scores, unknown = module.decision(net.head(kept.reshape(1, -1)), module.trajectory(frames))
        return _joined(scores.numpy(), unknown.numpy())

    module.to(torch.float32)
    return each(_on_threads(1, run))


def _on_threads(threads: int, run: ModelRun) -> ModelRun:
    def limited(values: NDArray[np.float32]) -> ScoreTable:
        before = torch.get_num_threads()
        torch.set_num_threads(threads)
        try:
            return run(values)
        finally:
            torch.set_num_threads(before)

    return limited


def each(run: ModelRun) -> Way:
    """The way that asks a model window by window."""
    return lambda windows: np.concatenate([run(window[None]) for window in windows])


def _whole(run: ModelRun) -> Way:
    return lambda windows: run(_stacked(windows))


def _scores(run: Callable[[NDArray[np.float32]], Any]) -> ModelRun:
    """A run that gives scores and unknown, as one table."""
    return lambda values: _joined(*run(values))


def _joined(scores: NDArray[Any], unknown: NDArray[Any]) -> ScoreTable:
    return np.concatenate([scores, unknown[:, None]], axis=1).astype(np.float64)


def _stacked(windows: WindowList) -> NDArray[np.float32]:
    """(B, T, R, C); shorter ones end in zeros. Features (B, F) have one length."""
    out = np.zeros((len(windows), max(map(len, windows)), *windows[0].shape[1:]), np.float32)
    for row, window in zip(out, windows, strict=True):
        row[: len(window)] = window
    return out


def difference(found: ScoreTable, right: ScoreTable) -> tuple[float, int]:
    """(largest change of any score, windows whose best gesture is another one)."""
    changed = found[:, :-1].argmax(axis=1) != right[:, :-1].argmax(axis=1)
    return float(np.abs(found - right).max()), int(changed.sum())
