"""`gestured-lab adapt`: writes an adapted model, or says why it is no better.

With tapes of hours in which nobody made a gesture among the recordings, the model learns to be silent (`silence`).
"""

import argparse
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import torch

from gestured.client.say import say, say_json
from gestured.client.values import each_once
from gestured.core.errors import GesturedError
from gestured.lab.adapt.adaptation import Adapted, Interval, Shares, adapt
from gestured.lab.adapt.learning import Course, simulate
from gestured.lab.adapt.material import Own, own_recordings
from gestured.lab.adapt.silence import Quieter, own_hours, quieter
from gestured.lab.adapt.weights import Base, base_of
from gestured.lab.decide import calibration_of
from gestured.lab.export import Facts, export_net
from gestured.lab.fit import CLASSES
from gestured.lab.own.learn import PEOPLE, teach
from gestured.lab.points import by_strictness
from gestured.lab.quantiles import answer_figures, quantiles
from gestured.lab.recordings.origin import KEY, origins
from gestured.lab.recordings.protocol import one_spelling
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.written import write
from gestured.model.shipped import shipped_name
from gestured.simulator import GESTURES, NONE

JOBS = 2  # processes that simulate
WORTH = {
    "people": "Each person was judged by networks that had not learned from that person.",
    "sessions": "All recordings are of one person, so sessions were held out in turn: that says how the model will do "
    "with this person on another day, and nothing of other people.",
    "parts of one session": "All recordings are one session of one person, so stretches of it were held out in turn: "
    "that says little of another day, and nothing of other people.",
}


def cache_folder() -> Path:
    """Where a user's simulated takes are kept between two runs."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "gestured"


def run(args: argparse.Namespace) -> int:
    """Adapt a model, print its shares, and write it if it is better or `--force` is given; else exit status 1."""
    out: Path = args.out
    if out.suffix != ".onnx":
        raise GesturedError(f"--out: expected a file *.onnx, found {out}")
    if shipped_name(out) is not None:
        raise GesturedError(f"--out: {out} is a shipped model, which stays as it is; give the new one another name")
    torch.set_num_threads(1)  # networks this small are slower on two threads, above all on a busy machine
    base = base_of(args.base)
    recordings = [path for path in args.recordings if path.suffix == ".npz"]
    tapes = [path for path in args.recordings if path.suffix != ".npz"]
    if not recordings:
        raise GesturedError(f"{tapes[0]}: expected recordings of gestures (.npz) beside tapes in which nobody made one")
    each_once(tapes)
    own = own_recordings(recordings, args.as_none)
    learned_from = _learned_from(base, args.recordings)
    lived = own_hours(tapes, own.grid) if tapes else None
    cache = args.cache or cache_folder()
    cache.mkdir(parents=True, exist_ok=True)
    takes = simulate(cache, JOBS)
    found = adapt(base, own, takes, Course(steps=args.steps)) if lived is None else quieter(base, own, lived, takes)
    reasons = found.reasons()
    written = not reasons or args.force
    if not args.json:
        _tell_hours(own, found) if isinstance(found, Quieter) else _tell(own, found)
    if written:
        others = [takes.teach] if lived is None else [lived.samples, takes.teach]
        _write(found, out, _facts(base, own, found, others, learned_from), cache)
    if args.json:
        told = _hours(own, found) if isinstance(found, Quieter) else _figures(own, found)
        say_json(told | {"written": str(out) if written else None, "reasons": reasons})
    else:
        why = f": {'; '.join(reasons)}" if reasons else ""
        say(f"{out}: {'written' if written else 'not written'}{why}", to=sys.stdout if written else sys.stderr)
    return 0 if written else 1


def _write(found: Adapted | Quieter, out: Path, facts: Facts, cache: Path) -> None:
    """Write the model, whole or not at all; what own gestures need is learned anew, since it depends on the weights."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / out.name
        export_net(found.judged, made, facts)
        teach(made, cache, PEOPLE, JOBS)
        write(out, made.read_bytes())


def _learned_from(base: Base, recordings: list[Path]) -> list[dict[str, Any]]:
    """All that the new model learns from. Raises GesturedError if its base has learned from the same files or people.

    A pseudonym without a consent may be another person's, as those of public data are.
    """
    before, new = json.loads(base.model.properties.get(KEY, "[]")), origins(recordings)
    for old, one in product(before, new):
        known, here = (set(map(one_spelling, names)) for names in (old.get("consents", {}), one["subjects"]))
        if old["sha256"] == one["sha256"] or known & here:
            raise GesturedError(
                f"--base: {base.model.name} has learned from {old['file']}, so that nobody in {one['file']} can be "
                "held out; expected the model that it was made of, and all recordings"
            )
    return [*before, *new]


