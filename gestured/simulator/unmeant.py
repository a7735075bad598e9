"""Short contacts of everyday life that nobody means: bumps, grazes, pats, pokes, slides, folds, fidgeting, hands.

The ranges are wide on purpose: nobody has measured how a sleeve, a cup or a child touches a sensor, and a model that
learns from one way to draw a thing recognises that drawing, not the thing.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gestured.simulator.kinematics import Array, arc, grid, stroke_progress, wander
from gestured.simulator.occasion import Maker, Occasion, named
from gestured.simulator.people import Press
from gestured.simulator.strokes import touch_down
from gestured.simulator.things import blob, palm

Places = Sequence[tuple[float, float]]  # mm


def even(occasion: Occasion, low: float, high: float) -> float:
    """A random number between low and high, log-uniform."""
    return float(math.exp(occasion.rng.uniform(math.log(low), math.log(high))))


def _oval(occasion: Occasion, low: float, high: float) -> tuple[float, float]:
    """Length and width (mm, one standard deviation) of something at most twice as long as wide."""
    length = even(occasion, low, high)
    return length, length * float(occasion.rng.uniform(0.5, 1.0))


def _fades(occasion: Occasion) -> tuple[float, float]:
    """The seconds in which a contact comes and in which it goes, independent of each other."""
    return even(occasion, 0.02, 0.5), even(occasion, 0.02, 0.5)


def _passage(occasion: Occasion, t: Array, length: float) -> tuple[Array, Array]:
    """x, y (n,) in mm of a bent way of that length over the pad, in any direction; its ends may be beside the pad."""
    rng = occasion.rng
    way = stroke_progress(t / t[-1], rng, moving_ends=float(rng.random()))
    dx, dy = arc(way, length, float(rng.uniform(-math.pi, math.pi)), float(rng.normal(0.0, 0.5)))
    x, y = occasion.spot(1.0, 1.0, beyond=0.4)
    return x + dx - float(dx.mean()), y + dy - float(dy.mean())


def bump(occasion: Occasion) -> list[Press]:
    """A knee, an elbow or a bag meets the pad for a moment: larger than a fingertip, with no aim."""
    x, y = occasion.spot(2.0, 2.0, beyond=0.3)
    t = grid(even(occasion, 0.04, 0.8))
    return [blob(occasion, t, x, y, even(occasion, 0.3, 4.0), _oval(occasion, 8.0, 28.0), _fades(occasion))]


def graze(occasion: Occasion) -> list[Press]:
    """The side of a hand, a knuckle, a cuff or a strap passes over: broader than a fingertip, or much lighter."""
    rng = occasion.rng
    light = rng.random() < 0.15
    size = _oval(occasion, 3.5, 7.0) if light else _oval(occasion, 8.0, 22.0)
    made, start = [], 0.0
    for _ in range(int(rng.choice([1, 2, 3], p=[0.7, 0.2, 0.1]))):
        t = grid(even(occasion, 0.08, 1.8))
        x, y = _passage(occasion, t, occasion.small * float(rng.uniform(0.2, 1.6)))
        force = even(occasion, 0.06, 0.2) if light else even(occasion, 0.15, 2.5)
        unrest = float(rng.uniform(0.1, 0.9))
        made.append(blob(occasion, t, x, y, force, size, _fades(occasion), start=start, unrest=unrest))
        start += float(t[-1] + rng.uniform(0.05, 0.6))
    return made


def pat(occasion: Occasion) -> list[Press]:
    """Flat fingers or a whole hand pat, once to five times: several patches at once, each for a moment."""
    rng = occasion.rng
    cx, cy = occasion.spot(4.0, 4.0, beyond=0.3)
    spread, count = float(rng.uniform(0.1, 0.35)) * occasion.small, int(rng.integers(2, 7))
    places = [(cx + float(rng.normal(0.0, spread)), cy + float(rng.normal(0.0, spread))) for _ in range(count)]
    sizes = [_oval(occasion, 3.5, 14.0) for _ in places]
    made, start = [], 0.0
    for _ in range(int(rng.integers(1, 6))):
        length, force = even(occasion, 0.05, 0.45), even(occasion, 0.3, 2.5)
        for (x, y), size in zip(places, sizes, strict=True):
            t, late = grid(length), float(rng.uniform(0.0, 0.05))
            level = force * float(rng.uniform(0.2, 1.0))
            made.append(blob(occasion, t, x, y, level, size, _fades(occasion), start=start + late))
        start += length + float(rng.uniform(0.1, 0.6))
    return made


def poke(occasion: Occasion) -> list[Press]:
    """A key or a pen, longer than a tap, or a buckle or the edge of a cup, broader than a finger."""
    rng = occasion.rng
    x, y = occasion.spot(2.0, 2.0, beyond=0.2)
    made, start = [], 0.0
    for _ in range(int(rng.integers(1, 4))):
        t = grid(even(occasion, 0.35, 2.0) if (sharp := rng.random() < 0.4) else even(occasion, 0.06, 1.5))
        dx, dy = rng.normal(0.0, 6.0, 2)
        u = t / t[-1]
        size = _oval(occasion, 1.5, 3.0) if sharp else _oval(occasion, 8.0, 14.0)
        flat = float(rng.uniform(1.5, 3.5))
        force = even(occasion, 0.5, 6.0)
        place = x + dx * u, y + dy * u
        made.append(blob(occasion, t, *place, force, size, _fades(occasion), start=start, flatness=flat))
        start += float(t[-1] + rng.uniform(0.1, 0.8))
    return made


def slide(occasion: Occasion) -> list[Press]:
    """A telephone, a cup or a purse is put down, pushed, and taken away."""
    rng = occasion.rng
    before, move, after = float(rng.uniform(0.0, 2.0)), even(occasion, 0.2, 2.5), float(rng.uniform(0.0, 2.0))
    t = grid(before + move + after)
    way = np.clip((t - before) / move, 0.0, 1.0)
    x, y = _passage(occasion, np.maximum(way, 1e-3), occasion.small * float(rng.uniform(0.1, 1.0)))
    flat = float(rng.uniform(1.0, 3.5))
    force = even(occasion, 0.4, 5.0)
    return [blob(occasion, t, x, y, force, _oval(occasion, 5.0, 28.0), _fades(occasion), flatness=flat)]


def fold(occasion: Occasion) -> list[Press]:
    """A coat, a bag or a blanket lies and moves: weak broad patches come, wander and go for seconds."""
    rng = occasion.rng
    total = even(occasion, 0.8, 8.0)
    made = []
    for _ in range(int(rng.integers(2, 8))):
        start = float(rng.uniform(0.0, 0.8 * total))
        t = grid(max(float(rng.uniform(0.2, 1.0)) * (total - start), 0.1))
        cx, cy = occasion.spot(2.0, 2.0, beyond=0.4)
        reach = even(occasion, 1.0, 25.0)
        x, y = (c + reach * wander(t, rng, 0.1, 2.0) for c in (cx, cy))
        size, force = _oval(occasion, 5.0, 30.0), even(occasion, 0.1, 2.0)
        unrest = float(rng.uniform(0.2, 0.9))
        made.append(blob(occasion, t, x, y, force, size, _fades(occasion), start=start, unrest=unrest))
    return made


def hands(occasion: Occasion) -> list[Press]:
    """Somebody else's hands, or a child's: palms and pats one after the other for seconds."""
    made, start = [], 0.0
    for _ in range(int(occasion.rng.integers(2, 6))):
        some = (palm if occasion.rng.random() < 0.5 else pat)(occasion)
        made += [replace(press, t=press.t + start) for press in some]
        start += float(occasion.rng.uniform(0.2, 1.5))
    return made


def landing(occasion: Occasion) -> list[Press]:
    """An arm or a hand lands and lifts again, once to three times, until it lies well."""
    rng = occasion.rng
    x, y = occasion.spot(1.0, 1.0, beyond=0.5)
    size, made, start = _oval(occasion, 8.0, 0.6 * occasion.small + 9.0), [], 0.0
    for _ in range(int(rng.integers(1, 4))):
        t = grid(even(occasion, 0.08, 1.5))
        dx, dy = rng.normal(0.0, 0.1, 2) * occasion.small
        vx, vy = rng.normal(0.0, 15.0, 2)
        u = t - float(t[-1]) / 2
        force = even(occasion, 0.3, 6.0)
        made.append(blob(occasion, t, x + dx + vx * u, y + dy + vy * u, force, size, _fades(occasion), start=start))
        start += float(t[-1] + rng.uniform(0.05, 0.7))
    return made


def fidget(occasion: Occasion) -> list[Press]:
    """One or two fingers wander on the fabric absent-mindedly."""
    return playing_rub(occasion, [occasion.spot(2.0, 2.0) for _ in range(int(occasion.rng.choice([1, 1, 1, 2])))])


def playing_tap(occasion: Occasion, places: Places) -> list[Press]:
    """One of the fingers at these places lifts and falls."""
    x, y = places[int(occasion.rng.integers(len(places)))]
    return [touch_down(occasion, x, y, even(occasion, 0.05, 0.6), 0.0, even(occasion, 0.2, 1.4))]


def playing_drum(occasion: Occasion, places: Places) -> list[Press]:
    """The fingers fall one after the other, three to twelve times."""
    rng, made, start = occasion.rng, [], 0.0
    pace = even(occasion, 0.05, 0.3)
    for k in range(int(rng.integers(3, 13))):
        x, y = places[k % len(places)]
        made.append(touch_down(occasion, x, y, even(occasion, 0.05, 0.3), start, even(occasion, 0.2, 1.2)))
        start += pace * float(rng.uniform(0.6, 1.6))
    return made


def playing_rub(occasion: Occasion, places: Places) -> list[Press]:
    """The fingers at these places rub, scratch or wander there, all together or one alone."""
    rng = occasion.rng
    total = even(occasion, 0.8, 6.0)
    t = grid(total)
    reach, pace = even(occasion, 1.5, 0.2 * occasion.small), even(occasion, 0.5, 3.0)
    dx, dy = (reach * wander(t, rng, 0.3 * pace, 1.5 * pace) for _ in range(2))
    some = places if rng.random() < 0.5 else [places[int(rng.integers(len(places)))]]
    made = []
    for x, y in some:
        force, unrest = even(occasion, 0.1, 1.0), float(rng.uniform(0.0, 1.0))
        level = force * np.clip(1.0 + unrest * wander(t, rng, 0.3, 3.0), 0.0, 3.0)
        press = occasion.finger(t, x + dx, y + dy)
        made.append(replace(press, force=press.force * level))
    return made


def playing_press(occasion: Occasion, places: Places) -> list[Press]:
    """A finger presses slowly, and lets go."""
    x, y = places[int(occasion.rng.integers(len(places)))]
    total = even(occasion, 0.4, 4.0)
    return [touch_down(occasion, x, y, total, 0.0, even(occasion, 0.1, 1.0))]


def playing_stretch(occasion: Occasion, places: Places) -> list[Press]:
    """All fingers slide a little way together: the hand stretches, or is moved."""
    rng, t = occasion.rng, grid(even(occasion, 0.15, 1.5))
    length, heading = even(occasion, 2.0, 0.12 * occasion.small), float(rng.uniform(-math.pi, math.pi))
    way = length * stroke_progress(t / t[-1], rng)
    force = even(occasion, 0.1, 1.0)
    return [
        occasion.finger(t, x + way * math.cos(heading), y + way * math.sin(heading), force=force) for x, y in places
    ]


SHORT: dict[str, Maker] = named(bump, graze, landing, pat, poke, slide, fold, fidget, hands)
# By kind: what the fingers of a resting hand do, from an occasion and the places of the fingers.
PLAYED: dict[str, Callable[..., list[Press]]] = named(
    playing_tap, playing_drum, playing_rub, playing_press, playing_stretch
)
