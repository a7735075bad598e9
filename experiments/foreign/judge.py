"""Judge models on the independent generator.

    python -m experiments.foreign.judge --n 20 --level nominal hard --document docs/figures.md
    python -m experiments.foreign.judge --model cnn_lstm --n 40 --level nominal hard
    python -m experiments.foreign.judge --model cnn_lstm --grids
    python -m experiments.foreign.judge --model cnn_lstm --provisional --sessions 10

Without --model all shipped models are judged, a row for each; --document puts the table into a page, and
each model's rows into its card. A take's outcome is one of: `missed` (no segment), `cancelled:REASON`, `split` (more
than one segment or event), or its one segment's label. Takes that nobody can recognise (see `visible`) are counted as
`unseen` and left out.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from textwrap import fill
from typing import Any

from experiments.early import Ahead, heard, table
from experiments.foreign import GESTURES, GRIDS, LEVELS, NON_GESTURES, other_grids, session, take
from experiments.pages import command, tell
from gestured.core.classifier import Classifier
from gestured.core.events import Cancelled, Gesture, Onset, Unknown
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab.cards import with_interval
from gestured.lab.dataset import Truth
from gestured.lab.intervals import interval
from gestured.lab.made_of import digests, made_of, renew
from gestured.model.opening import open_model
from gestured.model.shipped import shipped

SEEN = 4.0  # times the noise
SESSION_S = 120.0
OPENED = Path("experiments/foreign/opened.txt")  # kept in a checkout: when it judged for a page, and which models
Take = dict[str, Any]
HEAD = (
    "| model and sensors | gestures | right\\* | right | wrong | lost | non-gestures | rejected |",
    "|---|---|---|---|---|---|---|---|",
)
OF_A_CARD = (
    "Answers on a second simulator of people and sensors (`experiments/foreign`), written "
    "independently of the first, from",
    "which no model learns. Sensors are as good as the nominal one, or much worse (hard).",
)


@dataclass
class Outcome:
    """What became of one take."""

    kind: str
    level: str
    seed: int
    answer: str  # label | "unknown" | "missed" | "split" | "cancelled:REASON"
    before: str = ""  # best label before rejection, if there is one segment
    late: float = 0.0  # s, decision after the true release
    ready: bool = True


def _frames(recording: Take) -> Iterator[Frame]:
    for t, values in zip(recording["times"], recording["frames"], strict=True):
        yield Frame(float(t), values)


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


def judge(recording: Take, seed: int, level: str, classifier: Classifier) -> Outcome:
    """Run one take through a fresh sensor."""
    machine = Sensor("foreign", Scene(classifier.gestures, recording["frames"].shape[1:]), classifier)
    onset, release = recording["onset"], recording["release"]
    events: list[Any] = []
    ready = False
    for frame in _frames(recording):
        if frame.t < onset:
            ready = machine.front_end.ready
        events += events_of(machine.push(frame))
    events += events_of(machine.flush(float(recording["times"][-1]) + 5.0))
    decided = [e for e in events if isinstance(e, Gesture | Unknown)]
    cancelled = [e for e in events if isinstance(e, Cancelled)]
    slack = 2.0 / max(float(len(recording["times"]) / recording["times"][-1]), 1.0)
    inside = [e for e in decided if e.onset <= release + slack + 0.2 and e.offset >= onset - slack]
    result = Outcome(recording["kind"], level, seed, "missed", ready=ready)
    if len(inside) + len(cancelled) > 1:
        result.answer = "split"
        named = [e for e in inside if isinstance(e, Gesture)]
        if named and recording["label"] == "none":
            result.answer = named[0].gesture  # a non-gesture in pieces, one of which was taken for a gesture
        elif recording["label"] == "none":
            result.answer = "unknown"
    elif inside:
        event = inside[0]
        result.late = event.decided - release
        result.before = max(event.scores, key=lambda name: event.scores[name])
        result.answer = event.gesture if isinstance(event, Gesture) else "unknown"
    elif cancelled:
        result.answer = f"cancelled:{cancelled[0].reason}"
    elif any(isinstance(e, Onset) for e in events):
        result.answer = "cancelled:?"
    return result


def _batch(task: tuple[str, str, str, int, bool, int, bool]) -> tuple[list[Outcome], int]:
    source, kind, level, count, grids, first, whole = task
    classifier = open_model(source)
    outcomes: list[Outcome] = []
    unseen = 0
    for seed in range(first, first + count):
        if grids:
            outcomes += [
                judge(r, seed, "{}x{}".format(*r["frames"].shape[1:]), classifier) for r in other_grids(kind, seed)
            ]
            continue
        recording = take(kind, seed, level)
        if not whole and not visible(recording):
            unseen += 1
            continue
        outcomes.append(judge(recording, seed, level, classifier))
    return outcomes, unseen


def summary(outcomes: list[Outcome], unseen: dict[str, int]) -> dict[str, Any]:
    """The figures of all tables, as plain data; shares are 0..1."""
    result: dict[str, Any] = {}
    for level in dict.fromkeys(o.level for o in outcomes):
        own = [o for o in outcomes if o.level == level]
        gestures, others = [o for o in own if o.kind in GESTURES], [o for o in own if o.kind not in GESTURES]
        n = max(len(gestures), 1)
        kinds: dict[str, Any] = {}
        for kind in dict.fromkeys(o.kind for o in own):
            mine = [o for o in own if o.kind == kind]
            answers = Counter(o.answer for o in mine)
            kinds[kind] = {
                "n": len(mine),
                "before": sum(o.before == kind for o in mine) / len(mine),
                "answers": dict(answers.most_common()),
                "late_s": sorted(o.late for o in mine)[len(mine) // 2],
            }
        result[level] = {
            "gestures": len(gestures),
            "unseen": unseen.get(level, 0),
            "not_ready": sum(not o.ready for o in own),
            "before_rejection": sum(o.before == o.kind for o in gestures) / n,
            "right": sum(o.answer == o.kind for o in gestures) / n,
            "wrong": sum(o.answer in GESTURES and o.answer != o.kind for o in gestures) / n,
            "unknown": sum(o.answer == "unknown" for o in gestures) / n,
            "missed": sum(o.answer == "missed" for o in gestures) / n,
            "cancelled": sum(o.answer.startswith("cancelled") for o in gestures) / n,
            "split": sum(o.answer == "split" for o in gestures) / n,
            "non_gestures": len(others),
            "rejected": sum(o.answer not in GESTURES for o in others) / max(len(others), 1),
            "ends": {
                "right": _ends(o.answer == o.kind for o in gestures),
                "wrong": _ends(o.answer in GESTURES and o.answer != o.kind for o in gestures),
                "lost": _ends(o.answer not in GESTURES for o in gestures),
                "rejected": _ends(o.answer not in GESTURES for o in others),
            },
            "kinds": kinds,
        }
    return result


def _ends(hits: Iterable[bool]) -> dict[str, float]:
    """The ends of a share's 95 % interval; each take is of another person."""
    counted = list(hits)
    _, low, high = interval(counted, range(len(counted)))
    return {"low": low, "high": high}


