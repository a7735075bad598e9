"""How accurate a contact's place is, against the true places of two generators, and on real frames.

    python -m experiments.where --real FOLDER --document docs/where.md

Each take is of another person on another sensor; its frames pass through the front end as in the daemon. Errors are in
taxel pitches. The true places of real frames (CapFingerId, 27 x 15) are not known: the place in a frame is compared
with that in the same frame averaged to 9 x 9.
"""

import argparse
import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.foreign.hands import draw_person
from experiments.foreign.hands import perform as perform_foreign
from experiments.foreign.sensors import draw_sensor
from experiments.foreign.sensors import record as record_foreign
from experiments.pages import add_document, tell
from gestured.core.events import Where
from gestured.core.frames import Segment
from gestured.core.spots import spots
from gestured.core.where import where
from gestured.lab.dataset import cuts
from gestured.lab.progress import progress
from gestured.lab.table import Table, Value
from gestured.lab.train import REAL_FILES
from gestured.record.arrays import read
from gestured.simulator import Participant, SimulatedSensor, any_sensor, generator, perform

Array = NDArray[np.float64]
Grid = tuple[int, int]
GRIDS: tuple[Grid, ...] = ((9, 9), (27, 15))
ONE = ("one_tap", "swipe_up", "swipe_down", "swipe_left", "swipe_right", "circle_clockwise")
TWO = ("swipe_up_two_fingers", "swipe_down_two_fingers")
FIRST = 7000  # the first person's seed; no training has drawn it
PAD_MM = 72.0  # shorter side of a good simulated sensor, whatever its grid
DOWN, FIRM = (
    0.15,
    0.3,
)  # of a usual press: from there on a finger is on the sensor, and a frame is sure to show it
APART = (1.5, 2.0, 2.5, 3.0, 4.0, math.inf)  # pitches between two fingers: edges of the table's rows
TELLS = ("gestured.core.front_end", "gestured.core.where")  # the modules that decide a place
TOUCHED = 60  # counts of a real frame that shows a finger


@dataclass(frozen=True)
class Finger:
    """Where a finger truly was at times (n,) s: (n,) rows and columns of the grid, and how hard it pressed."""

    t: Array
    row: Array
    column: Array
    force: Array

    def at(self, t: float) -> tuple[float, float] | None:
        """Row and column at `t` s; None if the finger did not press firmly."""
        if not self.t[0] <= t <= self.t[-1] or np.interp(t, self.t, self.force) < FIRM:
            return None
        return float(np.interp(t, self.t, self.row)), float(np.interp(t, self.t, self.column))


@dataclass(frozen=True)
class Take:
    """What a sensor sent while a person touched it, and where the fingers were."""

    frames: NDArray[np.generic]
    times: Array
    behind_s: float  # s from the middle of the time that a frame shows to the frame's time
    fingers: list[Finger]


def _finger(t: Array, x: Array, y: Array, force: Array, grid: Grid) -> Finger:
    """A finger at columns x and, counted upward, rows y; a place beyond the outermost taxels counts as at them."""
    return Finger(t, np.clip(grid[0] - 1 - y, 0, grid[0] - 1), np.clip(x, 0, grid[1] - 1), force)


def simulated(kind: str, good: bool, grid: Grid, seed: int) -> Take:
    """A take of gestured.simulator: the nominal textile on another day, or one as bad as it may get."""
    rng = generator(seed, 0x3E)
    sensor = SimulatedSensor.nominal(day=seed) if good else any_sensor(rng, 1.0)
    side = PAD_MM if good else sensor.pitch_mm * min(sensor.rows, sensor.columns)
    sensor = replace(sensor, rows=grid[0], columns=grid[1], pitch_mm=side / min(grid))
    performance = perform(kind, Participant(seed), rng, ("slow", "normal", "fast")[seed % 3], 1, sensor.extent)
    start = 1.5 + float(rng.random()) / sensor.rate_hz
    take = sensor.record([(start, performance)], start + performance.duration_s + 0.8, rng)
    fingers = [
        _finger(start + one.t, one.x / sensor.pitch_mm - 0.5, one.y / sensor.pitch_mm - 0.5, one.force, grid)
        for one in performance.contacts
        if one.finger
    ]
    return Take(take.frames, take.times, 0.5 / sensor.rate_hz, fingers)


