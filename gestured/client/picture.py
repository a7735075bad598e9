"""Small pictures of the pressure for a terminal."""

import numpy as np
from numpy.typing import NDArray

SIZE = 9  # columns and rows of a picture; two rows share a line of text
SHADES = " ░▒▓█"
BLOCKS = {(False, False): " ", (True, False): "▀", (False, True): "▄", (True, True): "█"}
FAINTEST = 0.15  # of 0 to 1: fainter taxels are left dark
BACKGROUND, FAINT, GREYS = 233, 238, 17  # of 256 colours: two greys, and how many greys follow


def trace(frames: NDArray[np.generic]) -> NDArray[np.float32]:
    """The trace of a finger, brighter the later: (T, R, C) counts -> (9, 9) from 0 to 1.

    The first frame counts as idle and is subtracted from all.
    """
    values = np.asarray(frames, np.float32)
    rise = np.maximum(values - values[0], 0.0)
    peak = float(rise.max())
    if peak <= 0.0:
        return np.zeros((SIZE, SIZE), np.float32)
    age = np.linspace(0.3, 1.0, len(rise), dtype=np.float32)[:, None, None]
    return shrunk((age * rise / peak).max(axis=0))


def shrunk(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """A picture of any grid, shrunk to its nearest taxels: (R, C) from 0 to 1 -> (9, 9)."""
    rows = np.linspace(0, picture.shape[0] - 1, SIZE).round().astype(int)
    columns = np.linspace(0, picture.shape[1] - 1, SIZE).round().astype(int)
    return np.asarray(picture[np.ix_(rows, columns)], np.float32)


def draw(picture: NDArray[np.float32], colour: bool) -> list[str]:
    """The five lines of nine characters of a (9, 9) picture: half blocks in grey, or shades without `colour`."""
    padded = np.vstack([picture, np.zeros((len(picture) % 2, picture.shape[1]), np.float32)])
    lines = []
    for pair in zip(padded[0::2].tolist(), padded[1::2].tolist(), strict=True):
        cells = list(zip(*pair, strict=True))
        if not colour:
            lines.append("".join(SHADES[round((len(SHADES) - 1) * max(cell))] for cell in cells))
            continue
        # The block shows where the finger was, the grey when, so the picture can be read as plain text, too.
        greys = (f"\x1b[38;5;{FAINT + round(GREYS * max(c))}m{BLOCKS[c[0] > FAINTEST, c[1] > FAINTEST]}" for c in cells)
        lines.append(f"\x1b[48;5;{BACKGROUND}m{''.join(greys)}\x1b[0m")
    return lines
