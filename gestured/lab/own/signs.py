"""Signs that somebody may choose as a gesture of his own, and that no network has learned: letters and figures.

They are drawn with one finger, by the simulator's hands.
"""

import math
from functools import partial

import numpy as np

from gestured.simulator import Participant, Performance
from gestured.simulator.cohort import performed
from gestured.simulator.drawn import drawn
from gestured.simulator.kinematics import polyline
from gestured.simulator.occasion import Occasion
from gestured.simulator.people import Press

Corners = tuple[tuple[float, float], ...]  # in a square of side 1, x to the right, y upward, in the order of drawing
SIGNS: dict[str, Corners] = {
    "letter_m": ((0.0, 0.0), (0.1, 1.0), (0.5, 0.3), (0.9, 1.0), (1.0, 0.0)),
    "letter_n": ((0.0, 0.0), (0.0, 1.0), (0.8, 0.0), (0.8, 1.0)),
    "letter_s": ((0.9, 0.9), (0.4, 1.0), (0.1, 0.75), (0.5, 0.5), (0.9, 0.25), (0.6, 0.0), (0.1, 0.1)),
    "letter_z": ((0.0, 1.0), (1.0, 1.0), (0.0, 0.0), (1.0, 0.0)),
    "letter_u": ((0.0, 1.0), (0.05, 0.2), (0.4, 0.0), (0.75, 0.2), (0.8, 1.0)),
    "letter_h": ((0.0, 1.0), (0.0, 0.0), (0.05, 0.5), (0.5, 0.55), (0.6, 0.0)),
    "square": ((0.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)),
    "triangle": ((0.5, 1.0), (0.0, 0.0), (1.0, 0.0), (0.5, 1.0)),
    "arrow": ((0.0, 0.5), (1.0, 0.5), (0.65, 0.85), (1.0, 0.5), (0.65, 0.15)),
    "hook": ((0.0, 1.0), (0.0, 0.0), (0.4, 0.0), (0.4, 0.5)),
    "loop": ((0.0, 0.0), (0.5, 0.1), (0.9, 0.5), (0.6, 0.9), (0.3, 0.6), (0.6, 0.1), (1.1, 0.0)),
    "star": ((0.2, 0.0), (0.5, 1.0), (0.8, 0.0), (0.0, 0.65), (1.0, 0.65), (0.2, 0.0)),
    "letter_w": ((0.0, 1.0), (0.25, 0.0), (0.5, 0.7), (0.75, 0.0), (1.0, 1.0)),
    "letter_p": ((0.0, 0.0), (0.0, 1.0), (0.5, 0.95), (0.6, 0.7), (0.45, 0.5), (0.05, 0.45)),
    "letter_k": ((0.0, 1.0), (0.0, 0.0), (0.6, 1.0), (0.05, 0.5), (0.7, 0.0)),
    "letter_e": ((0.1, 0.5), (0.8, 0.55), (0.5, 0.95), (0.1, 0.6), (0.2, 0.1), (0.8, 0.1)),
    "figure_two": ((0.0, 0.8), (0.4, 1.0), (0.75, 0.75), (0.0, 0.0), (0.9, 0.0)),
    "figure_three": ((0.0, 0.95), (0.6, 0.9), (0.3, 0.5), (0.7, 0.3), (0.4, 0.0), (0.0, 0.1)),
    "house": ((0.0, 0.0), (0.0, 0.6), (0.5, 1.0), (1.0, 0.6), (1.0, 0.0)),
    "stairs": ((0.0, 1.0), (0.35, 1.0), (0.35, 0.6), (0.7, 0.6), (0.7, 0.2), (1.05, 0.2)),
    "clip": ((0.0, 0.0), (0.0, 1.0), (0.5, 1.0), (0.5, 0.2), (0.25, 0.2), (0.25, 0.7)),
    "bow": ((0.0, 1.0), (0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)),
}
LEARNED, JUDGED = tuple(SIGNS)[::2], tuple(SIGNS)[1::2]  # to learn thresholds from, and to judge them by
LEG_S = 0.28  # for a leg as long as half of the pad


def sign(
    kind: str,
    participant: Participant,
    rng: np.random.Generator,
    speed: str = "normal",
    inclination: int = 1,
    extent: tuple[float, float] = (72.0, 72.0),
) -> Performance:
    """One sign as one person draws it, in the manner of `simulator.perform`."""
    return performed(kind, partial(_made, SIGNS[kind]), participant, rng, speed, inclination, extent)


def _made(corners: Corners, occasion: Occasion) -> list[Press]:
    rng, far = occasion.rng, 0.5 * occasion.small
    size = occasion.small * (0.45 + 0.4 * occasion.reach())
    points = [(size * (x + rng.normal(0.0, 0.04)), size * (y + rng.normal(0.0, 0.04))) for x, y in corners]
    legs = [
        float(np.clip(LEG_S * (math.dist(a, b) / far) ** 0.4 / occasion.rate, 0.1, 0.9))
        for a, b in zip(points[:-1], points[1:], strict=True)
    ]
    t, x, y = polyline(points, legs, float(rng.uniform(0.1, 0.35)), 0.0)
    return drawn(occasion, t, x, y)
