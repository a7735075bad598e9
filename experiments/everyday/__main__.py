"""What a model says in hours of everyday contact, in which few gestures are meant.

    python -m experiments.everyday --hours 20
    python -m experiments.everyday --hours 20 --document docs/figures.md
    python -m experiments.everyday --hours 10 --foreign nominal
    python -m experiments.everyday --recordings session.npz

Each hour is of another simulated person, at one place after the other (gestured/simulator/everyday.py); its frames
pass through the daemon's own path. A gesture that is said where none was meant is false. A tap that is said of a
contact which was a tap, though nobody meant it, is counted apart: no model can know better there. With --document the
table is written into a page.
With --foreign the hours are those of another generator (experiments/foreign/life.py), from which nothing learns.
With --recordings they are those of files; in one that does not tell what was performed all that is said is false.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import experiments.foreign.life as foreign
from experiments.foreign import LEVELS
from gestured.core.classifier import Classifier
from gestured.core.events import Event, Gesture, Provisional
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab.made_of import made_of, renew
from gestured.lab.progress import progress
from gestured.lab.table import Table
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.record.arrays import read
from gestured.record.check import SESSION
from gestured.record.judge import NONE, Performed, verdict, whose
from gestured.simulator.everyday import PLACES, day

HOUR_S = 3600.0
FIRST = 5000  # the first day's seed; no training has drawn it
DRAWS = 2000  # of people, for an interval
TAPS = ("one_tap", "double_tap")


@dataclass
class Stretch:
    """One person at one place, from whichever generator: frames (N, R, C) counts at times (N,) s, and the truth."""

    place: str
    times: NDArray[np.float64]
    frames: NDArray[np.generic]
    contacts: int
    meant: list[Performed]
    taps: list[Performed]  # which nobody meant, but which are taps in truth


@dataclass
class Hours:
    """What was said in some hours, and how it went."""

    seconds: float = 0.0
    deaf_s: float = 0.0  # in which the idle sensor was not known
    contacts: int = 0
    said: Counter[str] = field(default_factory=Counter)  # right, wrong, missed, false, apart, provisional
    names: Counter[str] = field(default_factory=Counter)  # of what was false
    meant_in: Counter[tuple[str, bool]] = field(default_factory=Counter)  # what a gesture was meant in, whether right
    each: list[tuple[float, int]] = field(default_factory=list)  # by person: hours, and false gestures

    def __iadd__(self, other: "Hours") -> "Hours":
        self.seconds, self.deaf_s = self.seconds + other.seconds, self.deaf_s + other.deaf_s
        self.contacts += other.contacts
        self.said += other.said
        self.names += other.names
        self.meant_in += other.meant_in
        self.each += other.each
        return self

    def per_hour(self, what: str) -> float:
        """How often that was so in an hour."""
        return HOUR_S * self.said[what] / self.seconds

    def share(self, what: str) -> float:
        """The share of the gestures that were meant."""
        return self.said[what] / max(sum(self.said[name] for name in ("right", "wrong", "missed")), 1)

    def interval(self) -> tuple[float, float]:
        """95 % of false gestures an hour, people drawn anew; at none the upper end is that of a Poisson count."""
        hours, false = np.array(self.each).T
        if not false.any():
            return 0.0, 3.0 / float(hours.sum())
        drawn = np.random.default_rng([0, 0xE7]).integers(0, len(hours), (DRAWS, len(hours)))
        low, high = np.quantile(false[drawn].sum(axis=1) / hours[drawn].sum(axis=1), [0.025, 0.975])
        return float(low), float(high)


def lived(args: argparse.Namespace) -> Iterator[Stretch]:
    """So many hours of everyday life, or those that were recorded, person after person."""
    for path in args.recordings:
        yield from recorded(path)
    if args.foreign:
        for n in range(2 * args.hours):
            half = foreign.live(args.seed + n, args.foreign)
            yield Stretch(half.place, half.times, half.frames, len(half.contacts), half.meant, half.taps)
    elif not args.recordings:
        for n in range(args.hours):
            life = day(args.seed + n, list(PLACES)[n % len(PLACES)], HOUR_S)
            taps = [Performed(NONE, act.kind, act.onset_s, act.offset_s) for act in life.like]
            meant = [Performed(act.label, lay, act.onset_s, act.offset_s) for act, lay in life.meant]
            yield Stretch(life.place, life.take.times, life.take.frames, life.contacts, meant, taps)


def recorded(path: Path) -> Iterator[Stretch]:
    """Each recording of a file as a stream; what was performed in it counts as meant, as far as the file tells."""
    found = read(path)
    events = (found.event_recording, found.event_labels, found.event_onsets, found.event_offsets)
    told = [] if any(field is None for field in events) else list(zip(*events, strict=True))  # type: ignore[arg-type]
    for i, whole in enumerate(found.labels):
        start, end = found.times_of(i)[[0, -1]]
        times = found.times_of(i) - start
        acts = [
            Performed(str(label), "", float(on - start), float(off - start)) for n, label, on, off in told if n == i
        ]
        if whole not in (NONE, SESSION):
            acts.append(Performed(str(whole), "", 0.0, float(end - start)))
        meant = [act for act in acts if act.label != NONE]
        yield Stretch(path.stem, times, found.frames_of(i), len(acts), meant, [])


def heard(life: Stretch, classifier: Classifier) -> tuple[list[Event], float]:
    """The events of a stretch, provisional ones among them, and for how many seconds the idle sensor was not known."""
    times, frames = life.times, life.frames
    sensor = Sensor("lab", Scene(classifier.gestures, frames.shape[1:]), classifier)
    sensor.foresee(asked=True)
    found: list[Any] = []
    deaf = 0
    for t, values in zip(times.tolist(), frames, strict=True):
        found += sensor.push(Frame(t, values))
        deaf += not sensor.front_end.ready
    found += sensor.flush(float(times[-1]) + 5.0)
    return events_of(found), deaf * float(times[-1]) / len(times)


def judged(life: Stretch, events: Iterable[Event], deaf_s: float) -> Hours:
    """How it went."""
    meant = life.meant
    hours = Hours(float(life.times[-1]), deaf_s, life.contacts)
    for event in events:
        if isinstance(event, Provisional):
            hours.said["provisional"] += whose(event.onset, event.decided, meant) is None
        if not isinstance(event, Gesture):
            continue
        act = whose(event.onset, event.offset, meant)
        found = verdict(event.gesture, act, answered=act is not None and act.answered)
        if act is not None:
            act.answered = True
        elif event.gesture in TAPS and whose(event.onset, event.offset, life.taps) is not None:
            found = "apart"
        hours.said[found] += 1
        if act is not None and found != "false":
            hours.meant_in[act.kind, found == "right"] += 1
        if found == "false":
            hours.names[event.gesture] += 1
    missed = [act for act in meant if not act.answered]
    hours.said["missed"] += len(missed)
    hours.meant_in.update((act.kind, False) for act in missed)
    hours.each.append((hours.seconds / HOUR_S, hours.said["false"]))
    return hours


def main() -> None:
    """Print false gestures an hour, and what became of those that were meant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", help="a shipped model, or a file (default: cnn_lstm)")
    parser.add_argument("--hours", type=int, default=20, help="of simulated life, in turn at each place (default: 20)")
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--foreign", choices=LEVELS, help="hours of the other generator, on such sensors")
    source.add_argument("--recordings", type=Path, nargs="+", default=[], metavar="FILE", help="recordings (.npz)")
    parser.add_argument("--seed", type=int, default=FIRST, help=f"of the first hour (default: {FIRST})")
    parser.add_argument("--json", action="store_true", help="print the table as JSON")
    parser.add_argument("--document", type=Path, help="a page whose table `everyday` is written anew")
    args = parser.parse_args()
    if args.document and (args.foreign or args.recordings):
        parser.error("--document: expected neither --foreign nor --recordings, the page's table is of the own hours")
    model = open_model(args.model)
    places: dict[str, Hours] = {name: Hours() for name in PLACES}
    total = len(args.recordings) or args.hours * (2 if args.foreign else 1)
    for life in progress(lived(args), total, "people"):
        places.setdefault(life.place, Hours())
        places[life.place] += judged(life, *heard(life, model))
    every = Hours()
    for one in places.values():
        every += one
    head = ("place", "hours", "contacts an hour", "false an hour", "95 %", "counted apart", "provisional false",
            "right", "wrong", "missed", "deaf s an hour")  # fmt: skip
    rows = [_row(name, one) for name, one in (*places.items(), ("all", every)) if one.seconds]
    falsely = "False gestures: " + ", ".join(f"{name} {count}" for name, count in every.names.most_common()) + "."
    notes = [falsely]
    if not args.recordings:
        hows = sorted({how for how, _ in every.meant_in})
        counts = {how: (every.meant_in[how, True], every.meant_in[how, False]) for how in hows}
        shares = (f"{how} {good / max(good + bad, 1):.3f} of {good + bad}" for how, (good, bad) in counts.items())
        notes.append(f"Right by what lay on the sensor: {', '.join(shares)}.")
    kind = "recorded" if args.recordings else f"of the other generator, {args.foreign}" if args.foreign else "simulated"
    table = Table(f"Everyday contact, {kind}: {args.model}", head, rows, tuple(notes))
    if args.document:
        made = made_of("python -m experiments.everyday", [shipped().get(args.model, Path(args.model))])
        renew(args.document, "everyday", [made, "", str(table)])
    if args.json:
        print(json.dumps({"head": head, "rows": rows, "false": dict(every.names)}))
    else:
        print(table)


def _row(name: str, one: Hours) -> tuple[str | int | float, ...]:
    low, high = one.interval()
    hours = one.seconds / HOUR_S
    shown = round(hours) if hours > 10 else round(hours, 2)
    return (
        name, shown, round(one.contacts / hours), one.per_hour("false"), f"{low:.1f} to {high:.1f}",
        one.per_hour("apart"), one.per_hour("provisional"), f"{one.share('right'):.3f}", f"{one.share('wrong'):.3f}",
        f"{one.share('missed'):.3f}", one.deaf_s / hours,
    )  # fmt: skip


if __name__ == "__main__":
    main()
