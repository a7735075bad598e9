"""What a model answers in everyday contact by the other generator, judged as `gestured-lab everyday` judges its own.

    python -m experiments.everyday --hours 10 --foreign nominal
    python -m experiments.everyday my.onnx --hours 10 --foreign hard --strictness strict

Each half hour is of another person of experiments/foreign/life.py, from which no model learns and no threshold is set.
"""

import argparse
import json
from functools import partial

import experiments.foreign.life as foreign
from experiments.foreign import LEVELS
from gestured.core.frames import Frame
from gestured.core.points import STRICTNESS, USUAL, Strictness
from gestured.core.scene import Setup
from gestured.lab.dataset import in_processes
from gestured.lab.everyday import FIRST
from gestured.lab.everyday.command import at
from gestured.lab.everyday.hours import Heard, hear
from gestured.lab.everyday.report import figures, tables
from gestured.lab.everyday.stretches import Stretch


def lived(level: str, seed: int) -> Stretch:
    """Half an hour of the other generator."""
    life = foreign.live(seed, level)
    frames = map(Frame, life.times.tolist(), life.frames)
    setup = Setup(grid=life.frames.shape[1:])
    return Stretch(life.place, str(seed), frames, setup, life.meant, life.taps, len(life.contacts))


def heard(level: str, model: str, strictness: Strictness, seed: int) -> Heard:
    """A model's answers in half an hour of the other generator."""
    return hear(lived(level, seed), at(model, strictness), strictness)


def main() -> None:
    """Print false gestures an hour, and what became of gestures that were meant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?", default="cnn_lstm", help="a shipped model, or a file (default: cnn_lstm)")
    parser.add_argument("--foreign", choices=LEVELS, default=LEVELS[0], help=f"sensors (default: {LEVELS[0]})")
    parser.add_argument("--hours", type=int, default=20, help="of two people each (default: 20)")
    parser.add_argument("--strictness", choices=STRICTNESS, default=USUAL, help=f"operating point (default: {USUAL})")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    args = parser.parse_args()
    work = partial(heard, args.foreign, args.model, args.strictness)
    models = at(args.model, args.strictness)
    seeds = range(FIRST, FIRST + 2 * args.hours)
    found = figures(list(in_processes(work, seeds, args.jobs, "half hours")), models, args.strictness)
    told = tables(found, f"of the other generator, {args.foreign}")
    print(json.dumps(found) if args.json else "\n".join(map(str, told)))


if __name__ == "__main__":
    main()
