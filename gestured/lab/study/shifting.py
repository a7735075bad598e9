"""The paper's augmentation, Algorithm 1: each gesture again at the edges of the sensor.

The bounding box of a gesture holds every taxel that was pressed in any of its frames. The whole gesture is moved up
until its box touches the top edge, and again for the bottom, the left and the right edge: four copies of each.
Where the box touches an edge already the shift is zero and the copy is the gesture itself. The paper neither says
so nor leaves such copies out; we keep them and count them.

Left open by the paper: from which pressure on a taxel belongs to the box. Ours is `THRESHOLD` of the gesture's peak.
With a threshold of zero, noise fills the frame and every copy is the gesture itself.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gestured.lab.samples import OF_EACH, Samples

THRESHOLD = 0.2  # of the gesture's peak
EDGES = ("top", "bottom", "left", "right")


def bounding_box(window: NDArray[np.floating], threshold: float = THRESHOLD) -> tuple[int, int, int, int]:
    """(T, R, C) -> first row, last row, first column, last column that were pressed; all of it where none was."""
    rows, columns = window.shape[1:]
    pressed = window.max(axis=0) > threshold * window.max()
    if not pressed.any():
        return 0, rows - 1, 0, columns - 1
    down, across = np.flatnonzero(pressed.any(axis=1)), np.flatnonzero(pressed.any(axis=0))
    return int(down[0]), int(down[-1]), int(across[0]), int(across[-1])


def shifts(window: NDArray[np.floating], threshold: float = THRESHOLD) -> list[tuple[int, int]]:
    """(rows, columns) to move a gesture by, for each of `EDGES`."""
    rows, columns = window.shape[1:]
    top, bottom, left, right = bounding_box(window, threshold)
    return [(-top, 0), (rows - 1 - bottom, 0), (0, -left), (0, columns - 1 - right)]


def shifted(window: NDArray[np.floating], rows: int, columns: int) -> NDArray[np.floating]:
    """A window (T, R, C) moved by whole taxels; what leaves the sensor is lost, what comes in is zero."""
    out = np.zeros_like(window)
    height, width = window.shape[1:]
    to_rows, to_columns = slice(max(rows, 0), height + min(rows, 0)), slice(max(columns, 0), width + min(columns, 0))
    from_rows, from_columns = (
        slice(max(-rows, 0), height - max(rows, 0)),
        slice(max(-columns, 0), width - max(columns, 0)),
    )
    out[:, to_rows, to_columns] = window[:, from_rows, from_columns]
    return out


@dataclass(frozen=True, slots=True)
class Copies:
    """What Algorithm 1 makes of G samples: 4 G more, edge by edge."""

    samples: Samples
    source: NDArray[np.int64]  # (4 G,) the sample that each was made of
    same: NDArray[np.bool_]  # (4 G,) whether the shift was zero: the gesture itself


def copies(samples: Samples, threshold: float = THRESHOLD) -> Copies:
    """All four copies of every sample."""
    count, edges = len(samples), len(EDGES)
    frames = np.zeros((edges, *samples.frames.shape), samples.frames.dtype)
    same = np.zeros((edges, count), bool)
    for i in range(count):
        span = slice(samples.offsets[i], samples.offsets[i + 1])
        window = samples.frames[span]
        for edge, (rows, columns) in enumerate(shifts(window, threshold)):
            frames[edge, span] = shifted(window, rows, columns)
            same[edge, i] = rows == columns == 0
    starts = np.concatenate([samples.offsets[:-1] + edge * samples.offsets[-1] for edge in range(edges)])
    made = Samples(
        frames.reshape(-1, *frames.shape[2:]),
        np.append(starts, edges * samples.offsets[-1]).astype(np.int64),
        *(np.concatenate([getattr(samples, name)] * edges) for name in OF_EACH),
    )
    return Copies(made, np.tile(np.arange(count), edges), same.ravel())
