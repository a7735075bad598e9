"""`gestured-lab everyday`: plays hours in processes, judges the answers, and prints, draws and writes the figures."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path

from gestured.client.values import each_once
from gestured.core.errors import GesturedError
from gestured.core.listening import LONGEST_S, Arming
from gestured.core.points import USUAL, Strictness
from gestured.lab.dataset import in_processes
from gestured.lab.everyday import FIRST, report
from gestured.lab.everyday.hours import Heard, hear, points_of
from gestured.lab.everyday.stretches import lived, recorded
from gestured.lab.made_of import made_of, renew, require_marks
from gestured.lab.written import printed, write
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped, shipped_name

LEAST_S = 1.0  # s that all recordings together must last, for a rate by the hour


@cache
def rungs(source: str) -> tuple[Model, ...]:
    """A model, and after it the shipped ones that know the same gestures; kept open in each process."""
    first = open_model(source)
    others = [open_model(name) for name in LADDER if name != first.name]
    return (first, *(model for model in others if model.gestures == first.gestures))


def at(source: str, strictness: Strictness) -> tuple[Model, ...]:
    """The `rungs` of a model that has this operating point; raises GesturedError if it has not."""
    models = rungs(source)
    if strictness not in (have := points_of(models[0])):
        raise GesturedError(
            f"--strictness {strictness}: {models[0].name} has no operating points, expected {', '.join(have)}"
        )
    return models


def run(args: argparse.Namespace) -> int:
    """Play the hours, judge the answers, and print, draw and write the figures."""
    of = "" if args.strictness == USUAL else f", {args.strictness}"
    _check(args)
    arming = Arming(args.arming, args.seconds) if args.arming else None
    lasts = "" if arming is None or arming == Arming(arming.by) else f" for {arming.seconds:g} s"
    armed = "" if arming is None else f"armed by {arming.by}{lasts}"
    block = f"{armed or 'everyday'}{of}"
    require_marks(block, args.document)
    models = at(args.model, args.strictness)
    if args.arming and args.arming not in models[0].gestures:
        raise GesturedError(f"--arming: expected one of {', '.join(models[0].gestures)}, found {args.arming!r}")
    if args.recordings:
        work = partial(_recorded, args.recordings, args.model, args.strictness)
        parts = in_processes(work, range(len(args.recordings)), args.jobs, "recordings")
    else:
        work = partial(_lived, args.model, args.strictness, arming)
        parts = in_processes(work, range(FIRST, FIRST + args.hours), args.jobs, "hours")
    heard = [one for part in parts for one in part]
    if sum(one.seconds for one in heard) < LEAST_S:
        raise GesturedError(f"{args.recordings[0]}: expected at least {LEAST_S:g} s of frames")
    models = models[:1] if args.arming else models
    found = report.figures(heard, models, args.strictness, published=bool(armed))
    shown = report.tables(found, "recorded" if args.recordings else "simulated")
    if args.arming:
        shown = [replace(shown[0], title=f"{shown[0].title}, {armed}"), shown[2]]
    # First, since it is the work of hours, and a disk may be full.
    printed(json.dumps(found) if args.json else "\n".join(map(str, shown)))
    if args.svg:
        from gestured.lab.everyday.picture import draw

        write(args.svg, draw(found))
    if args.document:
        name, others = shipped_name(args.model), [shipped()[model.name] for model in models[1:]]
        first = shipped()[name] if name else Path(args.model)  # a user's own file may have a shipped model's name
        made = made_of(args.words, [first, *others, *([args.svg] if args.svg else [])])
        renew(args.document, block, [made, "", *map(str, shown)])
    return 0


def _check(args: argparse.Namespace) -> None:
    """Raise GesturedError for options that do not go together, before anything is played."""
    each_once(args.recordings)
    if args.document and args.recordings:
        raise GesturedError("--document: expected no --recordings, the page's tables are of simulated hours")
    if not 0 < args.seconds <= LONGEST_S:
        raise GesturedError(f"--seconds: expected more than 0, at most {LONGEST_S:g}, found {args.seconds:g}")
    if args.arming and (args.recordings or args.svg):
        raise GesturedError("--arming: expected no --recordings and no --svg, its hours are simulated, without a curve")
    if args.svg and find_spec("matplotlib") is None:
        raise GesturedError("--svg: matplotlib is missing: pip install 'gestured[lab]', or make lab")


def _lived(model: str, strictness: Strictness, arming: Arming | None, seed: int) -> list[Heard]:
    models = at(model, strictness)
    life = lived(seed, wake=arming.by if arming else "")
    return [hear(life, models[:1] if arming else models, strictness, arming)]


def _recorded(paths: Sequence[Path], model: str, strictness: Strictness, n: int) -> list[Heard]:
    alone = [path.stem for path in paths].count(paths[n].stem) == 1
    lives = recorded(paths[n], "" if alone else str(paths[n]))
    return [hear(life, at(model, strictness), strictness) for life in lives]
