"""How early and how rightly a model speaks: provisional events over whole sessions, held against what was performed.

    python -m experiments.early --model cnn_lstm --minutes 20

Frames go through a whole `Sensor` as in the daemon, and nothing is cut by hand. So what begins alike counts: a tap may
become a double tap, and a scribble begins as a swipe.
"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.pages import add_document, tell
from gestured.core.classifier import Classifier
from gestured.core.events import Cancelled, Event, Gesture, Provisional, Unknown
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.scene import DOUBLE_TAP, ONE_TAP, Scene
from gestured.core.sensor import Sensor
from gestured.lab.dataset import Truth, truths
from gestured.lab.online import NON_GESTURE_SHARE, SESSION_S
from gestured.lab.progress import progress
from gestured.lab.table import Table
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.record.judge import owners, verdict
from gestured.simulator import NONE, Participant, SimulatedSensor, Take, any_sensor, generator, session

HARD = 0.9  # hardness of the simulator's hard sensors
SETS = ("nominal", "hard", "non-gestures")


def heard(times: NDArray[np.float64], frames: NDArray[np.generic], classifier: Classifier) -> list[Event]:
    """The events of a session, (N,) s and (N, R, C) counts, provisional ones among them."""
    sensor = Sensor("lab", Scene(classifier.gestures, frames.shape[1:]), classifier)
    sensor.foresee(asked=True)
    found = [one for t, values in zip(times, frames, strict=True) for one in sensor.push(Frame(float(t), values))]
    return events_of([*found, *sensor.flush(float(times[-1]) + 5.0)])


@dataclass(slots=True)
class Ahead:
    """What became of provisional events in some sessions."""

    minutes: float = 0.0
    moved: int = 0  # gestures that were performed and are no taps
    early: int = 0  # of them with a right provisional event at or before the last touched frame
    moved_s: list[float] = field(default_factory=list)  # first right word about each, after its last touched frame
    tap_s: list[float] = field(default_factory=list)  # the same of single taps
    confirmed: dict[bool, int] = field(default_factory=lambda: {True: 0, False: 0})  # events, but for taps
    taps: dict[bool, int] = field(default_factory=lambda: {True: 0, False: 0})  # events of a tap at its release
    right: int = 0  # answers to gestures
    wrong: int = 0
    gestures: int = 0

    def add(self, events: Sequence[Event], acts: Iterable[Truth], minutes: float) -> None:
        """Count what was said in one session."""
        self.minutes += minutes
        said = {event.id: event for event in events if isinstance(event, Provisional)}
        answers = [event for event in events if isinstance(event, Gesture | Unknown)]
        ends = {event.id: event.provisional for event in events if isinstance(event, Gesture | Unknown | Cancelled)}
        for number, event in said.items():
            counts = self.taps if event.gesture == ONE_TAP else self.confirmed
            counts[ends.get(number) == "confirmed"] += 1
        performed = list(acts)
        belongs = owners([(answer.onset, answer.offset) for answer in answers], performed)
        for act in performed:
            if act.label != NONE:
                self._gesture(act, [one for one, of in zip(answers, belongs, strict=True) if of is act], said)

    def _gesture(self, act: Truth, near: Sequence[Gesture | Unknown], said: dict[int, Provisional]) -> None:
        """Count one gesture that was performed, by the answers at its time."""
        self.gestures += 1
        named = [answer.gesture for answer in near if isinstance(answer, Gesture)]
        found = verdict(named[0], act, answered=False) if named else "missed"
        self.right += found == "right"
        self.wrong += found == "wrong"
        moved = act.label not in (ONE_TAP, DOUBLE_TAP)
        self.moved += moved
        after = []
        for answer in near:
            first = said.get(answer.id)
            if first is not None and first.gesture == act.label:
                after.append(first.decided - answer.offset)
            elif isinstance(answer, Gesture) and answer.gesture == act.label:
                after.append(answer.decided - answer.offset)
        if moved:
            self.early += any(
                answer.id in said and said[answer.id].gesture == act.label
                and said[answer.id].decided <= answer.offset + 1e-6 for answer in near
            )  # fmt: skip
        if after and (moved or act.label == ONE_TAP):
            (self.moved_s if moved else self.tap_s).append(after[0])

    def figures(self) -> dict[str, Any]:
        """Everything as plain data; None where there is nothing to divide by."""
        return {
            "gestures": self.gestures,
            "right": _share(self.right, self.gestures),
            "wrong": _share(self.wrong, self.gestures),
            "moved": self.moved,
            "early": _share(self.early, self.moved),
            "events": sum(self.confirmed.values()),
            "confirmed": _share(self.confirmed[True], sum(self.confirmed.values())),
            "moved_median_s": _median(self.moved_s),
            "tap_median_s": _median(self.tap_s),
            "taps_confirmed": _share(self.taps[True], sum(self.taps.values())),
            "events_per_minute": round((sum(self.confirmed.values()) + sum(self.taps.values())) / self.minutes, 2)
            if self.minutes
            else None,
        }


def _share(part: int, whole: int) -> float | None:
    return round(part / whole, 4) if whole else None


def _median(values: Sequence[float]) -> float | None:
    return round(float(np.median(values)), 3) if values else None


def takes(which: str, count: int, seed: int) -> Iterator[Take]:
    """Sessions of one new participant each."""
    for n in range(count):
        person = seed + n
        rng = generator(person, 0xEA)
        sensor = any_sensor(rng, HARD) if which == "hard" else SimulatedSensor.nominal(day=person)
        share = 1.0 if which == "non-gestures" else NON_GESTURE_SHARE
        yield session(Participant(person), sensor, rng, SESSION_S, share)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", help="a shipped model's name, or a path (%(default)s)")
    parser.add_argument("--minutes", type=float, default=20, help="minutes of sessions of each kind (%(default)s)")
    parser.add_argument("--seed", type=int, default=900, help="first participant; training used 0 to 33 (%(default)s)")
    add_document(parser, "early")
    args = parser.parse_args()
    model = open_model(args.model)
    count = max(round(args.minutes * 60 / SESSION_S), 1)
    figures: dict[str, dict[str, Any]] = {}
    for which in SETS:
        ahead = Ahead()
        for take in progress(takes(which, count, args.seed), count, which):
            ahead.add(heard(take.times, take.frames, model), truths(take), SESSION_S / 60)
        figures[which] = ahead.figures()
    made = table("Provisional events, simulated", figures)
    tell(made, [shipped().get(args.model, Path(args.model))], "early", args.document)


HEAD = ("gestures", "right", "wrong", "moved", "early", "events", "confirmed", "moved_median_s", "tap_median_s",
        "taps_confirmed", "events_per_minute")  # fmt: skip
SHOWN = ("moved, median s", "one tap, median s", "taps confirmed", "events a minute")  # as a page calls the last ones


def table(title: str, sets: dict[str, dict[str, Any]]) -> Table:
    """One row for each set."""
    rows = [(name, *("-" if found[key] is None else str(found[key]) for key in HEAD)) for name, found in sets.items()]
    return Table(title, ("sessions", *HEAD[: -len(SHOWN)], *SHOWN), rows)


if __name__ == "__main__":
    main()
