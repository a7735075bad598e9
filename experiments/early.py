"""How early, and how often rightly, a model answers: provisional events of whole sessions against what was performed.

    python -m experiments.early --model cnn_lstm --minutes 20

Frames go through a whole `Sensor` as in the daemon, and nothing is cut by hand. So gestures that begin alike count: a
tap may become a double tap, and a scribble begins as a swipe.
"""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.pages import add_document, tell
from gestured.core.classifier import Classifier
from gestured.core.events import Cancelled, Event, Gesture, Provisional, Unknown
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.scene import DOUBLE_TAP, ONE_TAP, Scene
from gestured.core.sensor import Sensor
from gestured.lab.cards import with_interval
from gestured.lab.dataset import Truth, truths
from gestured.lab.intervals import interval
from gestured.lab.online import NON_GESTURE_SHARE, SESSION_S
from gestured.lab.progress import progress
from gestured.lab.table import Table, Value
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.record.judge import owners, verdict
from gestured.simulator import NONE, Participant, SimulatedSensor, Take, any_sensor, generator, session

FIRST = 900  # participant; training used 0 to 33
HARD = 0.9  # hardness of the simulator's hard sensors
SHARES = ("right", "wrong", "early", "confirmed", "taps")
SETS = ("nominal", "hard", "non-gestures")


def heard(
    times: NDArray[np.float64], frames: NDArray[np.generic], classifier: Classifier, *, foresee: bool = True
) -> list[Event]:
    """The events of a session, (N,) s and (N, R, C) counts, provisional ones among them unless told otherwise."""
    sensor = Sensor("lab", Scene(classifier.gestures, frames.shape[1:]), classifier)
    sensor.foresee(asked=foresee)
    found = [one for t, values in zip(times, frames, strict=True) for one in sensor.push(Frame(float(t), values))]
    return events_of([*found, *sensor.flush(float(times[-1]) + 5.0)])


@dataclass(slots=True)
class Ahead:
    """What became of provisional events in some sessions."""

    minutes: float = 0.0
    people: int = 0  # sessions: each is another person's
    moved_s: list[float] = field(default_factory=list)  # s from a moving gesture's last touched frame to its right name
    tap_s: list[float] = field(default_factory=list)  # as `moved_s`, of single taps
    # By share, a pair for each case: whether the share counts it, and the number of its session. Cases are gestures for
    # `right` and `wrong`, gestures that are no taps for `early`, provisional events of a single tap for `taps`, and all
    # other provisional events for `confirmed`.
    counted: dict[str, list[tuple[bool, int]]] = field(default_factory=lambda: {name: [] for name in SHARES})

    def add(self, events: Sequence[Event], acts: Iterable[Truth], minutes: float) -> None:
        """Count the events of one session."""
        self.minutes, self.people = self.minutes + minutes, self.people + 1
        said = {event.id: event for event in events if isinstance(event, Provisional)}
        answers = [event for event in events if isinstance(event, Gesture | Unknown)]
        ends = {event.id: event.provisional for event in events if isinstance(event, Gesture | Unknown | Cancelled)}
        for number, event in said.items():
            self._count("taps" if event.gesture == ONE_TAP else "confirmed", ends.get(number) == "confirmed")
        performed = list(acts)
        belongs = owners([(answer.onset, answer.offset) for answer in answers], performed)
        for act in performed:
            if act.label != NONE:
                self._gesture(act, [one for one, of in zip(answers, belongs, strict=True) if of is act], said)

    def _gesture(self, act: Truth, near: Sequence[Gesture | Unknown], said: dict[int, Provisional]) -> None:
        """Count one gesture that was performed, by the answers at its time."""
        named = [answer.gesture for answer in near if isinstance(answer, Gesture)]
        found = verdict(named[0], act, answered=False) if named else "missed"
        self._count("right", found == "right")
        self._count("wrong", found == "wrong")
        moved = act.label not in (ONE_TAP, DOUBLE_TAP)
        after = []
        for answer in near:
            first = said.get(answer.id)
            if first is not None and first.gesture == act.label:
                after.append(first.decided - answer.offset)
            elif isinstance(answer, Gesture) and answer.gesture == act.label:
                after.append(answer.decided - answer.offset)
        if moved:
            self._count("early", any(
                answer.id in said and said[answer.id].gesture == act.label
                and said[answer.id].decided <= answer.offset + 1e-6 for answer in near
            ))  # fmt: skip
        if after and (moved or act.label == ONE_TAP):
            (self.moved_s if moved else self.tap_s).append(after[0])

    def _count(self, name: str, so: bool) -> None:
        self.counted[name].append((so, self.people))

    def cells(self) -> tuple[Value, ...]:
        """A row of `HEAD`; a dash for a share or median of nothing."""
        some = {name: share_of(counted) for name, counted in self.counted.items()}
        count = {name: len(counted) for name, counted in self.counted.items()}
        rate = (count["confirmed"] + count["taps"]) / self.minutes
        return (
            count["right"], some["right"], some["wrong"], count["early"], some["early"], count["confirmed"],
            some["confirmed"], _median(self.moved_s), _median(self.tap_s), some["taps"], f"{rate:.2f}",
        )  # fmt: skip


def share_of(counted: Sequence[tuple[bool, int]]) -> str:
    """A share with its interval over people; a dash for one of nothing."""
    share, low, high = interval([so for so, _ in counted], [of for _, of in counted])
    return with_interval(share, {"low": low, "high": high}) if counted else "-"


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.3f}" if values else "-"


def takes(which: str, count: int) -> Iterator[Take]:
    """Sessions of one new participant each."""
    for n in range(count):
        person = FIRST + n
        rng = generator(person, 0xEA)
        sensor = any_sensor(rng, HARD) if which == "hard" else SimulatedSensor.nominal(day=person)
        share = 1.0 if which == "non-gestures" else NON_GESTURE_SHARE
        yield session(Participant(person), sensor, rng, SESSION_S, share)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", help="a shipped model's name, or a path (%(default)s)")
    parser.add_argument("--minutes", type=float, default=20, help="minutes of sessions of each kind (%(default)s)")
    add_document(parser, "early")
    args = parser.parse_args()
    model = open_model(args.model)
    count = max(round(args.minutes * 60 / SESSION_S), 1)
    found = {which: Ahead() for which in SETS}
    for which, ahead in found.items():
        for take in progress(takes(which, count), count, which):
            ahead.add(heard(take.times, take.frames, model), truths(take), SESSION_S / 60)
    made = table("Provisional events, simulated", found)
    tell(made, [shipped().get(args.model, Path(args.model))], "early", args.document)


HEAD = ("sessions", "gestures", "right", "wrong", "moved", "early", "events", "confirmed", "moved, median s",
        "one tap, median s", "taps confirmed", "events a minute")  # fmt: skip


def table(title: str, sets: Mapping[str, Ahead]) -> Table:
    """One row for each set."""
    return Table(title, HEAD, [(name, *found.cells()) for name, found in sets.items()])


if __name__ == "__main__":
    main()
