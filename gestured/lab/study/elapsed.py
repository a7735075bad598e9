"""How early a network knows: asked in the middle of a gesture, at its end, and while the finger is gone.

The networks are those of the participants protocol, trained on whole gestures. Asked after a share of the gesture,
they see its frames up to there, scaled by their own peak: nobody knows yet how hard the finger will press. After its
end they see what the sensor shows when nobody touches it: frames drawn from the window's own quiet ones before the
first touch.
"""

import math

import numpy as np
import torch
from numpy.typing import NDArray

from gestured.core.features import ACTIVE
from gestured.lab.prefixes import floors
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.study.training import Indices, Net

SHARES = (0.25, 0.5, 0.75, 1.0)
AFTER = (0, 1, 2, 3, 4)  # frames: 0 to 267 ms
POINTS: tuple[dict[str, float], ...] = (
    *({"share": s} for s in SHARES),
    *({"after_s": round(k / WINDOW.rate_hz, 3)} for k in AFTER),
)


def moments(window: NDArray[np.floating]) -> tuple[int, list[int]]:
    """(T, R, C) -> index of the first frame with contact, and of the frame at each of `SHARES`."""
    touched = np.flatnonzero(window.max(axis=(1, 2)) >= ACTIVE)
    first, last = (int(touched[0]), int(touched[-1])) if len(touched) else (0, len(window) - 1)
    return first, [first + max(math.ceil(share * (last - first + 1)), 1) - 1 for share in SHARES]


def answers_over_time(model: Net, samples: Samples, chosen: Indices, seed: int) -> NDArray[np.int64]:
    """(n, points) class that the network names for each chosen gesture at each of `POINTS`."""
    out, least = np.zeros((len(chosen), len(POINTS)), np.int64), floors(samples)
    for row, i in enumerate(chosen):
        window = samples.window(int(i))
        first, at = moments(window)
        last = at[-1]
        quiet = window[:first] if first else np.zeros_like(window[:1])
        idle = quiet[np.random.default_rng([seed, int(i)]).integers(0, len(quiet), AFTER[-1])]
        x = torch.from_numpy(np.concatenate([window[: last + 1], idle]))[None]
        places = torch.tensor([last + k for k in AFTER])
        with torch.no_grad():
            for k, end in enumerate(at):
                so_far = window[: end + 1] / max(float(window[: end + 1].max()), float(least[i]))
                out[row, k] = model.module(torch.from_numpy(so_far)[None], torch.tensor([end])).argmax(1)[0]
            out[row, len(at) :] = model.module(x.expand(len(places), -1, -1, -1), places).argmax(1).numpy()
    return out
