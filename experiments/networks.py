"""Which network: each alone and with its second opinion, on the same data, with rejection, error against run time.

python -m experiments.networks --cache .cache/lab
"""

import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
from torch import Tensor, nn

import gestured
from experiments.trained import options, trained
from gestured.lab.decide import decided, fit_decision, threshold
from gestured.lab.evaluate import Evaluation, outcome
from gestured.lab.export import Facts, export_net
from gestured.lab.fit import logits, targets
from gestured.lab.made_of import made_of
from gestured.lab.nets import Decision, Judged, Opinion
from gestured.lab.samples import WINDOW
from gestured.lab.train import Trained, TrainingData, TrainingPlan, calibration_set, learn
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.simulator import GESTURES

SECOND = "trajectory"
CANDIDATES = ("cnn_gru",)  # networks that are trained for this comparison alone
PAUSE_S = 1 / 15  # between two runs: caches are cold, as in a daemon that waits for frames
RUNS = 40
FRAMES = 15  # of the window that is run


class Alone(nn.Module):
    """A network without a second opinion, and its decision."""

    def __init__(self, net: Opinion, decision: Decision) -> None:
        super().__init__()
        self.net = net
        self.decision = decision

    def forward(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """(B, T, R, C) -> scores (B, G), unknown (B,)."""
        found = self.net(frames)
        scores, unknown = self.decision(found, found)
        return scores, unknown


def cold_ms(model: Model) -> float:
    """Milliseconds of one run after a pause, the median."""
    window = np.random.default_rng(1).random((1, FRAMES, WINDOW.rows, WINDOW.columns), np.float32)
    took = []
    for _ in range(RUNS):
        time.sleep(PAUSE_S)
        start = time.perf_counter()
        model.run(window)
        took.append(time.perf_counter() - start)
    return 1e3 * median(took)


def compare(plan: TrainingPlan, data: TrainingData, found: Trained, cache: Path) -> None:
    """Print a row for each network and test set, with wrong and lost together and the time of a cold run.

    Candidates that no shipped model is made of are trained on the same data, in the same way.
    """
    calibrated = calibration_set(found, data, plan)
    candidates = learn(plan, data, cache, CANDIDATES)
    nets = nn.ModuleDict({**found.nets, **candidates.nets})
    said = calibrated.logits | calibration_set(candidates, data, plan).logits
    tests = {test: (logits(nets, samples), targets(samples)) for test, samples in data.tests.items()}
    print(f"{Evaluation.HEAD}{'error':>8}{'cold ms':>9}", flush=True)
    for first, second in dict.fromkeys((name, other) for name in nets for other in (name, SECOND)):
        title = f"{first} alone" if first == second else f"{first} and {second}"
        decision = fit_decision(said[first], said[second], calibrated.labels, len(GESTURES))
        one, two = nets[first], nets[second]
        assert isinstance(one, Opinion)
        assert isinstance(two, Opinion)
        module = Alone(one, decision) if first == second else Judged(one, two, decision)
        least = threshold(decided(decision, said[first], said[second]), calibrated.labels, calibrated.sets)
        facts = Facts("candidate", gestured.__version__, GESTURES, WINDOW, {"threshold": least}, "0" * 64, {})
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "candidate.onnx"
            export_net(module, path, facts)
            took = cold_ms(open_model(path))
        for test, (answers, labels) in tests.items():
            result = outcome(decided(decision, answers[first], answers[second]), labels, least, data.performed[test])
            print(f"{result.row(f'{title}, {test}')}{result.wrong + result.lost:>8.3f}{took:>9.2f}", flush=True)


def main() -> None:
    """The command line."""
    args = options(__doc__).parse_args()
    print(made_of("python -m experiments.networks", [args.models / f"{name}.onnx" for name in ("cnn_lstm", "lstm")]))
    compare(*trained(args), args.cache)


if __name__ == "__main__":
    main()
