"""How far the shipped models are from float64 on windows that no finger makes: not only that they are finite."""

import numpy as np
from numpy.typing import NDArray

from gestured.lab.samples import WINDOW
from gestured.lab.stability.segments import segment_cases
from gestured.lab.stability.ways import WindowList, by_onnxruntime, by_reference, difference, inputs_of
from gestured.lab.table import Table, Value
from gestured.model.shipped import LADDER, shipped

LONGEST = 80  # frames; float64, operator by operator, takes minutes for more, and no front end gives more at 15 Hz
SHORT = 12  # frames


def short_windows(quick: bool) -> WindowList:
    """Those of all families that have at most SHORT frames."""
    return [window for some in extreme_windows(quick).values() for window in some if len(window) <= SHORT]


def extreme_windows(quick: bool) -> dict[str, WindowList]:
    """The windows of the extreme segments by family, one of each that are the same; in a quick run every fifth."""
    kept: dict[str, dict[bytes, NDArray[np.float32]]] = {}
    for family, segment in segment_cases(quick):
        window = WINDOW.apply(segment)
        if 0 < len(window) <= LONGEST:
            kept.setdefault(family, {})[window.tobytes()] = window
    return {family: list(found.values())[:: 5 if quick else 1] for family, found in kept.items()}


def exactness_table(quick: bool) -> Table:
    """Each family through every shipped model, as the daemon runs it, beside the same graph in float64."""
    families = extreme_windows(quick)
    rows: dict[str, list[Value]] = {family: [len(windows)] for family, windows in families.items()}
    changed = dict.fromkeys(families, 0)
    for name in LADDER:
        data = shipped()[name].read_bytes()
        run, reference = by_onnxruntime(data), by_reference(data)
        for family, windows in families.items():
            inputs = inputs_of(name, windows)
            error, others = difference(run(inputs), reference(inputs))
            rows[family].append(error)
            changed[family] += others
    return Table(
        "Extremes: largest error of any score against float64",
        ("segments", "windows", *LADDER, "labels changed"),
        [(family, *cells, changed[family]) for family, cells in rows.items()],
        (
            f"The segments of the table of faults above, as windows of at most {LONGEST} frames, each once; in",
            "onnxruntime as the daemon runs it, against the graph in float64, operator by operator. Scores are",
            "from 0 to 1. `labels changed`: the best gesture is another one, in all models together.",
        ),
    )
