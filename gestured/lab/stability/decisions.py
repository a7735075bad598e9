"""Shipped models, and windows of fewer digits: how many answers differ from those of the same graph in float64.

The reference evaluates the .onnx file itself with `onnx.reference` (numpy, operator by operator), all its weights,
constants and casts widened to float64.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, numpy_helper
from onnx.reference import ReferenceEvaluator
from onnx.reference.op_run import OpRun

from gestured.core.frames import Segment
from gestured.lab.dataset import cuts
from gestured.lab.decide import Answers
from gestured.lab.early import published
from gestured.lab.fit import RECURRENT
from gestured.lab.samples import WINDOW
from gestured.lab.stability.extremes import FINITE, NOISE, SIGNAL, Array, finger, simulated_series
from gestured.lab.table import Table, Value
from gestured.model.context import NAMES, calm
from gestured.model.features import touch_pattern
from gestured.model.model import Model
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES, NON_GESTURES

Windows = Sequence[NDArray[np.float32]]  # (T, R, C) each
Run = Callable[[NDArray[Any]], Sequence[Any]]  # (B, T, R, C) or (B, F) -> scores (B, G), unknown (B,)
LONGEST = 80  # frames: no front end gives more at 15 Hz, and the reference takes minutes for more


class GatherElements(OpRun):  # type: ignore[misc, unused-ignore]
    """GatherElements for the reference, since that of onnx (1.23) takes 64 elements at most."""

    def _run(self, data: NDArray[Any], indices: NDArray[Any], axis: int) -> tuple[NDArray[Any]]:
        return (np.take_along_axis(data, indices, axis),)


class Pad(OpRun):  # type: ignore[misc, unused-ignore]
    """Pad for the reference, since that of onnx cannot remove elements for negative pads. It pads with zeros alone."""

    def _run(self, data: NDArray[Any], pads: NDArray[Any], *_: object, mode: str = "constant") -> tuple[NDArray[Any]]:
        ends = list(zip(pads[: data.ndim].tolist(), pads[data.ndim :].tolist(), strict=True))
        kept = tuple(
            slice(max(-first, 0), size + min(last, 0)) for (first, last), size in zip(ends, data.shape, strict=True)
        )
        return (np.pad(data[kept], [(max(first, 0), max(last, 0)) for first, last in ends]),)


def segment_cases(quick: bool) -> Iterator[Segment]:
    """Segments that no sensor should give.

    They are of any scale, offset, length and grid, constant or alternating, of one taxel or none.
    """
    rng = np.random.default_rng(2)
    times = np.arange(12) / 15 + 5.0
    base = np.array([finger(4, 0.7 * k, 9, 9, 1.0) for k in range(12)]) + NOISE * rng.standard_normal((12, 9, 9))

    def made(frames: Array, at: Array = times, noise: float = NOISE) -> Segment:
        return Segment(np.asarray(frames, np.float32), at[: len(frames)], 0, len(frames) - 1, noise)

    for power in range(-45, 36, 5):
        for noise in (10.0**power, 0.0, 1e-300, 1e300):
            yield made(base * 10.0**power, noise=noise)
    for offset in (1e4, 1e5, 1e6, 1e7):
        yield made(base + offset * SIGNAL)
    for value in FINITE:
        for noise in (NOISE, 0.0):
            yield made(np.full((12, 9, 9), value), noise=noise)
            yield made(np.full((1, 9, 9), value), noise=noise)
    for taxel in range(0, 81, 9 if quick else 1):
        for value in (SIGNAL, FINITE[0]):
            yield made(value * np.eye(81)[[taxel] * 12].reshape(12, 9, 9))
    signs = np.where(np.indices((12, 9, 9)).sum(axis=0) % 2, 1.0, -1.0)
    for value in (1.0, SIGNAL, 1e30, FINITE[0]):
        yield made(value * signs)
        yield made(value * np.maximum(signs, 0.0))
    for count in (1, 2, 3, 10, 100, 1000, *(() if quick else (10_000,))):
        for rate in (5, 15, 60, 1000):
            long = np.array([finger(4, 8 * k / count, 9, 9, 1.0) for k in range(count)])
            yield made(long, np.arange(count) / rate)
    for shape in ((2, 2), (2, 64), (64, 2), (3, 5), (27, 15), (64, 64)):
        moved = np.array([finger(shape[0] / 2, shape[1] * k / 12, *shape, 1.0) for k in range(12)])
        for frames in (moved, -moved, 0.0 * moved, 0.0 * moved + FINITE[0]):
            yield made(frames)


def extreme_windows(quick: bool) -> Windows:
    """The windows of segments that no sensor should give, without duplicates; every fifth if quick."""
    made = (WINDOW.apply(segment) for segment in segment_cases(quick))
    kept = {window.tobytes(): window for window in made if 0 < len(window) <= LONGEST}
    return list(kept.values())[:: 5 if quick else 1]


def performed_windows(count: int, kinds: Sequence[str]) -> Windows:
    """The windows that the front end cuts out of so many simulated performances."""
    takes = (series for _, series in simulated_series(count, kinds))
    return [WINDOW.apply(segment) for take in takes for segment in cuts(take.frames, take.times)]


def decisions_table(names: Sequence[str], quick: bool) -> Table:
    """The table of shipped models, on windows of simulated gestures and non-gestures and on extreme ones."""
    count = 10 if quick else 60
    sets = {
        "windows of gestures": performed_windows(count, GESTURES),
        "of non-gestures": performed_windows(2 * count, NON_GESTURES),
        "extreme ones": extreme_windows(quick),
    }
    rows: list[tuple[Value, ...]] = []
    for name in names:
        data = shipped()[name].read_bytes()
        model = Model(data, name)  # this also imports onnxruntime without its telemetry
        reference = by_reference(data)
        for title, some in sets.items():
            right = answers(reference, name, some)
            half = [window.astype(np.float16).astype(np.float32) for window in some]
            for way, given in (("as the daemon", some), ("float16 windows", half)):
                found = answers(model.run, name, given)
                rows.append((name, f"{len(some)} {title}", way, *difference(found, right, model)))
    return Table(
        "Models: answers that differ from float64",
        ("model", "input", "way", "answers that differ", "largest change of a score"),
        rows,
        (
            "Against the same graph in float64, window by window. Gestures and non-gestures are simulated. Extreme",
            "windows are of segments of 1e-45 to 1e35 counts, of offsets up to 1e7 times the signal, constant,",
            "alternating, of one taxel, and on grids from 2 x 2 to 64 x 64; those of at most",
            f"{LONGEST} frames, each once. An answer is the gesture that is published, or none.",
        ),
    )


def by_reference(data: bytes) -> Run:
    """Run the graph in float64; if it takes a context, that is the one of `calm`."""
    runner = ReferenceEvaluator(widened(data), new_ops=[GatherElements, Pad])
    first, *others = runner.input_names

    def run(values: NDArray[Any]) -> list[Any]:
        around = dict.fromkeys(others, calm(len(values), NAMES).astype(np.float64))
        return list(runner.run(["scores", "unknown"], {first: values.astype(np.float64), **around}))

    return run


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


def answers(run: Run, name: str, windows: Windows) -> Answers:
    """Answers to each window by itself; the forest is given the window's features."""
    inputs = windows if name in RECURRENT else [touch_pattern(window, WINDOW.rate_hz) for window in windows]
    scores, unknown = zip(*(run(one[np.newaxis])[:2] for one in inputs), strict=True)
    return np.concatenate(scores), np.concatenate(unknown)


def difference(found: Answers, right: Answers, model: Model) -> tuple[int, float]:
    """(number of windows whose published answer differs, largest change of any score)."""
    changed = published(found, model.threshold) != published(right, model.threshold)
    return int(changed.sum()), max(float(np.abs(one - two).max()) for one, two in zip(found, right, strict=True))
