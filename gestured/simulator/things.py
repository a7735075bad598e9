"""Non-gestures that no fingertip makes: palms, arms, objects, sleeves, folds, electrical noise."""

import math

import numpy as np

from gestured.simulator.kinematics import Array, grid, stroke_progress, wander
from gestured.simulator.occasion import Maker, Occasion, named
from gestured.simulator.people import Artefact, Press

Pair = tuple[float, float]


def blob(
    occasion: Occasion,
    t: Array,
    x: float | Array,
    y: float | Array,
    force: float | Array,
    size: Pair,
    fades_s: Pair,
    *,
    start: float = 0.0,
    unrest: float = 0.08,
    flatness: float = 1.2,
) -> Press:
    """A contact that is no fingertip, at x, y (mm) and times t (n,).

    `size`: one standard deviation along and across, in mm; `fades_s`: how long it comes, and goes.
    """
    rng, total, ones = occasion.rng, float(t[-1]), np.ones_like(t)
    level = np.clip(t / min(fades_s[0], 0.45 * total), 0.0, 1.0)
    level = level * np.clip((total - t) / min(fades_s[1], 0.45 * total), 0.0, 1.0)
    level = level * np.clip(1.0 + unrest * wander(t, rng, 0.3, 4.0), 0.0, 3.0)
    turn = rng.uniform(0.0, math.pi)
    return Press(t + start, x * ones, y * ones, force * level, *size, turn, 0.1, flatness, False)


def between(occasion: Occasion, *ranges: Pair) -> Pair:
    """Two random numbers, one from each of two ranges."""
    (a, b), (c, d) = ranges
    return float(occasion.rng.uniform(a, b)), float(occasion.rng.uniform(c, d))


def resting_hand(occasion: Occasion, duration_s: float) -> Press:
    """The heel of the hand, or an idle finger, that lies lightly on the pad's edge during a gesture."""
    rng, t = occasion.rng, grid(duration_s)
    side = 1.0 if occasion.person.right_handed else -1.0
    x = occasion.width * (0.5 + side * rng.uniform(0.3, 0.55))
    y = occasion.height * rng.uniform(-0.08, 0.12)
    if rng.random() < 0.5:
        return blob(occasion, t, x, y, rng.uniform(0.2, 0.6), between(occasion, (8.0, 14.0), (5.0, 9.0)), (0.08, 0.1))
    return blob(occasion, t, x, y, rng.uniform(0.1, 0.3), (4.0, 3.5), (0.08, 0.1))


def palm(occasion: Occasion) -> list[Press]:
    """A flat hand: three to seven large patches that land within 0.15 s, often with one that is much larger."""
    rng = occasion.rng
    total = rng.uniform(0.2, 2.2)
    cx, cy = occasion.spot(0.1 * occasion.width, 0.1 * occasion.height)
    spread = rng.uniform(0.1, 0.36) * occasion.small
    sizes = [between(occasion, (5.0, 13.0), (4.0, 9.0)) for _ in range(int(rng.integers(3, 8)))]
    if rng.random() < 0.5:
        sizes[0] = between(occasion, (14.0, 26.0), (10.0, 18.0))
    made = []
    for size in sizes:
        first = rng.uniform(0.0, min(0.15, 0.3 * total))
        t = grid(total - first)
        (dx, dy), (vx, vy) = rng.normal(0.0, spread, 2), rng.normal(0.0, 3.0, 2)
        force = occasion.person.force * rng.uniform(0.5, 2.5)
        fades = between(occasion, (0.03, 0.2), (0.03, 0.2))
        made.append(blob(occasion, t, cx + dx + vx * t, cy + dy + vy * t, force, size, fades, start=first))
    return made


