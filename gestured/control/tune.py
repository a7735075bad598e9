"""`gesturectl tune`: print what each threshold costs on the user's own recordings, and propose one."""

import argparse
import dataclasses
import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from gestured.client.program import Commands
from gestured.client.say import say, say_json
from gestured.client.values import each_once, number
from gestured.control.diff import Recorded
from gestured.control.labelled import Labelled
from gestured.control.tuning import ENOUGH, Counts, Played, Tuned, tune
from gestured.core import messages
from gestured.core.errors import RecordingError
from gestured.core.points import USUAL
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.record.judge import NONE, UNNAMED
from gestured.record.replay import Replay

BAR = 36  # characters
ENOUGH_H = 1.0  # hours; fewer cannot show a few false gestures an hour
SHORTEST_S = 60.0  # the shortest recordings without gestures from which a threshold can be judged


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "tune",
        help="print what each threshold costs on your recordings",
        description="Play recordings through the daemon's own code, and print for every threshold which share of the\n"
        "gestures is missed and wrong, and how many events an hour nobody meant. An .npz says what was\n"
        'performed; a tape of gesturectl record counts as "other things": whatever is published in it is\n'
        "false. A performance before the sensor was known is left out. With a budget it proposes only what\n"
        "your hours show to keep it, at 95 %: none in 6 hours shows 0.5 an hour.",
        epilog="examples:\n  gesturectl tune recordings/07.npz recordings/08.npz\n"
        "  gesturectl tune recordings/07.npz evening.mcap --model my.onnx\n"
        "  gesturectl tune monday.mcap tuesday.mcap --budget 0.5",
    )
    parser.takes("recordings", "FILE", "an .npz with labels, or a tape", type=Path, nargs="+")
    parser.takes("--model", "MODEL", "shipped, or a file (default: cnn_lstm)", default="cnn_lstm")
    text = "how many false gestures an hour there may be at most"
    parser.takes("--budget", "PER_HOUR", text, type=number(0.001, 100))
    parser.runs(run, "print the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Play all recordings, count, and print figures and proposal. Raises RecordingError if they are too short."""
    each_once(args.recordings)
    model, played = open_model(args.model), Played()
    for path in args.recordings:
        play(path, model, played)
    if not played.performed and played.seconds < SHORTEST_S:
        found = f"{args.recordings[0]}: found {played.seconds:.0f} s in which nobody made a gesture"
        left = f"; {played.skipped} are left out, of unknown names or without a quiet second before them"
        expected = f"expected at least {SHORTEST_S:.0f} s of that, or recorded gestures{left if played.skipped else ''}"
        raise RecordingError(f"{found}, {expected}")
    tuned = tune(model, played, args.budget)
    if args.json:
        say_json(_figures(tuned))
    else:
        say(*_words(tuned))
    return 0


def play(path: Path, model: Model, played: Played) -> None:
    """Play a file, and add what it holds to `played`. Raises RecordingError."""
    labelled = path.suffix == ".npz"
    source: Labelled | Recorded = Labelled(path, "recording") if labelled else Recorded(path)
    scene = source.scene(model.gestures) if isinstance(source, Labelled) else source.maker.scene
    if not source.tape.packets:
        raise RecordingError(f"{path}: holds no packets")
    # Only thresholds may decide what is published: gates and arming would silence contacts at every threshold.
    scene = dataclasses.replace(
        scene,
        gestures=model.gestures,
        thresholds=dict.fromkeys(model.gestures, 0.0),
        refractory={},
        arming=None,
        sensors={name: dataclasses.replace(setup, arming=None) for name, setup in scene.sensors.items()},
    )
    replay = Replay(dataclasses.replace(source.tape, events=()), scene, model)
    lines = [json.loads(messages.to_json(event, replay.epoch)) for event in replay.events()]
    events = [line for line in lines if line["type"] == "gesture"]
    if isinstance(source, Labelled):
        played.seconds += source.seconds
        performed = [*source.performed()]
        for one in performed:  # a gesture of the user's own is enrolled: no threshold of the model's finds or loses it
            one.label = one.label if one.label in (*model.gestures, NONE) else UNNAMED
        played.add(performed, events, partial(replay.knew, "recording"))
    else:
        played.seconds += sum(sensor.seconds for sensor in replay.played.values())
        played.add([], events)


def _figures(tuned: Tuned) -> dict[str, Any]:
    played, best = tuned.played, tuned.best
    return {
        "model": tuned.model.name, "gestures": len(played.performed), "non_gestures": played.others,
        "skipped": played.skipped, "hours": round(played.hours, 4), "missed_by": tuned.missed_by,
        "thresholds": [_row(played, row) for row in tuned.rows],
        "operating_points": {name: _row(played, row) for name, row in tuned.points.items()},
        "now": _row(played, tuned.now), "proposed": best and _row(played, best), "strictness": tuned.strictness,
        "budget": tuned.budget, "most": tuned.most,
        "each": {name: _row(played, row) for name, row in tuned.each.items()},
    }  # fmt: skip


def _row(played: Played, counts: Counts) -> dict[str, Any]:
    false = round(counts.false / played.hours, 2) if played.hours else None
    return dataclasses.asdict(counts) | {"false_an_hour": false}


def _words(tuned: Tuned) -> Iterator[str]:
    """The table with bars, and the proposed settings, in lines for a person."""
    played, best, name = tuned.played, tuned.best, tuned.model.name
    total, hours = max(played.meant, 1e-9), max(played.hours, 1e-9)
    yield f"{len(played.performed)} gestures, {played.others} non-gestures, {60 * hours:.1f} minutes; {name}"
    if played.skipped:
        yield f"left out, since the gesture or the sensor was not known: {played.skipped}"
    if tuned.missed_by == "model":
        yield "nobody performed a gesture: what is missed is taken from the model's own curve"
    yield f"threshold  missed   wrong  false/h   {'░ missed':<10}{'█ wrong and false'}"
    rows = [*((f"{row.threshold:.2f}", row) for row in tuned.rows), *tuned.points.items()]
    worst = max((row.missed or 0) + row.wrong + row.false for _, row in rows) or 1
    for title, row in rows:
        bars = "█" * round(BAR * (row.wrong + row.false) / worst) + "░" * round(BAR * (row.missed or 0) / worst)
        chosen = best and (row is best or (row.threshold is not None and row.threshold == best.threshold))
        missed = "    -" if row.missed is None else f"{100 * row.missed / total:5.1f}"
        yield (
            f"{title:>7} {'<' if chosen else ' '} {missed} % {100 * row.wrong / total:5.1f} % "
            f"{row.false / hours:8.1f}   {bars}"
        ).rstrip()
    if tuned.budget:
        yield f"budget   {tuned.budget:g} an hour: at most {tuned.most} in {hours:.3g} hours show that, at 95 %"
    yield f"now      {_said(tuned, tuned.now, USUAL)}"
    if best is None:
        yield "proposed nothing: nobody performed a gesture, and the model does not say what it misses"
        return
    yield f"proposed {_said(tuned, best, tuned.strictness)}"
    if not tuned.budget and played.hours < ENOUGH_H and (best.missed or 0) < (tuned.now.missed or 0):
        yield "more may be false than now: these minutes cannot show it, hours of a tape can"
    if tuned.strictness:
        yield from ("for the configuration file, above its tables:", f'strictness = "{tuned.strictness}"')
        return
    yield "for the configuration file:"
    for gesture in tuned.model.gestures:
        yield from (f"[gestures.{gesture}]", f"threshold = {tuned.each.get(gesture, best).threshold:.2f}")
    few = len(tuned.model.gestures) - len(tuned.each)
    if few:
        yield f"# {few} were performed less than {ENOUGH} times: they have the common threshold"


def _said(tuned: Tuned, counts: Counts, name: str | None) -> str:
    title = name if counts.threshold is None else f"{counts.threshold:.2f}"
    if tuned.played.performed:
        return f"{title}: {counts.missed:g} missed, {counts.wrong} wrong, {counts.false} false"
    missed = "" if counts.missed is None else f"{100 * counts.missed / max(tuned.played.meant, 1e-9):.1f} % missed, "
    return f"{title}: {missed}{counts.false} false"
