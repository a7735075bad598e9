"""What fewer digits cost the shipped networks, in windows and in weights; and what a state becomes that never ends.

The recurrent state is that of the torch modules, which carry the file's weights.
"""

from typing import Any

import numpy as np
import torch

from gestured.lab.adapt.weights import base_of
from gestured.lab.fit import RECURRENT
from gestured.lab.stability.ways import WindowList, by_onnxruntime, difference, each, in_a_row, unchecked
from gestured.lab.study.onnx_form import Graph, quantised
from gestured.lab.table import Table, Value
from gestured.model.shipped import shipped

STEPS = (2, 3, 4, 6, 10)  # between nothing and the peak
STATE_FRAMES = (100, 1_000, 10_000)


def precision_table(windows: WindowList) -> Table:
    """Every comparison, net by net."""
    rows: list[tuple[Value, ...]] = []
    for name in RECURRENT:
        data = shipped()[name].read_bytes()
        run = by_onnxruntime(data)
        plain = run(windows)
        half = [window.astype(np.float16).astype(np.float32) for window in windows]
        rows.append((name, "float16 windows, as in training", len(windows), *difference(run(half), plain)))
        for steps in STEPS:
            coarse = [(np.rint(window * steps) / steps).astype(np.float32) for window in windows]
            rows.append((name, f"windows of {steps} steps", len(windows), *difference(run(coarse), plain)))
        smaller = quantised(Graph(data))
        if smaller is not None:
            what = f"int8 weights, {len(smaller.data) / len(data):.2f} of the bytes"
            rows.append((name, what, len(windows), *difference(each(unchecked(smaller.data))(windows), plain)))
    return Table(
        "Fewer digits: largest change of any score against float32",
        ("model", "what", "windows", "change", "labels changed"),
        rows,
        (
            "Windows of simulated gestures in onnxruntime, against the same windows as the daemon runs them.",
            "Scores are from 0 to 1. `labels changed`: the best gesture is another one. An int8 model fails its",
            "self-test, and the daemon would refuse it.",
        ),
    )


def state_table(windows: WindowList) -> Table:
    """The recurrent state over a very long contact: the norm of what the net remembers, and of what it says."""
    rows: list[tuple[Value, ...]] = []
    row = in_a_row(windows, max(STATE_FRAMES))
    for name in RECURRENT:
        net: Any = base_of(name).judged.net
        state, most = None, 0.0
        with torch.no_grad():
            for k in range(len(row)):
                _, state = net.lstm(net.features(torch.from_numpy(row[None, k : k + 1])), state)
                said, kept = (float(part.norm()) for part in state)
                most = max(most, kept)
                if k + 1 in STATE_FRAMES:
                    rows.append((name, k + 1, kept, most, said))
    return Table(
        "Recurrent state: its Euclidean norm while a contact never ends",
        ("model", "frames", "cell", "the cell's largest so far", "output"),
        rows,
        (
            "Windows of simulated gestures one after the other, in torch. The output's elements lie between -1",
            "and 1; the cell's are bounded by nothing.",
        ),
    )