def heel_rest(occasion: Occasion) -> list[Press]:
    """The heel of the hand lies heavily on an edge for seconds: a large patch, or two."""
    rng, t = occasion.rng, grid(occasion.rng.uniform(1.0, 4.0))
    edge = rng.uniform(-0.5, 0.5)
    places = [(edge, -0.42), (edge, 0.42), (-0.42, edge), (0.42, edge)]
    px, py = places[int(rng.choice(4, p=[0.55, 0.1, 0.15, 0.2]))]
    sway = rng.uniform(0.2, 2.0)
    x = occasion.width * (0.5 + px) + sway * wander(t, rng, 0.2, 1.0)
    y = occasion.height * (0.5 + py) + sway * wander(t, rng, 0.2, 1.0)
    fades = between(occasion, (0.05, 0.4), (0.05, 0.4))
    made = [blob(occasion, t, x, y, rng.uniform(1.0, 6.0), between(occasion, (9.0, 18.0), (6.0, 11.0)), fades)]
    if rng.random() < 0.4:
        dx, dy = rng.normal(0.0, 22.0), rng.normal(0.0, 12.0)
        size = between(occasion, (6.0, 12.0), (5.0, 9.0))
        made.append(blob(occasion, t, x + dx, y + dy, rng.uniform(0.5, 3.0), size, fades))
    return made


def forearm(occasion: Occasion) -> list[Press]:
    """An arm laid across the pad: a long band that comes and goes slowly and rolls a little."""
    rng, t = occasion.rng, grid(occasion.rng.uniform(0.6, 3.5))
    x, y = occasion.spot(0.1 * occasion.width, 0.1 * occasion.height)
    dx, dy = rng.normal(0.0, 0.12, 2) * occasion.small
    u = t / t[-1]
    size = rng.uniform(0.3, 0.7) * occasion.small, rng.uniform(7.0, 16.0)
    fades = between(occasion, (0.1, 0.6), (0.1, 0.6))
    return [blob(occasion, t, x + dx * u, y + dy * u, rng.uniform(2.0, 9.0), size, fades)]


def wipe(occasion: Occasion) -> list[Press]:
    """A flat hand or a cloth wipes over the pad: large heavy patches cross it, once or to and fro."""
    rng = occasion.rng
    t = grid(float(np.clip(rng.uniform(0.4, 2.5) / occasion.rate, 0.3, 3.5)))
    u = t / t[-1]
    once = rng.random() < 0.5
    way = stroke_progress(u, rng) if once else 0.5 - 0.5 * np.cos(math.pi * rng.uniform(2.0, 5.0) * u)
    along, heading = (way - 0.5) * rng.uniform(0.6, 1.3) * occasion.small, rng.uniform(-math.pi, math.pi)
    cx, cy = occasion.spot(0.2 * occasion.width, 0.2 * occasion.height)
    x, y = cx + along * math.cos(heading), cy + along * math.sin(heading)
    made = []
    for _ in range(int(rng.integers(1, 4))):
        dx, dy = rng.normal(0.0, 10.0, 2)
        size, fades = between(occasion, (9.0, 20.0), (6.0, 12.0)), between(occasion, (0.03, 0.3), (0.03, 0.3))
        made.append(
            blob(occasion, t, x + dx, y + dy, rng.uniform(0.8, 4.0), size, fades, unrest=rng.uniform(0.05, 0.3))
        )
    return made


def object_put_down(occasion: Occasion) -> list[Press]:
    """A thing is put down for 0.4 to 5 s: a cup's ring, edges, a block or feet, with hard borders and no tremor."""
    rng = occasion.rng
    t = grid(rng.uniform(0.4, 5.0))
    x, y = occasion.spot(0.1 * occasion.width, 0.1 * occasion.height, beyond=0.2)
    parts: list[tuple[float, float, Pair]]  # (x, y, size) of each part, mm from the middle
    form = int(rng.integers(4))
    if form == 0:
        radius, count = rng.uniform(12.0, 38.0), int(rng.integers(6, 13))
        around = 2.0 * math.pi * np.arange(count) / count
        parts = [(radius * math.cos(a), radius * math.sin(a), (4.0, 3.0)) for a in around]
    elif form == 1:
        parts = [(*rng.normal(0.0, 20.0, 2), (rng.uniform(10.0, 25.0), 3.0)) for _ in range(2)]
    elif form == 2:
        parts = [(0.0, 0.0, between(occasion, (8.0, 25.0), (8.0, 20.0)))]
    else:
        feet = int(rng.integers(1, 5))
        parts = [(*rng.normal(0.0, 12.0, 2), between(occasion, (2.0, 6.0), (2.0, 4.0))) for _ in range(feet)]
    blow = rng.uniform(0.4, 4.0) * (1.0 + rng.uniform(0.0, 1.5) * np.exp(-t / 0.05))
    fades = between(occasion, (0.01, 0.06), (0.03, 0.2))
    return [
        blob(occasion, t, x + dx, y + dy, blow * rng.uniform(0.3, 1.2), size, fades, unrest=0.01, flatness=2.5)
        for dx, dy, size in parts
    ]


