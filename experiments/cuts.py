"""How the front end cuts sessions whose gestures are known: `python -m experiments.cuts`.

    python -m experiments.cuts --level nominal hard faint --sessions 100
    python -m experiments.cuts --foreign --level nominal hard --sessions 100

The sessions are short, each of one person on one sensor, by this project's simulator or by the independent one, on
which nothing is tuned. A gesture is `one` if exactly one segment lies in it, and that segment lies in no other gesture;
`split` if several segments lie in it; `joined` if its segment lies in another gesture too; `missed` if none does.
Onsets and offsets are seconds after the true ones, of gestures that are one segment, at the quantiles 0.1, 0.5 and 0.9.
`false` are segments an hour in which nothing was performed.
"""

import argparse
import json
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments import foreign
from gestured.core.facts import Decided
from gestured.core.frames import Frame
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab.dataset import Truth, truths
from gestured.model.opening import open_model
from gestured.simulator import Participant, SimulatedSensor, any_sensor, generator, session

SESSION_S = 20.0
NON_GESTURE_SHARE = 0.25
HARDNESS = 0.6, 1.0
FAINT = 8.0, 25.0  # of a usual touch, times the noise
IDLE_S = 0.9, 3.0
EDGE_S = 0.07  # s, a frame at the model's rate, since a contact's ends are known only to the frame
LEVELS = ("nominal", "hard", "faint")


class Recording(NamedTuple):
    """Raw frames of a session, and what was performed in it."""

    frames: NDArray[np.generic]  # (N, R, C)
    times: NDArray[np.float64]  # (N,) s
    performed: list[Truth]


def ours(level: str, seed: int) -> Recording:
    """A session of the project's simulator: `hard` is any sensor, `faint` one whose touches hardly exceed its noise."""
    rng = generator(seed, 0xC075, LEVELS.index(level))
    sensor = SimulatedSensor.nominal(day=seed)
    if level != "nominal":
        while True:
            sensor = any_sensor(rng, float(rng.uniform(*HARDNESS)))
            if (sensor.rows, sensor.columns) == (9, 9) and 12 < sensor.rate_hz < 18:
                break
    if level == "faint":
        strength = float(np.exp(rng.uniform(*np.log(FAINT))))
        sensor = replace(sensor, noise=1 / strength)
    person = Participant(int(rng.integers(1 << 40)) + 1_000_000)
    take = session(person, sensor, rng, SESSION_S, NON_GESTURE_SHARE, IDLE_S)
    return Recording(take.frames, take.times, truths(take))


def lossy(recording: Recording, burst: int, seed: int) -> Recording:
    """A recording without `burst` frames in a row somewhere in each performance."""
    rng, keep = np.random.default_rng([seed, burst]), np.ones(len(recording.times), dtype=bool)
    for act in recording.performed:
        at = int(np.searchsorted(recording.times, rng.uniform(act.onset, act.offset)))
        first = max(at - int(rng.integers(burst)), 0)
        keep[first : first + burst] = False
    return Recording(recording.frames[keep], recording.times[keep], recording.performed)


def others(level: str, seed: int) -> Recording:
    """A session of the independent generator."""
    made = foreign.session(seed, level, SESSION_S, NON_GESTURE_SHARE)
    performed = [Truth(e["label"], e["kind"], seed, e["onset"], e["release"]) for e in made["events"]]
    return Recording(made["frames"], made["times"], performed)


