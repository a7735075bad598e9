"""Judge models on the independent generator.

    python -m experiments.foreign.judge --n 20 --level nominal hard --document docs/figures.md
    python -m experiments.foreign.judge --model cnn_lstm --provisional --sessions 10

All shipped models are judged, a row for each; --document puts the table into a page, and each model's rows into its
card. Takes that nobody can recognise (see `visible`) are left out. No figure of a single kind is printed, since a model
would soon be tuned by it.
"""

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from functools import partial
from itertools import product
from pathlib import Path
from textwrap import fill
from typing import Any

from experiments.early import Ahead, heard, table
from experiments.foreign import GESTURES, KINDS, LEVELS, session, take
from experiments.pages import command, tell
from gestured.core.classifier import Classifier
from gestured.core.events import Cancelled, Gesture, Unknown
from gestured.lab.cards import head, row
from gestured.lab.dataset import Truth, in_processes
from gestured.lab.evaluate import Evaluation
from gestured.lab.intervals import interval
from gestured.lab.made_of import digests, made_of, renew
from gestured.model.opening import open_model
from gestured.model.shipped import shipped

SEEN = 4.0  # times the noise
SESSION_S = 120.0
OPENED = Path("experiments/foreign/opened.txt")  # kept in a checkout: when it judged for a page, and which models
Take = dict[str, Any]
OF_A_CARD = (
    "Answers on a second simulator of people and sensors (`experiments/foreign`), written "
    "independently of the first, from",
    "which no model learns. Sensors are as good as the nominal one, or much worse (hard).",
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one take."""

    kind: str
    answer: str  # the gesture that was named; empty if it was unknown, missed, cancelled or split
    before: str  # the best label before rejection, if there is one segment


def visible(recording: Take) -> bool:
    """Whether anybody could know from the frames what was done.

    Some frame must rise above the noise; in a double tap one in each contact, with a clear dip between them.
    """
    times, seen = recording["times"], recording["seen"]
    if recording["kind"] == "burst":
        return True
    if recording["kind"] != "double_tap":
        return bool(seen.max() >= SEEN)
    middle = (recording["contacts"][0][1] + recording["contacts"][1][0]) / 2
    first, second = int(seen[times < middle].argmax()), int((seen * (times >= middle)).argmax())
    weaker = min(seen[first], seen[second])
    return bool(weaker >= SEEN and seen[first:second].min() < 0.6 * weaker)


def judge(recording: Take, classifier: Classifier) -> Outcome:
    """Run one take through a fresh sensor."""
    times, kind = recording["times"], recording["kind"]
    events = heard(times, recording["frames"], classifier, foresee=False)
    slack = 2.0 / max(float(len(times) / times[-1]), 1.0)
    begin, end = recording["onset"] - slack, recording["release"] + slack + 0.2
    inside = [one for one in events if isinstance(one, Gesture | Unknown) and one.onset <= end and one.offset >= begin]
    named = [one.gesture for one in inside if isinstance(one, Gesture)]
    if len(inside) + sum(isinstance(one, Cancelled) for one in events) > 1:
        # A gesture in pieces is lost; a non-gesture in pieces is rejected only if all of them are.
        return Outcome(kind, named[0] if named and recording["label"] == "none" else "", "")
    before = max(inside[0].scores, key=inside[0].scores.__getitem__) if inside else ""
    return Outcome(kind, named[0] if named else "", before)


def evaluated(outcomes: Sequence[Outcome]) -> Evaluation:
    """The shares of some outcomes, with intervals; each take is of another person."""
    gestures, others = ([one for one in outcomes if (one.kind in GESTURES) == meant] for meant in (True, False))
    hits = {
        "right": [one.answer == one.kind for one in gestures],
        "wrong": [one.answer not in ("", one.kind) for one in gestures],
        "lost": [not one.answer for one in gestures],
        "rejected": [not one.answer for one in others],
    }
    found = {name: interval(hit, range(len(hit))) for name, hit in hits.items()}
    ends = {name: {"low": low, "high": high} for name, (_, low, high) in found.items()}
    before = sum(one.before == one.kind for one in gestures) / max(len(gestures), 1)
    shares = {name: share for name, (share, _, _) in found.items()}
    return Evaluation(len(gestures), len(others), before, **shares, people=len(outcomes), intervals=ends)


def _some(source: str, count: int, tasks: Sequence[tuple[str, str]], number: int) -> list[Outcome]:
    level, kind = tasks[number]
    classifier, takes = open_model(source), (take(kind, seed, level) for seed in range(count))
    return [judge(one, classifier) for one in takes if visible(one)]


def judged(source: str, args: argparse.Namespace) -> dict[str, Evaluation]:
    """The figures of a model on each level."""
    tasks = list(product(args.level, KINDS))
    found = list(in_processes(partial(_some, source, args.n, tasks), range(len(tasks)), args.jobs, source))
    return {
        level: evaluated([one for (of, _), some in zip(tasks, found, strict=True) if of == level for one in some])
        for level in args.level
    }


def left_out(results: dict[str, dict[str, Evaluation]], count: int) -> list[str]:
    """A note: how many gestures nobody could see, and the shares of right ones if each of these were lost."""
    asked, first = count * len(GESTURES), next(iter(results.values()))
    dark = ", ".join(f"{asked - found.gestures} on {level} sensors" for level, found in first.items())
    shares = {
        name: ", ".join(f"{found.right * found.gestures / asked:.3f}" for found in result.values())
        for name, result in results.items()
    }
    right = "; ".join(f"`{name}` {said}" for name, said in shares.items())
    text = (
        f"Left out of {asked} gestures is what no frame shows clearly enough for anybody to name it: {dark}. If all of "
        f"these were lost, right would be {right}."
    )
    return fill(text, 118).splitlines()


def show_shipped(args: argparse.Namespace) -> None:
    """Print the table of all shipped models; with --document also write it into that page and the models' cards."""
    results = {name: judged(name, args) for name in shipped()}
    rows = {
        name: [row(f"`{name}.onnx`, another generator, {level}", asdict(found)) for level, found in result.items()]
        for name, result in results.items()
    }
    above = [made_of(command(), shipped().values()), "", *head("model and sensors")]
    table = [*above, *(line for lines in rows.values() for line in lines), "", *left_out(results, args.n)]
    print("\n".join(table))
    if args.document:
        renew(args.document, "judged", table)
        if OPENED.exists():
            with OPENED.open("a") as file:
                file.write(f"{date.today()} {' '.join(f'{a} {b}' for a, b in digests(shipped().values()).items())}\n")
        for name, path in shipped().items():
            renew(path.with_suffix(".md"), "judged", [*OF_A_CARD, "", *above, *rows[name]])


def provisional(source: str, level: str, share: float, seeds: range) -> Ahead:
    """What became of provisional events in sessions with that share of non-gestures."""
    classifier, found = open_model(source), Ahead()
    for seed in seeds:
        recording = session(seed, level, SESSION_S, share)
        acts = [
            Truth(event["label"], event["label"], seed, event["onset"], event["release"])
            for event in recording["events"]
        ]
        found.add(heard(recording["times"], recording["frames"], classifier), acts, SESSION_S / 60)
    return found


def show_provisional(args: argparse.Namespace) -> None:
    """Print provisional events in sessions of the levels, and of non-gestures."""
    sets = {level: (level, 0.25) for level in args.level} | {"non-gestures": ("nominal", 1.0)}
    rows = {name: provisional(args.model, level, share, range(args.sessions)) for name, (level, share) in sets.items()}
    made = table("Provisional events, by another generator", rows)
    tell(made, [shipped().get(args.model, Path(args.model))], "early elsewhere", args.document)


def main() -> None:
    """Print what the options ask for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--document", type=Path, metavar="PAGE", help="a page to write; with the table, also the cards")
    parser.add_argument("--n", type=int, default=40, help="takes of each kind and level (%(default)s)")
    parser.add_argument("--level", nargs="+", choices=LEVELS, default=list(LEVELS))
    parser.add_argument("--provisional", action="store_true", help="instead, provisional events of one --model")
    parser.add_argument("--model", default="cnn_lstm", help="a shipped one's name or a path (%(default)s)")
    parser.add_argument("--sessions", type=int, default=10, help="of two minutes a level (%(default)s)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (%(default)s)")
    args = parser.parse_args()
    (show_provisional if args.provisional else show_shipped)(args)


if __name__ == "__main__":
    main()
