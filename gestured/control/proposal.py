"""The settings for the messages that arrive, as lines for the configuration file."""

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from gestured.control.sight import Seen
from gestured.core.address import SIDES, is_sensor
from gestured.core.beside.habits import ALIKE, Habits, neighbours_alike
from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.mounting import Mounting
from gestured.core.scene import Scene

TRAJECTORY = "/trajectory"
STEP_S = 1e-6  # the least time from frame to frame, since several may have been read at once

Grid = tuple[int, int]
DEFAULTS = Scene(("any",), (9, 9))


def propose(rows: Sequence[Seen], told: Scene | None = None) -> list[str]:
    """Lines for the configuration file, from messages that look like frames: many numbers, or one blob.

    `told` is the scene of the daemon that the messages reach; without one the defaults count. Anybody may have sent
    the messages, so the lines hold only numbers, and names that were checked to have no meaning in TOML.
    """
    patterns: Counter[str] = Counter()
    likeliest: dict[tuple[str, str], Seen] = {}
    for seen in rows:
        split = split_address(seen.address)
        if seen.taxels() and split is not None:
            patterns[split[0]] += seen.count
            likeliest.setdefault(split, seen)
    if not patterns:
        return []
    scene = told or DEFAULTS
    pressure, *others = [pattern for pattern, _ in patterns.most_common()]
    lines = [] if pressure == scene.addresses.pressure else ["[addresses]", f'pressure = "{pressure}"']
    for (pattern, name), seen in likeliest.items():
        if pattern == pressure:
            lines += _sensor(name, seen, scene)
    hosts = {source.rpartition(":")[0].strip("[]") for seen in rows for source in seen.sources}
    refused = sorted(host for host in hosts if not scene.may_send(host))
    lines += [f"# {host} is not under allow: the daemon drops what it sends" for host in refused]
    lines = lines or [f"{'the settings of the daemon' if told else 'the defaults'} fit what arrives"]
    return lines + [f"# {other} looks like frames, too; a daemon takes one pattern" for other in others]


def _sensor(name: str, seen: Seen, scene: Scene) -> list[str]:
    """The lines for one sensor; none if the scene fits."""
    grid, inverted = scene.grid_of(name), scene.setup(name).mounting.invert
    keys = []
    if grid[0] * grid[1] not in seen.taxels():
        found = next((shape for n in seen.taxels() if (shape := _shape(seen, n)) is not None), None)
        if found is None:
            sizes = " or ".join(map(str, seen.taxels()))
            return [f"# {name}: {sizes} values are no grid of {SIDES[0]} to {SIDES[1]} rows and columns"]
        grid, remark = found
        keys.append(f'grid = "{grid[0]}x{grid[1]}"{remark}')
    habits = _habits(seen, grid, inverted)
    if not keys and habits.exchanges > habits.fits:
        keys.append(f'grid = "{grid[1]}x{grid[0]}"  # rows and columns: neighbours fit better this way round')
    if habits.falls and not habits.rises:
        keys.append(f"invert = {str(not inverted).lower()}  # its counts fell where it was touched")
    return [f"[sensors.{name}]", *keys] if keys else []


def _shape(seen: Seen, taxels: int) -> tuple[Grid, str] | None:
    """The grid of so many taxels in which a touch looks like a finger's, else the squarest, with a remark.

    None if there is no such grid.
    """
    sides = range(SIDES[0], SIDES[1] + 1)
    shapes = [(rows, taxels // rows) for rows in sides if taxels % rows == 0 and taxels // rows in sides]
    shapes.sort(key=lambda shape: (abs(shape[0] - shape[1]), -shape[0]))
    if not shapes:
        return None
    frames = np.array([frame.reshape(-1) for _, frame in seen.matrices(*shapes[0])])
    if len(frames):
        changes = frames - np.median(frames, axis=0)
        changes -= np.median(changes, axis=1, keepdims=True)  # an offset that all taxels share is no finger
        strongest = changes[np.abs(changes).max(axis=1).argmax()]
        alike = {shape: neighbours_alike(strongest, shape[1]) for shape in shapes}
        best = max(shapes, key=alike.__getitem__)
        if alike[best] > ALIKE:
            return best, ""
    return shapes[0], "  # a guess: touch the sensor, and ask again" if len(shapes) > 1 else ""


def _habits(seen: Seen, grid: Grid, inverted: bool) -> Habits:
    """The habits of a sensor, learned from its kept frames with the daemon's own front end."""
    front_end, habits = FrontEnd(*grid, mounting=Mounting(invert=inverted)), Habits(*grid)
    last = -np.inf
    for t, frame in seen.matrices(*grid):
        last = max(t, last + STEP_S)
        for found in front_end.push(Frame(last, frame)):
            habits.hear(found)
        habits.see(front_end)
    for found in front_end.flush(last + 1.0):
        habits.hear(found)
    habits.paused(last + 1.0)
    return habits


def split_address(address: str) -> tuple[str, str] | None:
    """(pattern, sensor) of an address: the sensor is the last part but one that can be a name, else the only one.

    None for the address of a trajectory, an address with characters that TOML may interpret, and one without a name.
    """
    if address.endswith(TRAJECTORY) or not re.fullmatch(r"(/[A-Za-z0-9_.-]+)+", address):
        return None
    parts = address.split("/")[1:]
    places = [i for i, part in enumerate(parts) if is_sensor(part)]
    if not places:
        return None
    place = places[0] if len(places) == 1 else places[-2]
    pattern = "/".join(["", *parts[:place], "{sensor}", *parts[place + 1 :]])
    return pattern, parts[place]
