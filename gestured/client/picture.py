"""Pictures of the pressure for a terminal: one gesture as a whole, and the finger as it moves."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

SIZE = 9  # columns and rows of a picture; two rows share a line of text
SHADES = " ░▒▓█"
BLOCKS = {(False, False): " ", (True, False): "▀", (False, True): "▄", (True, True): "█"}
FAINTEST = 0.15  # of 0 to 1: what is fainter is left dark
BACKGROUND, FAINT, GREYS = 233, 238, 17  # of 256 colours: two greys, and how many greys follow
RAMP = (17, 18, 60, 66, 102, 144, 186, 228)  # of 256-colour terminals, from dark blue to yellow, ever brighter
LINES, COLUMNS = 16, 40  # characters of a moving picture: beside it stands text, in 80 x 24
ARROWS = "→↘↓↙←↖↑↗"  # by eighths of a turn, clockwise from the right
MOVED = 0.5  # taxel pitches: a shorter way has no direction
LATELY = 4  # places of a path that tell its direction


def trace(frames: NDArray[np.generic]) -> NDArray[np.float32]:
    """Where the finger went, brighter the later: (T, R, C) counts -> (9, 9) from 0 to 1.

    The first frame counts as idle: what it holds is subtracted.
    """
    values = np.asarray(frames, np.float32)
    rise = np.maximum(values - values[0], 0.0)
    peak = float(rise.max())
    if peak <= 0.0:
        return np.zeros((SIZE, SIZE), np.float32)
    age = np.linspace(0.3, 1.0, len(rise), dtype=np.float32)[:, None, None]
    return shrunk((age * rise / peak).max(axis=0))


def shrunk(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """(R, C) from 0 to 1 -> (9, 9): the nearest taxels of any grid."""
    rows = np.linspace(0, picture.shape[0] - 1, SIZE).round().astype(int)
    columns = np.linspace(0, picture.shape[1] - 1, SIZE).round().astype(int)
    return np.asarray(picture[np.ix_(rows, columns)], np.float32)


def draw(picture: NDArray[np.float32], colour: bool) -> list[str]:
    """Five lines of nine characters: half blocks in grey, or shades where there is no colour."""
    padded = np.vstack([picture, np.zeros((len(picture) % 2, picture.shape[1]), np.float32)])
    pairs = zip(padded[0::2].tolist(), padded[1::2].tolist(), strict=True)
    paint = _coloured if colour else _shaded
    return [paint(list(zip(upper, lower, strict=True))) for upper, lower in pairs]


def _coloured(cells: list[tuple[float, float]]) -> str:
    # The block says where the finger was, the grey says when, so the picture can be read as plain text too.
    drawn = (f"\x1b[38;5;{FAINT + round(GREYS * max(c))}m{BLOCKS[c[0] > FAINTEST, c[1] > FAINTEST]}" for c in cells)
    return f"\x1b[48;5;{BACKGROUND}m" + "".join(drawn) + "\x1b[0m"


def _shaded(cells: list[tuple[float, float]]) -> str:
    return "".join(SHADES[round((len(SHADES) - 1) * max(cell))] for cell in cells)


def moving(values: NDArray[np.floating], path: Sequence[tuple[float, float]], full: float, colour: bool) -> list[str]:
    """(R, C) counts with a fixed scale from 0 to `full`, and an arrow where the finger is, the last (row, column).

    At most LINES lines of COLUMNS characters: two rows of dots in a line; taxels are enlarged, or thinned out.
    """
    rows, columns = values.shape
    zoom = max(1, min(2 * LINES // rows, COLUMNS // columns))
    height, width = min(rows * zoom, 2 * LINES), min(columns * zoom, COLUMNS)
    down = np.minimum((np.arange(height) + 0.5) * rows / height, rows - 1).astype(int)
    across = np.minimum((np.arange(width) + 0.5) * columns / width, columns - 1).astype(int)
    picture = np.clip(values / full, 0.0, 1.0)[np.ix_(down, across)]
    picture = np.vstack([picture, np.zeros((height % 2, width))])
    finger = _finger(path, height / rows, width / columns)
    lines = []
    for n, (upper, lower) in enumerate(zip(picture[0::2].tolist(), picture[1::2].tolist(), strict=True)):
        cells = list(zip(upper, lower, strict=True))
        marked = {finger[1]: finger[2]} if finger is not None and finger[0] == n else {}
        lines.append((_pixels if colour else _letters)(cells, marked))
    return lines


def _finger(path: Sequence[tuple[float, float]], down: float, across: float) -> tuple[int, int, str] | None:
    """Line, column and arrow of the last place; None where it does not move."""
    if len(path) < 2:
        return None
    (row, column), (from_row, from_column) = path[-1], path[max(0, len(path) - LATELY)]
    if math.hypot(row - from_row, column - from_column) < MOVED:
        return None
    turn = math.atan2(row - from_row, column - from_column) / (2 * math.pi)
    return int((row + 0.5) * down / 2), int((column + 0.5) * across), ARROWS[round(8 * turn) % 8]


def _pixels(cells: list[tuple[float, float]], marked: dict[int, str]) -> str:
    drawn, last = [], ""
    for n, (upper, lower) in enumerate(cells):
        above, below = (RAMP[min(int(share * len(RAMP)), len(RAMP) - 1)] for share in (upper, lower))
        ink, sign = (16 if above > RAMP[4] else 231, marked[n]) if n in marked else (above, "▀")
        style = f"\x1b[38;5;{ink};48;5;{above if n in marked else below}m"
        drawn.append(sign if style == last else style + sign)
        last = style
    return "".join(drawn) + "\x1b[0m"


def _letters(cells: list[tuple[float, float]], marked: dict[int, str]) -> str:
    shaded = _shaded(cells)
    return "".join(marked.get(n, sign) for n, sign in enumerate(shaded))
