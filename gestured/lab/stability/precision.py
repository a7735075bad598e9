"""What fewer digits cost the shipped networks: in arithmetic, windows and counts; and what a state becomes.

Float64 is the same graph, operator by operator, as in `models`. The recurrent state is that of the torch modules, which
carry the file's weights.
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from gestured.lab.dataset import WINDOW
from gestured.lab.stability.segments import segment_cases
from gestured.lab.stability.table import Table, Value
from gestured.lab.stability.ways import NET_CLASSES, ScoreTable, Way, WindowList, by_onnxruntime, by_reference, loaded
from gestured.lab.study.onnx_form import Graph, quantised
from gestured.model.model import shipped

STEPS = (2, 3, 4, 6, 10)  # of counts between nothing and the peak
STATE_FRAMES = (100, 1_000, 10_000)
LONGEST_REFERENCE = 12  # frames of an extreme window that float64 is asked for; longer ones take minutes
DENORMAL = 1e-41  # of the peak: below float32's least normal number, as a scale


def precision_table(windows: WindowList, quick: bool) -> Table:
    """Every comparison, net by net."""
    rows: list[tuple[Value, ...]] = []
    for name in NET_CLASSES:
        data = shipped()[name].read_bytes()
        run, reference = by_onnxruntime(data), by_reference(data)
        plain = run(windows)

        def compared(what: str, some: WindowList, of: Any = run, to: ScoreTable = plain, net: str = name) -> None:
            found = of(some)
            changed = int((found[:, :-1].argmax(axis=1) != to[:, :-1].argmax(axis=1)).sum())
            rows.append((net, what, len(some), float(np.abs(found - to).max()), changed))

        extreme = _extreme(quick)
        compared("float64 against float32, extreme windows", extreme, run, reference(extreme))
        compared("float16 windows, as in training", [w.astype(np.float16).astype(np.float32) for w in windows])
        for steps in STEPS:
            coarse = [(np.rint(w * steps) / steps).astype(np.float32) for w in windows]
            compared(f"counts of {steps} steps at the peak", coarse)
        smaller = quantised(Graph(data))
        if smaller is not None:
            compared("int8 weights", windows, _unchecked(smaller.data))
        denormal = [np.where(w > 0, w, np.float32(DENORMAL)).astype(np.float32) for w in windows]
        compared(f"denormals in the place of zeros, {_price(run, windows, denormal):.2f} times the run time", denormal)
    return Table(
        "Precision: largest change of any score",
        ("model", "what", "windows", "change", "labels changed"),
        rows,
        (
            "Against the same windows as they are, in onnxruntime as the daemon runs it; the first row of each model",
            "against the graph in float64. `labels changed`: the best gesture is another one. An int8 model fails its",
            "self-test, and the daemon would refuse it.",
        ),
    )


def state_table(windows: WindowList) -> Table:
    """The recurrent state over a very long contact: the norm of what the net remembers, and of what it says."""
    rows: list[tuple[Value, ...]] = []
    row = np.concatenate(list(windows) * (max(STATE_FRAMES) // sum(map(len, windows)) + 1))[: max(STATE_FRAMES)]
    for name in NET_CLASSES:
        net: Any = loaded(name, shipped()[name].read_bytes()).net
        state = None
        with torch.no_grad():
            for k in range(len(row)):
                _, state = net.lstm(net.features(torch.from_numpy(row[None, k : k + 1])), state)
                if k + 1 in STATE_FRAMES:
                    said, kept = (float(part.norm()) for part in state)
                    rows.append((name, k + 1, kept, said))
    return Table(
        "Recurrent state: its norm while a contact never ends",
        ("model", "frames", "cell", "output"),
        rows,
        ("Windows of simulated gestures one after the other. The output is bounded by its gate, the cell by nothing.",),
    )


def _unchecked(data: bytes) -> Way:
    """A graph whose outputs need not be those of its self-test."""
    import onnxruntime

    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])

    def run(windows: WindowList) -> ScoreTable:
        found = [session.run(("scores", "unknown"), {"frames": window[None]}) for window in windows]
        return np.stack([np.append(scores[0], unknown[0]) for scores, unknown in found]).astype(np.float64)

    return run


def _extreme(quick: bool) -> WindowList:
    """The windows of the extreme segments that are finite and short enough, every seventh of them in a quick run."""
    found = [WINDOW.apply(segment) for _, segment in segment_cases(quick) if len(segment.frames) <= LONGEST_REFERENCE]
    usable = [window for window in found if len(window) and np.isfinite(window).all()]
    return usable[:: 7 if quick else 1]


def _price(run: Any, one: Sequence[NDArray[np.float32]], other: Sequence[NDArray[np.float32]]) -> float:
    """How many times as long `other` takes as `one`, in turns."""
    took = {0: [0.0], 1: [0.0]}
    for _ in range(5):
        for k, some in enumerate((one, other)):
            start = time.process_time()
            run(some)
            took[k].append(time.process_time() - start)
    return float(np.median(took[1][1:]) / np.median(took[0][1:]))