def foreign(kind: str, good: bool, grid: Grid, seed: int) -> Take:
    """A take of the other generator, on a laboratory piece or a worn one."""
    rng, level = np.random.default_rng([seed, 0x3E, *grid]), "nominal" if good else "hard"
    person, sensor = draw_person(rng, level), draw_sensor(rng, level, *grid)
    performance = perform_foreign(kind, rng, person)
    start = 1.4 + float(rng.uniform(0.0, 0.4))
    frames, times, _ = record_foreign(sensor, rng, [(start, performance)], start + performance.duration + 1.4)
    fingers = []
    for pad in performance.pads:
        middle = pad.weights @ pad.points
        x, y = ((axis + middle[k]) * sensor.pitch + sensor.shift[k] for k, axis in enumerate((pad.x, pad.y)))
        fingers.append(_finger(start + pad.t, x, grid[0] - 1 - y, pad.force, grid))
    return Take(frames, times, 0.0, fingers)


def taken(
    make: Callable[..., Take], kinds: tuple[str, ...], good: bool, grid: Grid, count: int
) -> Iterator[tuple[Take, Segment]]:
    """Those of `count` takes that have exactly one segment, each with its segment."""
    for k in range(count):
        take = make(kinds[k % len(kinds)], good, grid, FIRST + k)
        cut = cuts(take.frames, take.times)
        if len(cut) == 1:
            yield take, cut[0]


def off(found: Where, segment: Segment, take: Take) -> tuple[float, float]:
    """Errors, in pitches, of the start and the end of a contact of one finger."""
    (finger,) = take.fingers
    rows, columns = segment.frames.shape[1:]
    first, last = np.flatnonzero(finger.force >= DOWN)[[0, -1]]
    return tuple(  # type: ignore[return-value]
        math.dist(((1 - at.y) * (rows - 1), at.x * (columns - 1)), (finger.row[k], finger.column[k]))
        for at, k in ((found.start, first), (found.end, last))
    )


def places(take: Take, segment: Segment) -> Iterator[tuple[list[tuple[float, float]], list[tuple[float, float]]]]:
    """For each touched frame in which all fingers press firmly, their true places and the places found."""
    for k in range(segment.first, segment.last + 1):
        true = [at for finger in take.fingers if (at := finger.at(float(segment.times[k]) - take.behind_s))]
        found = spots(segment.frames[k].astype(np.float64).ravel(), segment.frames.shape[1:], segment.noise)
        if len(true) == len(take.fingers):
            yield true, [(one.row, one.column) for one in found]