def row(model: str, level: str, found: dict[str, Any]) -> str:
    """A line of the table; a gesture is lost if it is unknown, missed, cancelled or split."""
    lost = sum(found[name] for name in ("unknown", "missed", "cancelled", "split"))
    right, wrong, gone, rejected = (
        with_interval(share, found["ends"][name])
        for name, share in (
            ("right", found["right"]),
            ("wrong", found["wrong"]),
            ("lost", lost),
            ("rejected", found["rejected"]),
        )
    )
    before = f"{found['before_rejection']:.3f}"
    cells = (found["gestures"], before, right, wrong, gone, found["non_gestures"], rejected)
    return f"| `{model}.onnx`, another generator, {level} | {' | '.join(map(str, cells))} |"


def left_out(results: dict[str, dict[str, Any]], args: argparse.Namespace) -> list[str]:
    """A note: how many gestures nobody could see, and the shares of right ones if each of these were lost."""
    asked, first = args.n * len(set(args.kinds) & set(GESTURES)), next(iter(results.values()))
    dark = ", ".join(f"{asked - found['gestures']} on {level} sensors" for level, found in first.items())
    shares = {
        name: ", ".join(f"{found['right'] * found['gestures'] / max(asked, 1):.3f}" for found in result.values())
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
    rows = {name: [row(name, level, found) for level, found in result.items()] for name, result in results.items()}
    above = [made_of(command(), shipped().values()), "", *HEAD]
    table = [*above, *(line for lines in rows.values() for line in lines), "", *left_out(results, args)]
    print("\n".join(table))
    if args.document:
        renew(args.document, "judged", table)
        if OPENED.exists():
            with OPENED.open("a") as file:
                file.write(f"{date.today()} {' '.join(f'{a} {b}' for a, b in digests(shipped().values()).items())}\n")
        for name, path in shipped().items():
            renew(path.with_suffix(".md"), "judged", [*OF_A_CARD, "", *above, *rows[name]])


def _show(result: dict[str, Any]) -> None:
    for level, row in result.items():
        print(f"\n== {level}: {row['gestures']} gestures, {row['non_gestures']} non-gestures", end="")
        print(f" ({row['unseen']} unseen left out, {row['not_ready']} not ready at onset)")
        names = ("before_rejection", "right", "wrong", "unknown", "missed", "cancelled", "split", "rejected")
        print("   " + "  ".join(f"{name} {100 * row[name]:.1f} %" for name in names))
        for kind, k in row["kinds"].items():
            answers = ", ".join(f"{a} {c}" for a, c in k["answers"].items() if a != kind)
            rejected = sum(c for a, c in k["answers"].items() if a not in GESTURES)
            share = f"rejected {100 * rejected / k['n']:5.1f}"
            if kind in GESTURES:
                share = f"before {100 * k['before']:5.1f}  right {100 * k['answers'].get(kind, 0) / k['n']:5.1f}"
            print(f"   {kind:25s} n {k['n']:3d}  {share}  late {k['late_s']:+.2f} s  {answers}")


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


def judged(source: str, args: argparse.Namespace) -> dict[str, Any]:
    """The figures of a model on the takes that the options ask for."""
    levels = ["grids"] if args.grids else args.level
    tasks = [(source, k, lv, args.n, args.grids, args.first, args.whole) for lv in levels for k in args.kinds]
    outcomes: list[Outcome] = []
    unseen: dict[str, int] = defaultdict(int)
    with ProcessPoolExecutor(args.jobs) as pool:
        for task, (some, dark) in zip(tasks, pool.map(_batch, tasks), strict=True):
            outcomes += some
            unseen[task[2]] += dark
    return summary(outcomes, unseen)


def show_provisional(args: argparse.Namespace) -> None:
    """Print provisional events in sessions of the levels, and of non-gestures."""
    sets = {level: (level, 0.25) for level in args.level} | {"non-gestures": ("nominal", 1.0)}
    rows = {
        name: provisional(args.model, level, share, range(args.first, args.first + (args.sessions or 10)))
        for name, (level, share) in sets.items()
    }
    made = table("Provisional events, by another generator", rows)
    tell(made, [shipped().get(args.model, Path(args.model))], "early elsewhere", args.document)


def main() -> None:
    """Print what the options ask for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="a shipped model's name or a path; its figures kind by kind")
    parser.add_argument(
        "--document", type=Path, metavar="PAGE", help="a page to write; with all models' table, their cards"
    )
    parser.add_argument("--n", type=int, default=40, help="takes of each kind and level (%(default)s)")
    parser.add_argument("--first", type=int, default=0, help="first seed (%(default)s)")
    parser.add_argument("--level", nargs="+", choices=LEVELS, default=list(LEVELS))
    parser.add_argument("--kinds", nargs="+", default=[*GESTURES, *NON_GESTURES])
    parser.add_argument("--grids", action="store_true", help=f"other grids instead of levels: {GRIDS}")
    parser.add_argument("--sessions", type=int, default=0, help="of two minutes a level, with --provisional")
    parser.add_argument("--provisional", action="store_true", help="only: provisional events in those sessions")
    parser.add_argument("--whole", action="store_true", help="keep takes that nobody can recognise")
    parser.add_argument("--jobs", type=int, default=1, help="processes (%(default)s)")
    args = parser.parse_args()
    if args.provisional and args.model is None:
        parser.error("--provisional: expected a --model")
    if args.provisional:
        show_provisional(args)
    elif args.model is None:
        show_shipped(args)
    elif args.document:
        parser.error("--document: expected no --model, the page has all models")
    else:
        _show(judged(args.model, args))


if __name__ == "__main__":
    main()