@dataclass
class Sheet:
    """The counts of some sessions."""

    gestures: int = 0
    cuts: Counter[str] = field(default_factory=Counter)  # one, split, joined, missed
    cut: Counter[str] = field(default_factory=Counter)  # right, wrong, lost: gestures, by the answers to their segments
    best: int = 0  # gestures of one segment whose best score is right
    onsets: list[float] = field(default_factory=list)
    offsets: list[float] = field(default_factory=list)
    others: int = 0  # non-gestures
    accepted: int = 0  # non-gestures that were taken for a gesture
    false: int = 0  # segments in which nothing was performed
    hours: float = 0.0

    def __iadd__(self, other: "Sheet") -> "Sheet":
        for name in self.__dataclass_fields__:
            setattr(self, name, getattr(self, name) + getattr(other, name))
        return self

    def figures(self) -> dict[str, Any]:
        """The figures that are printed; shares are 0..1."""
        n = max(self.gestures, 1)

        def share(counts: Counter[str], *names: str) -> dict[str, float]:
            return {name: round(counts[name] / n, 4) for name in names}

        def quantiles(values: list[float]) -> list[float]:
            return [round(float(q), 3) for q in np.quantile(values or [np.nan], [0.1, 0.5, 0.9])]

        return {
            "gestures": self.gestures,
            **share(self.cuts, "one", "split", "joined", "missed"),
            "onset_s": quantiles(self.onsets), "offset_s": quantiles(self.offsets),
            "cut": {**share(self.cut, "right", "wrong", "lost"), "best": round(self.best / n, 4)},
            "others": self.others, "accepted": round(self.accepted / max(self.others, 1), 4),
            "false an hour": round(self.false / max(self.hours, 1e-9), 2),
        }  # fmt: skip


def measure(recording: Recording, model: Any) -> Sheet:
    """Count one session."""
    frames, times, performed = recording
    sheet = Sheet(hours=float(times[-1]) / 3600)
    machine = Sensor("cuts", Scene(model.gestures, frames.shape[1:]), model)
    decided: list[Decided] = []
    for t, values in zip(times, frames, strict=True):
        decided += [x for x in machine.push(Frame(float(t), values)) if isinstance(x, Decided)]
    decided += [x for x in machine.flush(float(times[-1]) + 5.0) if isinstance(x, Decided)]
    within = [
        [d for d in decided if d.segment.onset < p.offset + EDGE_S and d.segment.offset > p.onset - EDGE_S]
        for p in performed
    ]
    owners = Counter(id(d) for found in within for d in found)
    sheet.false = sum(id(d) not in owners for d in decided)
    for act, found in zip(performed, within, strict=True):
        named = [model.gestures[int(d.scores.values.argmax())] for d in found if d.known]
        if act.label == "none":
            sheet.others += 1
            sheet.accepted += bool(named)
            continue
        sheet.gestures += 1
        joined = any(owners[id(d)] > 1 for d in found)
        sheet.cuts["missed" if not found else "split" if len(found) > 1 else "joined" if joined else "one"] += 1
        sheet.cut["right" if named == [act.label] else "wrong" if set(named) - {act.label} else "lost"] += 1
        if len(found) == 1:
            (one,) = found
            sheet.best += model.gestures[int(one.scores.values.argmax())] == act.label
            if not joined:
                sheet.onsets.append(one.segment.onset - act.onset)
                sheet.offsets.append(one.segment.offset - act.offset)
    return sheet


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--foreign", action="store_true", help="the independent generator: look, do not tune")
    parser.add_argument("--level", nargs="+", choices=LEVELS, default=["nominal", "hard"])
    parser.add_argument("--sessions", type=int, default=100, help=f"of {SESSION_S:.0f} s, of each level (%(default)s)")
    parser.add_argument("--burst", type=int, default=0, help="frames lost in a row in each performance (%(default)s)")
    parser.add_argument("--first", type=int, default=0, help="first seed (%(default)s)")
    parser.add_argument("--model", default="cnn_lstm", help="a shipped model's name or a path (%(default)s)")
    args = parser.parse_args()
    if args.foreign and "faint" in args.level:
        parser.error("--foreign: its levels are nominal and hard")
    model = open_model(args.model)
    for level in args.level:
        sheet = Sheet()
        for seed in range(args.first, args.first + args.sessions):
            recording = (others if args.foreign else ours)(level, seed)
            sheet += measure(lossy(recording, args.burst, seed) if args.burst else recording, model)
        print(json.dumps({"level": level, "burst": args.burst, **sheet.figures()}), flush=True)


if __name__ == "__main__":
    main()
