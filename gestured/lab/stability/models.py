"""The shipped models by every way to run them, against the same graph in float64."""

import time

import torch

from gestured.lab.adapt.weights import base_of
from gestured.lab.fit import RECURRENT
from gestured.lab.stability.ways import (
    ScoreTable,
    Way,
    WindowList,
    by_frames,
    by_onnxruntime,
    by_reference,
    by_torch,
    difference,
    in_a_row,
    inputs_of,
)
from gestured.lab.table import Table, Value
from gestured.model.shipped import LADDER, shipped

LONG = (80, 10_000)  # frames; no segment at 15 Hz is longer than the first


def models_table(windows: WindowList, quick: bool) -> Table:
    """Every way against the reference: on windows of simulated gestures, and on one of `LONG` frames."""
    rows: list[tuple[Value, ...]] = []
    row = in_a_row(windows, max(LONG))
    long = {f"one of {count} frames": [row[:count]] for count in LONG[: 1 if quick else None]}
    for name in LADDER:
        data = shipped()[name].read_bytes()
        ways: dict[str, Way] = {"onnxruntime, as the daemon": by_onnxruntime(data)}
        own = inputs_of(name, windows)
        ways["onnxruntime, batch of all"] = by_onnxruntime(data, batch=True)
        ways["onnxruntime, two threads"] = by_onnxruntime(data, threads=2)
        if name in RECURRENT:
            module = base_of(name).judged
            ways["torch float32"] = by_torch(module)
            ways["torch float32, batch of all"] = by_torch(module, batch=True)
            ways["torch float32, two threads"] = by_torch(module, threads=2)
            ways["torch, frame by frame"] = by_frames(module)
            ways["torch float64"] = by_torch(module, torch.float64)
        inputs: dict[str, WindowList] = {f"{len(own)} gestures": own, **(long if name in RECURRENT else {})}
        for title, some in inputs.items():
            reference = by_reference(data) if some is own else ways["torch float64"]
            right, reference_s = _timed(reference, some, 1)
            if some is own:
                rows.append((name, title, "reference: the graph in float64", 0.0, 0, 1e3 * reference_s))
            for way, run in ways.items():
                if len(some) == 1 and "batch" in way:
                    continue
                found, seconds = _timed(run, some, 1 if quick or len(some) == 1 else 3)
                rows.append((name, title, way, *difference(found, right), 1e3 * seconds))
    return Table(
        "Models: largest error of any score against float64",
        ("model", "input", "way", "error", "labels changed", "ms a window"),
        rows,
        (
            "Windows of simulated gestures; in a batch shorter ones end in quiet frames. The long ones are all",
            "of them in a row; their reference is torch in float64 (the graph's would take minutes). `labels",
            "changed`: the best gesture is another one. `ms a window`: processor time of all threads. The forest",
            "takes features, whatever the length.",
        ),
    )


def _timed(way: Way, windows: WindowList, repetitions: int) -> tuple[ScoreTable, float]:
    best = float("inf")
    for _ in range(repetitions):
        start = time.process_time()
        found = way(windows)
        best = min(best, time.process_time() - start)
    return found, best / len(windows)
