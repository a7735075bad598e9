"""Does a model say of a window among others what it says of it alone? `python -m experiments.rows`.

Windows of simulated gestures, cut to the same number of frames, go through each model alone and as rows of a batch. A
first table counts the rows that differ in their last bits, by how much, and what a row costs. A second one names the
operators whose output differs for one window where their input does not: from the window alone, and from row to row of
a batch that holds that window alone. It needs onnx.
"""

import time
from collections import Counter

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from benchmarks.traffic import touched
from gestured.core.frames import Frame
from gestured.core.front_end import Cut, FrontEnd
from gestured.model.features import touch_pattern
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped

FRAMES = (8, 15, 16)  # of a window
ROWS = (2, 3, 8, 16, 37)  # of a batch
BATCHES = 20
Array = NDArray[np.float32]


def windows(model: Model, frames: int) -> Array:
    """(n, ...) what a model is given of simulated gestures that are long enough, each cut to so many frames."""
    found: list[Array] = []
    for number in range(4):
        take, front = touched(number, 60.0), FrontEnd(9, 9)
        for t, values in zip(take.sensor_times, take.frames, strict=True):
            cuts = [found for found in front.push(Frame(float(t), values)) if isinstance(found, Cut)]
            found += [model.metadata.window.apply(cut.segment)[-frames:] for cut in cuts]
    kept = [window for window in found if len(window) == frames]
    if model.metadata.features is not None:
        kept = [touch_pattern(window, model.metadata.rate_hz) for window in kept]
    return np.stack(kept)


def said(model: Model, batch: Array) -> tuple[Array, float]:
    """(B, G + 1) scores and unknown of a batch, and how long that took in s."""
    start = time.perf_counter()
    scores, unknown = model.run(batch)
    took = time.perf_counter() - start
    return np.concatenate([scores, unknown[:, np.newaxis]], axis=1), took


def compare(model: Model, all_windows: Array, rows: int, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """(share of rows that differ, largest difference, us of a window alone, us of a row in the batch)."""
    differ, largest, alone_s, batch_s = 0, 0.0, 0.0, 0.0
    for _ in range(BATCHES):
        batch = all_windows[rng.choice(len(all_windows), rows)]
        together, took = said(model, batch)
        batch_s += took
        for row, window in zip(together, batch, strict=True):
            alone, took = said(model, window[np.newaxis])
            alone_s += took
            differ += row.tobytes() != alone[0].tobytes()
            largest = max(largest, float(np.abs(row - alone[0]).max()))
    count = BATCHES * rows
    return differ / count, largest, 1e6 * alone_s / count, 1e6 * batch_s / count


def operators(name: str, window: Array, rows: int) -> tuple[Counter[str], Counter[str]]:
    """Operators whose output differs where their input does not: from the window alone, and from row to row."""
    graph = onnx.shape_inference.infer_shapes(onnx.load(shipped()[name]))
    given = {output.name for output in graph.graph.output}
    graph.graph.output.extend(value for value in graph.graph.value_info if value.name not in given)
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    session = onnxruntime.InferenceSession(graph.SerializeToString(), options, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    first, *context = session.get_inputs()
    one = {first.name: window[np.newaxis]} | {c.name: np.zeros((1, c.shape[1]), np.float32) for c in context}
    alone = dict(zip(names, session.run(names, one), strict=True))
    batch = session.run(names, {key: np.repeat(value, rows, axis=0) for key, value in one.items()})
    differ: dict[str, tuple[bool, bool]] = {}
    for key, value in zip(names, batch, strict=True):
        axes = [k for k, size in enumerate(value.shape) if size == rows and alone[key].shape[k : k + 1] == (1,)]
        parts = [np.take(value, n, axes[0]).tobytes() for n in range(rows)] if axes else [b""]
        differ[key] = bool(axes) and parts[0] != alone[key].tobytes(), len(set(parts)) > 1
    found: tuple[Counter[str], Counter[str]] = Counter(), Counter()
    for node in graph.graph.node:
        for k, counter in enumerate(found):
            before = any(differ.get(value, (False, False))[k] for value in node.input)
            counter[node.op_type] += not before and any(differ.get(v, (False, False))[k] for v in node.output)
    return +found[0], +found[1]


def main() -> None:
    """Print both tables."""
    rng = np.random.default_rng(25)
    print(
        "| model | frames | rows | rows that differ | largest difference | us alone | us a row |\n" + "|---" * 7 + "|"
    )
    told: list[str] = []
    for name in LADDER:
        model = open_model(name)
        for frames in FRAMES:
            found = windows(model, frames)
            for rows in ROWS:
                share, largest, alone, together = compare(model, found, rows, rng)
                print(
                    f"| {name} | {frames} | {rows} | {share:.0%} | {largest:.1e} | {alone:.0f} | {together:.0f} |",
                    flush=True,
                )
            kinds = [
                ", ".join(f"{kind} {n}" for kind, n in one.items()) or "-" for one in operators(name, found[0], 37)
            ]
            told.append(f"| {name} | {frames} | {kinds[0]} | {kinds[1]} |")
    print("\n| model | frames | differ from the window alone | differ from row to row |\n" + "|---" * 4 + "|")
    print("\n".join(told))


if __name__ == "__main__":
    main()
