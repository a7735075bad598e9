"""Right, wrong and accepted of the models by the threshold from which answers are published, on the test sets.

python -m experiments.thresholds --cache .cache/lab
"""

from pathlib import Path

from experiments.trained import loaded, options
from gestured.lab.decide import THRESHOLDS, curve
from gestured.lab.evaluate import model_answers
from gestured.lab.fit import targets
from gestured.lab.train import TrainingData
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER


def print_curve(name: str, path: Path, data: TrainingData) -> None:
    """Right, wrong and accepted of a model on the test sets by the threshold from which answers are published."""
    model = open_model(path)
    points = {test: curve(model_answers(model, s), targets(s)) for test, s in data.tests.items()}
    print(f"{name}: published from {model.threshold:.2f}", flush=True)
    print(f"{'threshold':>9}" + "".join(f"  {test + ': right':>16}{'wrong':>8}{'accepted':>10}" for test in points))
    for k, least in list(enumerate(THRESHOLDS))[::5]:
        cells = "".join(f"  {found[k][0]:>16.3f}{found[k][1]:>8.3f}{found[k][2]:>10.3f}" for found in points.values())
        print(f"{least:>9.2f}{cells}", flush=True)


def main() -> None:
    """The command line."""
    args = options(__doc__).parse_args()
    _, data = loaded(args)
    for name in LADDER:
        print_curve(name, args.models / f"{name}.onnx", data)


if __name__ == "__main__":
    main()
