"""`gestured-lab adapt`: writes an adapted model, or says why it is no better."""

import argparse
import hashlib
import json
import os
import sys
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

import torch

from gestured.client.say import say, say_json
from gestured.core.errors import GesturedError
from gestured.lab.adapt.adaptation import Adapted, Shares, adapt
from gestured.lab.adapt.learning import Course, simulate
from gestured.lab.adapt.material import Own, own_recordings
from gestured.lab.adapt.weights import Base, base_of
from gestured.lab.decide import calibration_of
from gestured.lab.export import Facts, export_net
from gestured.lab.fit import CLASSES
from gestured.lab.own.learn import PEOPLE, teach
from gestured.lab.quantiles import answer_figures, quantiles
from gestured.lab.recordings.origin import KEY, origins
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
    own = own_recordings(args.recordings, args.as_none)
    learned_from = _learned_from(base, args.recordings)
    cache = args.cache or cache_folder()
    cache.mkdir(parents=True, exist_ok=True)
    takes = simulate(cache, JOBS)
    found = adapt(base, own, takes, Course(steps=args.steps))
    reasons = found.reasons()
    written = not reasons or args.force
    if not args.json:
        _tell(own, found)
    if written:
        _write(found, out, _facts(base, own, found, takes.teach, learned_from), cache)
    if args.json:
        say_json(_figures(own, found) | {"written": str(out) if written else None, "reasons": reasons})
    else:
        why = f": {'; '.join(reasons)}" if reasons else ""
        say(f"{out}: {'written' if written else 'not written'}{why}", to=sys.stdout if written else sys.stderr)
    return 0 if written else 1


def _write(found: Adapted, out: Path, facts: Facts, cache: Path) -> None:
    """Write the model, whole or not at all; what own gestures need is learned anew, since it depends on the weights."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / out.name
        export_net(found.new.judged, made, facts)
        teach(made, cache, PEOPLE, JOBS)
        write(out, made.read_bytes())


def _learned_from(base: Base, recordings: list[Path]) -> list[dict[str, Any]]:
    """All that the new model learns from. Raises GesturedError if its base has learned from the same recordings."""
    before, new = json.loads(base.model.properties.get(KEY, "[]")), origins(recordings)
    for old, one in product(before, new):
        if old["sha256"] == one["sha256"] or old["consents"].items() & one["consents"].items():
            raise GesturedError(
                f"--base: {base.model.name} has learned from {old['file']}, so that nobody in {one['file']} can be "
                "held out; expected the model that it was made of, and all recordings"
            )
    return [*before, *new]


def _facts(base: Base, own: Own, found: Adapted, simulated: Samples, learned_from: list[dict[str, Any]]) -> Facts:
    """The facts that the new file holds."""
    new, gestures = found.new, own.samples.take(own.samples.labels != NONE)
    cut = new.answers.confidence >= 0
    learned = base.model.metadata.training_data + own.samples.digest() + simulated.digest()
    return Facts(
        kind=base.kind,
        version=base.model.metadata.version,
        gestures=list(GESTURES),
        window=WINDOW,
        calibration=calibration_of(new.judged.decision, new.least),
        training_data=hashlib.sha256(learned.encode()).hexdigest(),
        quantiles=quantiles(gestures) | answer_figures(new.answers.confidence[cut], new.answers.known[cut], new.least),
        classes=CLASSES,
        context=base.model.metadata.context,
        provisional=found.provisional,
        learned_from=learned_from,
    )


def _figures(own: Own, found: Adapted) -> dict[str, Any]:
    new, groups = found.new, found.new.groups
    return {
        "people": len(own.names),
        "held_out": {"unit": groups.unit, "groups": groups.count, "worth": WORTH[groups.unit]},
        "left_out": own.left_out,
        "before": {"own": new.before.as_dict(), "simulated": found.before.as_dict()},
        "after": {"own": new.after.as_dict(), "simulated": found.after.as_dict()},
        "threshold": round(new.least, 4),
        "way": new.way,
    }


def _tell(own: Own, found: Adapted) -> None:
    new, shares = found.new, found.new.before
    say(f"{len(own.names)} people, {shares.gestures} gestures, {shares.others} non-gestures")
    for name, count in sorted(own.left_out.items()):
        say(f"left out: {name} ({count}), neither taught nor rejected, so that it can be enrolled")
    say(f"{'':<16}{'right':>16}{'wrong':>16}{'unknown':>16}{'others taken':>16}")
    for title, before, after in (("own", new.before, new.after), ("simulated", found.before, found.after)):
        say(_row(f"{title} before", before), _row(f"{title} after", after))
    say(f"threshold {new.least:.3f}, at which no more are wrong than before", WORTH[new.groups.unit])
    say(
        "the model has no operating points: every strictness takes this threshold, which may be laxer than normal was",
        "(gestured-lab everyday counts what is false, gesturectl tune proposes other thresholds)",
    )


def _row(title: str, shares: Shares) -> str:
    cells = []
    for share, low, high in (shares.right, shares.wrong, shares.unknown, shares.accepted):
        cells.append(f"{share:.3f} {low:.2f}-{high:.2f}" if share == share else "-")
    return f"{title:<16}" + "".join(f"{cell:>16}" for cell in cells)