def sleeve_brush(occasion: Occasion) -> list[Press]:
    """Cloth brushes over the pad: one to four weak, large, unsteady patches cross it in 0.3 to 1.8 s."""
    rng = occasion.rng
    total, heading = rng.uniform(0.3, 1.8), rng.uniform(-math.pi, math.pi)
    across = rng.uniform(0.5, 1.6) * occasion.small
    made = []
    for _ in range(int(rng.integers(1, 5))):
        first = rng.uniform(0.0, 0.3) * total
        t = grid(total - first)
        along = across * (t / t[-1] - 0.5)
        x = occasion.width * rng.uniform(0.25, 0.75) + along * math.cos(heading) + 4.0 * wander(t, rng, 0.5, 3.0)
        y = occasion.height * rng.uniform(0.25, 0.75) + along * math.sin(heading) + 4.0 * wander(t, rng, 0.5, 3.0)
        size, fades = between(occasion, (7.0, 24.0), (3.5, 10.0)), between(occasion, (0.05, 0.5), (0.05, 0.5))
        unrest = rng.uniform(0.2, 0.8)
        made.append(blob(occasion, t, x, y, rng.uniform(0.3, 2.2), size, fades, start=first, unrest=unrest))
    return made


def wrinkle(occasion: Occasion) -> list[Press]:
    """The fabric is pulled: a long ridge appears along a fold, shifts, and relaxes."""
    rng, t = occasion.rng, grid(occasion.rng.uniform(0.4, 3.0))
    x, y = occasion.spot(0.1 * occasion.width, 0.1 * occasion.height)
    dx, dy = rng.normal(0.0, 8.0, 2)
    u = t / t[-1]
    size = rng.uniform(0.25, 0.8) * occasion.small, rng.uniform(3.0, 6.0)
    fades = between(occasion, (0.05, 0.8), (0.1, 1.0))
    unrest = rng.uniform(0.05, 0.4)
    return [blob(occasion, t, x + dx * u, y + dy * u, rng.uniform(0.8, 5.0), size, fades, unrest=unrest)]


def electrical_burst(occasion: Occasion) -> list[Artefact]:
    """Interference for 0.04 to 3 s: on all taxels, a row, a column, a block or scattered taxels, up to four times."""
    rng = occasion.rng
    made, start = [], 0.0
    for _ in range(int(rng.integers(1, 5))):
        stop = start + rng.uniform(0.04, 0.6)
        form = str(rng.choice(["all", "row", "column", "block", "taxels"]))
        height = rng.uniform(0.2, 2.0) * rng.choice([1.0, 1.0, -1.0])
        made.append(Artefact(start, stop, form, height, rng.uniform(0.2, 1.0)))
        start = stop + rng.uniform(0.0, 0.2)
    return made


def spike(occasion: Occasion) -> list[Artefact]:
    """One taxel jumps for a frame or two."""
    rng = occasion.rng
    return [Artefact(0.0, rng.uniform(0.01, 0.08), "taxel", rng.uniform(0.4, 4.0), 0.3)]


THINGS: dict[str, Maker] = named(
    palm, heel_rest, forearm, wipe, object_put_down, sleeve_brush, wrinkle, electrical_burst, spike
)