def accuracy(count: int) -> Table:
    """How far places are off, and whether fingers are counted rightly, by generator, sensor and grid."""
    rows: list[tuple[Value, ...]] = []
    cells = [(make, good, grid) for make in (simulated, foreign) for good in (True, False) for grid in GRIDS]
    for make, good, grid in progress(cells, len(cells), "places"):
        frames, starts, ends, ones = [], [], [], []
        for take, segment in taken(make, ONE, good, grid, count):
            said = where(segment, {})
            ones.append(said.contacts == 1)
            start, end = off(said, segment, take)
            starts.append(start)
            ends.append(end)
            frames += [math.dist(true[0], found[0]) for true, found in places(take, segment)]
        twos = [where(segment, {}).contacts == 2 for _, segment in taken(make, TWO, good, grid, count // 2)]
        title = f"{'simulated' if make is simulated else 'another generator'}, {'good' if good else 'bad'} sensors"
        rows.append((
            title, f"{grid[0]} x {grid[1]}", len(ones), _two(frames), _two(starts), _two(ends),
            f"{np.mean(ones):.2f}", f"{np.mean(twos):.2f}",
        ))  # fmt: skip
    return Table(
        "How far places are off",
        ("set", "grid", "contacts", "in one frame", "start", "end", "one finger is one", "two are two"),
        rows,
        ("Median and 95th percentile in taxel pitches. Start and end are compared with the first and the last moment",
         "at which the finger was down, however little of it a frame has shown."),
    )  # fmt: skip


def several(count: int) -> Table:
    """Whether two fingers are told apart in a frame, by their distance."""
    found: dict[float, list[tuple[bool, float]]] = defaultdict(list)
    for make in (simulated, foreign):
        for take, segment in taken(make, TWO, True, (9, 9), count):
            for true, seen in places(take, segment):
                if len(true) == 2 and (apart := math.dist(*true)) >= APART[0]:
                    edge = next(edge for edge in APART[1:] if apart < edge)
                    pairs = ((true, seen), (true[::-1], seen))
                    worst = min(max(map(math.dist, a, b)) for a, b in pairs) if len(seen) == 2 else math.nan
                    found[edge].append((len(seen) == 2, worst))
    rows: list[tuple[Value, ...]] = []
    for low, edge in zip(APART, APART[1:], strict=False):
        those = found[edge]
        told = [worst for two, worst in those if two]
        span = f"{low:g} to {edge:g}" if edge < math.inf else f"{low:g} and more"
        rows.append((span, len(those), f"{np.mean([two for two, _ in those] or [False]):.2f}", _two(told)))
    return Table(
        "Two fingers in one frame",
        ("pitches apart", "frames", "seen as two", "the worse of both places"),
        rows,
        (
            "Swipes with two fingers on good 9 x 9 sensors of both generators; median and 95th percentile",
            "in taxel pitches.",
        ),
    )


def real(folder: Path, count: int) -> Table:
    """Places in real frames, against places in the same frames on a coarser grid."""
    frames = read(folder / REAL_FILES[1]).frames
    rng = np.random.default_rng(0)
    touched = np.flatnonzero(frames.max(axis=(1, 2)) >= TOUCHED)
    edges = np.linspace(0, 15, 10)
    share = np.array(
        [[max(0.0, min(b, e + 1) - max(a, e)) for e in range(15)] for a, b in zip(edges, edges[1:], strict=False)]
    )
    share /= share.sum(axis=1, keepdims=True)
    apart: dict[bool, list[float]] = {True: [], False: []}
    for k in rng.choice(touched, min(count, len(touched)), replace=False):
        frame = frames[k].astype(np.float64)
        fine = spots(frame.ravel(), frame.shape, 1.0)
        top = int(rng.integers(max(0, math.ceil(fine[0].row) - 14), min(12, math.floor(fine[0].row)) + 1))
        window = frame[top : top + 15]
        if len(fine) != 1 or window.max() < frame.max():
            continue
        (coarse, *_) = spots((share @ window @ share.T).ravel(), (9, 9), 1.0)
        true = ((fine[0].row - top + 0.5) * 0.6 - 0.5, (fine[0].column + 0.5) * 0.6 - 0.5)
        border = min(*true, 8 - true[0], 8 - true[1]) < 1
        apart[border].append(math.dist(true, (coarse.row, coarse.column)))
    rows: list[tuple[Value, ...]] = [
        ("within a pitch of the border" if border else "elsewhere", len(apart[border]), _two(apart[border]))
        for border in (False, True)
    ]
    return Table(
        "Real frames on a coarser grid",
        ("finger", "frames", "apart"),
        rows,
        ("CapFingerId, a touchscreen of 27 x 15: 15 x 15 of it averaged to 9 x 9, and the place in both; median and",
         "95th percentile in pitches of the 9 x 9."),
    )  # fmt: skip


def _two(errors: list[float]) -> str:
    return "{:.2f} {:.2f}".format(*np.percentile(errors, (50, 95))) if errors else "-"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--takes", type=int, default=300, help="takes for each row (%(default)s)")
    parser.add_argument("--real", type=Path, required=True, metavar="FOLDER", help="of real recordings, CapFingerId's")
    add_document(parser, "places")
    args = parser.parse_args()
    found = real(args.real, 10 * args.takes)  # first, so that missing recordings are reported at once
    tables = (accuracy(args.takes), several(args.takes), found)
    tell("\n".join(map(str, tables)), [], "places", args.document, TELLS)


if __name__ == "__main__":
    main()
