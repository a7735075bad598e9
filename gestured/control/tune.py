"""`gesturectl tune`: what every threshold costs on somebody's own recordings, and which one that suggests."""

import argparse
import dataclasses
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gestured.client.program import Commands
from gestured.client.say import say, say_json
from gestured.control.diff import Recorded
from gestured.control.labelled import Labelled
from gestured.control.tuning import ENOUGH, THRESHOLDS, Counts, Played, counted, for_each, proposed
from gestured.core import messages
from gestured.core.errors import GesturedError, RecordingError
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.record.replay import Replay

BAR = 36  # characters
SHORTEST_S = 60.0  # of recordings without gestures: in less, nothing can be told


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "tune",
        help="print what each threshold costs on your recordings",
        description="Play recordings through the daemon's own code, and print for every threshold which share of the\n"
        "gestures is missed and wrong, and how many events an hour nobody meant. An .npz says what was\n"
        'performed; a tape of gesturectl record counts as "other things": whatever is published in it is\n'
        "false. A performance before the sensor was known is left out.",
        epilog="examples:\n  gesturectl tune recordings/07.npz recordings/08.npz\n"
        "  gesturectl tune recordings/07.npz evening.mcap --model my.onnx",
    )
    parser.add_argument("recordings", type=Path, nargs="+", metavar="FILE", help="an .npz with labels, or a tape")
    parser.add_argument("--model", default="cnn_lstm", metavar="MODEL", help="shipped, or a file (default: cnn_lstm)")
    parser.add_argument("--wrong-costs", type=float, default=3.0, metavar="X",
                        help="a wrong or a false event is as bad as X missed gestures (default: 3)")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Play all, count, propose."""
    if not 0.1 <= args.wrong_costs <= 100:
        raise GesturedError(f"--wrong-costs {args.wrong_costs:g}: expected 0.1 to 100")
    model = open_model(Path(args.model) if "/" in args.model or args.model.endswith(".onnx") else args.model)
    played = Played()
    for path in args.recordings:
        play(path, model, played)
    if not played.performed and played.seconds < SHORTEST_S:
        raise RecordingError(f"{args.recordings[0]}: expected gestures, or a minute of something else")
    rows = [counted(played, threshold) for threshold in THRESHOLDS]
    best = proposed(rows, played, args.wrong_costs, model.threshold)
    tuned = Tuned(
        model, played, rows, counted(played, model.threshold), best, for_each(played, args.wrong_costs, best.threshold)
    )
    if args.json:
        say_json(_figures(tuned))
    else:
        say(*_words(tuned))
    return 0


@dataclass(frozen=True)
class Tuned:
    """All that is told."""

    model: Model
    played: Played
    rows: list[Counts]
    now: Counts  # at the model's own threshold
    best: Counts  # the row that is proposed
    each: dict[str, Counts]  # what is proposed for single gestures


def play(path: Path, model: Model, played: Played) -> None:
    """Add what a file holds to what was `played`. Raises RecordingError."""
    labelled = path.suffix == ".npz"
    source: Labelled | Recorded = Labelled(path, "recording") if labelled else Recorded(path)
    scene = source.scene(model.gestures) if isinstance(source, Labelled) else source.maker.scene
    if not source.tape.packets:
        raise RecordingError(f"{path}: holds no packets")
    scene = dataclasses.replace(
        scene, gestures=model.gestures, thresholds=dict.fromkeys(model.gestures, 0.0), refractory={}
    )
    replay = Replay(source.tape, scene, model)
    lines = [json.loads(messages.to_json(event, replay.epoch)) for event in replay.events()]
    events = [line for line in lines if line["type"] == "gesture"]
    performed = source.performed() if isinstance(source, Labelled) else []
    known = [one for one in performed if _knew(replay, one.onset)]
    played.skipped += len(performed) - len(known)
    played.seconds += (source.tape.packets[-1].t_ns - source.tape.packets[0].t_ns) / 1e9
    played.add(known, events)


def _knew(replay: Replay, t: float) -> bool:
    return any(sensor.knew(t - replay.epoch) for sensor in replay.played.values())


def _figures(tuned: Tuned) -> dict[str, Any]:
    played = tuned.played
    return {
        "model": tuned.model.name, "gestures": len(played.performed), "non_gestures": played.others,
        "skipped": played.skipped, "hours": round(played.seconds / 3600, 4),
        "thresholds": [_row(played, row) for row in tuned.rows],
        "now": _row(played, tuned.now), "proposed": _row(played, tuned.best),
        "each": {name: _row(played, row) for name, row in tuned.each.items()},
    }  # fmt: skip


def _row(played: Played, counts: Counts) -> dict[str, Any]:
    hours = played.seconds / 3600
    return dataclasses.asdict(counts) | {"false_an_hour": round(counts.false / hours, 2) if hours else None}


def _words(tuned: Tuned) -> Iterator[str]:
    """The table, a picture of it, and the settings."""
    played, rows, best, now = tuned.played, tuned.rows, tuned.best, tuned.now
    total, hours = max(len(played.performed), 1), max(played.seconds / 3600, 1e-9)
    performed = f"{len(played.performed)} gestures, {played.others} non-gestures"
    yield f"{performed}, {60 * hours:.1f} minutes; {tuned.model.name}"
    if played.skipped:
        yield f"left out, since the sensor was not known yet: {played.skipped}"
    yield f"threshold  missed   wrong  false/h   {'░ missed':<10}{'█ wrong and false'}"
    worst = max(row.missed + row.wrong + row.false for row in rows) or 1
    for row in rows:
        bars = "█" * round(BAR * (row.wrong + row.false) / worst) + "░" * round(BAR * row.missed / worst)
        mark = "<" if row is best else " "
        yield (
            f"   {row.threshold:4.2f} {mark} {100 * row.missed / total:5.1f} % {100 * row.wrong / total:5.1f} % "
            f"{row.false / hours:8.1f}   {bars}"
        ).rstrip()
    yield f"now      {now.threshold:.2f}: {_said(now)}"
    yield f"proposed {best.threshold:.2f}: {_said(best)}"
    yield "for the configuration file:"
    for name in tuned.model.gestures:
        yield from (f"[gestures.{name}]", f"threshold = {tuned.each.get(name, best).threshold:.2f}")
    few = len(tuned.model.gestures) - len(tuned.each)
    if few:
        yield f"# {few} were performed less than {ENOUGH} times: they have what suits all"


def _said(counts: Counts) -> str:
    return f"{counts.missed} missed, {counts.wrong} wrong, {counts.false} false"