def _facts(
    base: Base, own: Own, found: Adapted | Quieter, others: Sequence[Samples], learned_from: list[dict[str, Any]]
) -> Facts:
    """The facts that the new file holds, of a model that has learned from own and other samples."""
    gestures = own.samples.take(own.samples.labels != NONE)
    learned = base.model.metadata.training_data + "".join(samples.digest() for samples in (own.samples, *others))
    return Facts(
        kind=base.kind,
        version=base.model.metadata.version,
        gestures=list(GESTURES),
        window=WINDOW,
        calibration=calibration_of(found.judged.decision, found.least),
        training_data=hashlib.sha256(learned.encode()).hexdigest(),
        quantiles=quantiles(gestures) | answer_figures(*found.answered(), found.least),
        classes=CLASSES,
        context=base.model.metadata.context,
        operating_points=found.points,
        provisional=found.provisional,
        learned_from=learned_from,
    )


def _figures(own: Own, found: Adapted) -> dict[str, Any]:
    groups = found.groups
    return {
        "people": len(own.names),
        "held_out": {"unit": groups.unit, "groups": groups.count, "worth": WORTH[groups.unit]},
        "left_out": own.left_out,
        "before": {"own": found.before.as_dict(), "simulated": found.simulated_before.as_dict()},
        "after": {"own": found.after.as_dict(), "simulated": found.simulated_after.as_dict()},
        "threshold": round(found.least, 4),
        "way": found.way,
    }


def _tell(own: Own, found: Adapted) -> None:
    shares = found.before
    say(f"{len(own.names)} people, {shares.gestures} gestures, {shares.others} non-gestures")
    _tell_left_out(own)
    say(f"{'':<16}{'right':>16}{'wrong':>16}{'unknown':>16}{'others taken':>16}")
    say(_row("own before", found.before), _row("own after", found.after))
    say(_row("simulated before", found.simulated_before), _row("simulated after", found.simulated_after))
    say(f"threshold {found.least:.3f}, at which no more are wrong than before at normal", WORTH[found.groups.unit])
    say(
        "the model has no operating points: every strictness publishes from this threshold on, and how many gestures",
        "are false in everyday contact is not known yet",
        "(gestured-lab everyday counts what is false, gesturectl tune proposes other thresholds)",
    )


def _tell_left_out(own: Own) -> None:
    for name, count in sorted(own.left_out.items()):
        say(f"left out: {name} ({count}), neither taught nor rejected, so that it can be enrolled")


def _hours(own: Own, found: Quieter) -> dict[str, Any]:
    return {
        "people": len(own.names),
        "hours": round(found.hours, 3),
        "held_out": {"recordings": found.unit, "tapes": found.lived.unit},
        "left_out": own.left_out,
        "before": found.before.as_dict(),
        "before_as_many_right": found.moved.as_dict(),
        "after": found.after.as_dict(),
        "points": found.points,
    }


def _tell_hours(own: Own, found: Quieter) -> None:
    contacts = f"{found.hours:.1f} h of tapes with {len(found.lived.samples)} contacts"
    say(f"{len(own.names)} people, {own.performed} gestures; {contacts}")
    _tell_left_out(own)
    say(f"{'':<22}{'false an hour':>20}{'right':>18}{'wrong':>18}")
    rows = ("as it was", found.before), ("one threshold", found.moved), ("adapted", found.after)
    for title, cost in rows:
        low, high = cost.false[1:]
        cells = f"{cost.false[0]:.2f} {low:.1f}-{high:.1f}", *map(_share, (cost.right, cost.wrong))
        say(f"{title:<22}{cells[0]:>20}{cells[1]:>18}{cells[2]:>18}")
    say("the last two rows: with one threshold for all gestures, at which as many are right as in the first")
    say(f"held out in turn: {found.unit} of the recordings, {found.lived.unit}")
    say("operating points, chosen on the answers to what was held out:", *by_strictness(found.points).splitlines())


def _share(of: Interval) -> str:
    share, low, high = of
    return f"{share:.3f} {low:.2f}-{high:.2f}" if share == share else "-"


def _row(title: str, shares: Shares) -> str:
    cells = map(_share, (shares.right, shares.wrong, shares.unknown, shares.accepted))
    return f"{title:<16}" + "".join(f"{cell:>16}" for cell in cells)
