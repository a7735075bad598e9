"""Whole sessions of real fingers as streams, each judged by networks that never saw its subject.

    python -m experiments.sessions --real FOLDER --document docs/figures.md

Frames pass through the daemon's own path, from the first one on. Answers that are published at `normal` count. Touches
that the recordings do not name (`other`) are neither right nor false.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import gestured
from experiments.pages import add_document, tell
from experiments.trained import options, trained
from gestured.core.points import USUAL
from gestured.lab.everyday.hours import Heard, Hours, hear, judged
from gestured.lab.everyday.stretches import recorded
from gestured.lab.export import Facts, export_net
from gestured.lab.fit import CLASSES
from gestured.lab.quantiles import quantiles
from gestured.lab.samples import WINDOW
from gestured.lab.table import Table, Value
from gestured.lab.train import REAL_FILES, Trained, TrainingData, TrainingPlan, calibration_set, folds, measured_points
from gestured.lab.train import judged as decided
from gestured.model.context import NAMES
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.simulator import GESTURES

NET = "cnn_lstm"


def without(part: Trained, data: TrainingData, plan: TrainingPlan, path: Path) -> Model:
    """The networks of a fold, calibrated on simulated people alone, as a file that the daemon would open."""
    module, calibration, answered = decided(part, NET, calibration_set(part, data), data)
    seen = quantiles(data.teach) | answered
    export_net(
        module,
        path,
        Facts(
            kind=NET, version=gestured.__version__, gestures=list(GESTURES), window=WINDOW, calibration=calibration,
            training_data=data.teach.digest(), quantiles=seen, classes=CLASSES, context=NAMES,
            operating_points=measured_points(part, module, NET, data, plan),
        ),
    )  # fmt: skip
    return open_model(path)


def row(name: str, heard: list[Heard]) -> tuple[Value, ...]:
    """A row of the table, for one subject or for all."""
    of: Hours = judged(heard, NET, 0.0)
    found = of.figures()
    shares = (found["right"], found["wrong"], found["missed"])
    deaf = sum(found["deaf_minutes_per_hour"].values())
    low, high = f"{found['low']:.1f}", f"{found['high']:.1f}"
    cells = ("-" if share is None else f"{share:.3f}" for share in shares)
    return name, f"{60 * of.hours:.1f}", found["meant"], *cells, of.said["false"], f"{low} to {high}", f"{deaf:.1f}"


def main() -> None:
    """Judge each session, print and write the table."""
    parser = options(__doc__)
    add_document(parser, "sessions")
    args = parser.parse_args()
    if args.real is None:
        parser.error("--real: missing; the folder of real recordings, as docs/training.md has it")
    plan, data, whole = trained(args)
    assert data.real is not None
    model_of: dict[int, Model] = {}
    with TemporaryDirectory() as folder:
        for k, held in enumerate(folds(data.real)):
            path = Path(folder) / str(k) / f"{NET}.onnx"
            path.parent.mkdir()
            model = without(Trained(whole.folds[k], None), data, plan, path)
            model_of |= dict.fromkeys(np.unique(data.real.people[held]).tolist(), model)
        heard = [
            hear(life, [model_of[int(life.person)]], USUAL, published=True)
            for life in recorded(args.real / REAL_FILES[1])
        ]
    subjects = sorted({int(one.person) for one in heard})
    rows = [row(f"subject {n}", [one for one in heard if int(one.person) == n]) for n in subjects]
    head = ("", "minutes", "meant", "right", "wrong", "missed", "false", "95 % an hour", "deaf min an hour")
    table = Table("Real fingers, whole sessions as streams", head, [*rows, row("all", heard)])
    tell(table, [args.models / f"{NET}.onnx"], "sessions", args.document)


if __name__ == "__main__":
    main()
