"""What a sensor of any grid sends while a finger moves along its rows."""

import numpy as np

RATE_HZ = 15.0


def swipes(rows: int, columns: int, sign: float = 1.0, contacts: int = 4, seed: int = 0) -> np.ndarray:
    """(T, R, C) counts: an idle second and a half, then swipes across with a quiet second after each."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns]
    frames = [np.zeros((rows, columns))] * 22
    for n in range(contacts):
        row = (n + 1) * (rows - 1) / (contacts + 1)
        for column in np.linspace(1, columns - 2, 7):
            frames.append(sign * 300 * np.exp(-((y - row) ** 2 + (x - column) ** 2) / 1.6))
        frames += [np.zeros((rows, columns))] * 15
    return 500 + np.array(frames) + rng.normal(0, 2, (len(frames), rows, columns))
