"""Whether this checkout decides as an older one does: of the same frames, to the last bit the same events.

    git worktree add /tmp/before COMMIT
    python -m experiments.same /tmp/before --real ../shared/data

Both checkouts play hours of simulated everyday contact, simulated gestures on sensors of every kind, and perhaps real
sessions. If no event differs, a line in experiments/same.txt says so, and what the older code has measured holds for
this code, too: `make figures ARGS=--stale` does not list these tables. Otherwise the first event that differs is shown.

`--but Unknown.reason` passes over the reasons of unknown events, for a change that means to give other reasons.
`--nominal` plays only nominal sensors and real ones, for a change that is meant for others; tables of others must then
be made again by their commands.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import date
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core.errors import GesturedError
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab.made_of import decides
from gestured.lab.progress import progress
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.record.arrays import read
from gestured.simulator import generator
from gestured.simulator.chance import CHANCE
from gestured.simulator.cohort import wide
from gestured.simulator.everyday import day
from gestured.simulator.places import PLACES
from gestured.simulator.variety import any_sensor

HELD = Path(__file__).with_name("same.txt")
SEED = 77  # of simulated people from whom no model has learned
DAY_S = 720.0  # length of a simulated day
OF_A_PART = 50  # takes that are written into one file
FASTEST_HZ = 30.0  # the highest rate of a sensor in a day; days of faster sensors would take most of the time
SILENCE_S = 5.0  # from the last frame of a stream to its end, so that an open contact is answered
FIELD = r", {}=(?:'[^']*'|[^,()]*)"  # the pattern of one field in the `repr` of an event


class Stream(NamedTuple):
    """What one sensor has sent."""

    times: NDArray[np.float64]  # (N,) s
    frames: NDArray[Any]  # (N, R, C) counts


def streams(days: range, takes: int, real: Path | None) -> Iterator[list[Stream]]:
    """The streams that both checkouts play, in parts. Days of odd numbers have a sensor drawn at random."""
    places = [*PLACES.values(), *CHANCE.values()]
    for n in days:
        rng = generator(SEED, 0xDA, n)
        sensor = any_sensor(rng, float(rng.random()))
        slow = replace(sensor, rate_hz=min(sensor.rate_hz, FASTEST_HZ)) if n % 2 else None
        life = day(SEED * 1_000_000 + n, places[n // 2 % len(places)], DAY_S, slow)
        yield [Stream(life.take.times, life.take.frames)]
    for first in range(0, takes, OF_A_PART):
        found = [wide(SEED, n) for n in range(first, min(first + OF_A_PART, takes))]
        yield [Stream(take.times, take.frames) for take in found]
    for path in sorted(real.glob("*sessions*.npz")) if real else ():
        held = read(path)
        yield [Stream(held.times_of(i), held.frames_of(i)) for i in range(len(held))]


def write(parts: Iterator[list[Stream]], folder: Path) -> int:
    """Write each part into a file of its own in a folder; returns the number of parts."""
    n = 0
    for n, part in enumerate(parts, 1):
        arrays = {f"{name}{k}": each for k, one in enumerate(part) for name, each in one._asdict().items()}
        np.savez(folder / f"{n:03}", **arrays)  # type: ignore[arg-type]
    return n


def told(folder: Path, model: str) -> Iterator[str]:
    """The digest of the code that runs, then the events that it gives for the files of a folder, by name."""
    yield decides()
    opened = open_model(model)
    for path in sorted(folder.iterdir()):
        with np.load(path) as held:
            for n in range(len(held.files) // 2):
                one = Stream(held[f"times{n}"], held[f"frames{n}"])
                rows, columns = one.frames.shape[1:]
                sensor = Sensor(f"{path.stem}_{n}", Scene(opened.gestures, (rows, columns)), opened)
                sensor.foresee(asked=True)
                for t, values in zip(one.times.tolist(), one.frames, strict=True):
                    yield from map(repr, events_of(sensor.push(Frame(t, values))))
                yield from map(repr, events_of(sensor.flush(float(one.times[-1]) + SILENCE_S)))


def told_by(checkout: Path, *words: str) -> Iterator[str]:
    """What `told` gives by the code of a checkout, in a process that is started at once."""
    command = [sys.executable, __file__, "--tell", *words]
    environment = os.environ | {"PYTHONPATH": str(checkout.resolve())}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)

    def lines() -> Iterator[str]:
        assert process.stdout is not None
        yield from process.stdout
        if process.wait():
            raise GesturedError(f"{checkout}: its process ended with {process.returncode}")

    return lines()


def compared(here: Iterator[str], there: Iterator[str], but: str) -> int:
    """The number of events, if both sides give the same. Raises GesturedError for the first that differs.

    The field that `but` names, such as `Unknown.reason`, is not compared.
    """
    kind, _, field = but.partition(".")
    passed = re.compile(FIELD.format(re.escape(field)))

    def seen(event: str | None) -> str | None:
        return passed.sub("", event) if event and but and event.startswith(f"{kind}(") else event

    events = 0
    for events, (one, other) in enumerate(zip_longest(here, there), 1):
        if seen(one) != seen(other):
            raise GesturedError(f"event {events} differs\n  here:  {one}  there: {other}")
    return events


def alike(one: str, other: str, lines: str) -> bool:
    """Whether the codes of two digests decide alike, by one line of same.txt or by several that share codes."""
    pairs = [set(line.split()[:2]) for line in lines.splitlines() if not line.startswith("#")]
    known = {one}
    while more := {code for pair in pairs if pair & known for code in pair} - known:
        known |= more
    return other in known


def main() -> None:
    """Compare two checkouts, and say so in same.txt if no event differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, metavar="CHECKOUT", help="the older one's folder")
    parser.add_argument("--days", type=int, default=60, help="of twelve minutes (%(default)s)")
    parser.add_argument("--takes", type=int, default=1500, help="single performances on any sensor (%(default)s)")
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="of real recordings, as docs/training.md has it")
    parser.add_argument(
        "--but", default="", metavar="EVENT.FIELD", help="a field that may differ, such as Unknown.reason"
    )
    parser.add_argument("--nominal", action="store_true", help="play only nominal sensors and real ones")
    parser.add_argument("--tell", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.tell:
        for line in told(args.before, str(shipped()["cnn_lstm"])):
            print(line)
        return
    days, takes = (range(0, args.days, 2), 0) if args.nominal else (range(args.days), args.takes)
    with tempfile.TemporaryDirectory() as folder:
        count = len(days) - (-takes // OF_A_PART) + bool(args.real)
        write(progress(streams(days, takes, args.real), count, "streams"), Path(folder))
        here, there = (told_by(root, folder) for root in (Path(), args.before))
        digests = next(here).strip(), next(there).strip()
        events = compared(here, there, args.but)
    what = f"{len(days) * DAY_S / 3600:g} h of days, {takes} takes{' and real sessions' if args.real else ''}"
    what += ", of nominal sensors" if args.nominal else ""
    line = f"{' '.join(digests)} {date.today()} {events} events of {what}{args.but and f', but for {args.but}'}"
    print(line)
    with HELD.open("a") as file:
        file.write(f"{line}\n")


if __name__ == "__main__":
    main()
