"""Motion history images: a whole gesture as one image, in which what was pressed last is brightest.

A taxel is 1 while it is pressed and falls linearly afterwards, to 0 after `decay_s` (Bobick and Davis 2001, with the
pressed taxels in the place of moving ones). The image is taken at the last frame with contact.

Left open by the paper: the decay. Ours is as long as the gesture itself (0 stands for that), so that a slow swipe and
a fast one leave the same picture. A taxel is pressed from a fifth of the gesture's peak on.
"""

import numpy as np
from numpy.typing import NDArray

from gestured.lab.samples import WINDOW
from gestured.model.features import PRESSED

WHOLE = 0.0  # the decay takes as long as the gesture


def motion_history(window: NDArray[np.floating], decay_s: float = WHOLE) -> NDArray[np.float32]:
    """(T, R, C) window -> (R, C) image, 0..1."""
    pressed = window >= PRESSED
    frames = np.flatnonzero(pressed.any(axis=(1, 2)))
    if not len(frames):
        return np.zeros(window.shape[1:], np.float32)
    pressed = pressed[frames[0] : frames[-1] + 1]
    time = len(pressed)
    age = pressed[::-1].argmax(axis=0)  # frames since it was pressed
    decay = decay_s * WINDOW.rate_hz if decay_s > 0 else float(time)
    image = np.maximum(1.0 - age / decay, 0.0) * pressed.any(axis=0)
    return np.asarray(image, np.float32)
