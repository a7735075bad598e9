"""`gestured-lab adapt`: flags in, a model out, or the reason why not."""

import argparse
import hashlib
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import torch

from gestured.client.say import say, say_json
from gestured.core.errors import GesturedError
from gestured.lab.adapt.adaptation import Adapted, adapt
from gestured.lab.adapt.judging import Shares
from gestured.lab.adapt.learning import Course
from gestured.lab.adapt.material import Own, own_recordings
from gestured.lab.adapt.takes import simulate
from gestured.lab.adapt.weights import Base, base_of
from gestured.lab.export import Facts, export_net
from gestured.lab.fit import CLASSES
from gestured.lab.own.command import PEOPLE, teach
from gestured.lab.recordings.origin import KEY, origins
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.train import answer_figures, quantiles
from gestured.model.shipped import shipped_name
from gestured.record.files import PUBLIC, atomic_write
from gestured.simulator import GESTURES, NONE

MOST_STEPS = 10_000
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
    """Adapt, say what it is worth, and write it where it is better. Exit status 1 where it is not."""
    out: Path = args.out
    if out.suffix != ".onnx" or not out.parent.is_dir():
        raise GesturedError(f"--out: expected a file *.onnx in a folder that exists, found {out}")
    if shipped_name(out) is not None:
        raise GesturedError(f"--out: {out} is a shipped model, which stays as it is; give the new one another name")
    if not 1 <= args.steps <= MOST_STEPS:
        raise GesturedError(f"--steps: expected 1 to {MOST_STEPS}, found {args.steps}")
    torch.set_num_threads(1)  # networks this small are slower on two, above all where something else computes
    base = base_of(args.base)
    own = own_recordings(args.recordings, args.as_none)
    cache = args.cache or cache_folder()
    takes = simulate(cache, JOBS)
    found = adapt(base, own, takes, Course(steps=args.steps))
    reasons = found.reasons()
    written = not reasons or args.force
    if written:
        _write(found, out, _facts(base, own, found, takes.teach, args.recordings), cache)
    if args.json:
        say_json(_figures(own, found) | {"written": str(out) if written else None, "reasons": reasons})
    else:
        _tell(own, found)
        why = f": {'; '.join(reasons)}" if reasons else ""
        say(f"{out}: {'written' if written else 'not written'}{why}", to=sys.stdout if written else sys.stderr)
    return 1 if reasons else 0


def _write(found: Adapted, out: Path, facts: Facts, cache: Path) -> None:
    """All of the model or nothing: what it needs for gestures of its user's own depends on the new weights."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / out.name
        export_net(found.judged, made, facts)
        teach(made, cache, PEOPLE, JOBS)
        with atomic_write(out, PUBLIC) as file:
            file.write(made.read_bytes())


def _facts(base: Base, own: Own, found: Adapted, simulated: Samples, recordings: list[Path]) -> Facts:
    """What the new file says of itself."""
    decision, gestures = found.judged.decision, own.samples.take(own.samples.labels != NONE)
    cut = found.answers.confidence >= 0
    before = json.loads(base.properties.get(KEY, "[]"))
    learned = base.model.metadata.training_data + own.samples.digest() + simulated.digest()
    return Facts(
        kind=base.kind,
        version=base.model.metadata.version,
        gestures=list(GESTURES),
        window=WINDOW,
        calibration={
            "temperature": (1 / decision.share.clamp(min=1e-6)).tolist(),
            "unknown_weight": decision.weight.tolist(),
            "unknown_bias": float(decision.bias),
            "threshold": found.least,
        },
        training_data=hashlib.sha256(learned.encode()).hexdigest(),
        quantiles=quantiles(gestures)
        | answer_figures(found.answers.confidence[cut], found.answers.known[cut], found.least),
        classes=CLASSES,
        provisional=found.provisional,
        learned_from=[*before, *origins(recordings)],
    )


def _figures(own: Own, found: Adapted) -> dict[str, Any]:
    return {
        "people": len(own.names),
        "held_out": {"unit": found.unit, "groups": found.groups, "worth": WORTH[found.unit]},
        "left_out": own.left_out,
        "before": {"own": found.before.own.as_dict(), "simulated": found.before.simulated.as_dict()},
        "after": {"own": found.after.own.as_dict(), "simulated": found.after.simulated.as_dict()},
        "threshold": round(found.least, 4),
        "way": found.way,
    }


def _tell(own: Own, found: Adapted) -> None:
    shares = found.before.own
    say(f"{len(own.names)} people, {shares.gestures} gestures, {shares.others} non-gestures")
    for name, count in sorted(own.left_out.items()):
        say(f"left out: {name} ({count}), neither taught nor rejected, so that it can be enrolled")
    say(f"{'':<16}{'right':>16}{'wrong':>16}{'unknown':>16}{'others taken':>16}")
    for title, before, after in (
        ("own", found.before.own, found.after.own), ("simulated", found.before.simulated, found.after.simulated),
    ):  # fmt: skip
        say(_row(f"{title} before", before), _row(f"{title} after", after))
    say(f"threshold {found.least:.3f}, where no more are wrong than before", WORTH[found.unit])


def _row(title: str, shares: Shares) -> str:
    cells = []
    for share, low, high in (shares.right, shares.wrong, shares.unknown, shares.accepted):
        cells.append(f"{share:.3f} {low:.2f}-{high:.2f}" if share == share else "-")
    return f"{title:<16}" + "".join(f"{cell:>16}" for cell in cells)
