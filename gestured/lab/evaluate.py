"""The figures: what the exported files are worth on people they have never seen.

Simulated figures are of the exported .onnx files themselves. Real figures are of networks that were trained without
the subjects they are judged on (three folds); non-gestures held out are judged with heads refitted without them.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.augment import varied
from gestured.lab.decide import THRESHOLDS, curve, fit_decision, threshold
from gestured.lab.fit import CLASSES, lengths_of, padded, targets
from gestured.lab.nets import Perceptron, Recurrent
from gestured.lab.samples import Samples
from gestured.lab.train import REAL_SETS, Calibrated, Trained, TrainingData, TrainingPlan, folds, is_of, judged
from gestured.lab.trajectory import trajectory_features
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.simulator import GESTURES, NONE

GROUPS = 3  # of kinds of non-gestures held out


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What answers are worth on a set: shares of the gestures that were performed, and of the non-gestures."""

    gestures: int
    others: int
    right_before: float  # without rejection; what was not cut out counts as not right
    right: float
    wrong: float
    lost: float  # to unknown, or never cut out
    rejected: float  # of the non-gestures

    HEAD = f"{'set':<40}{'gestures':>9}{'right*':>8}{'right':>8}{'wrong':>8}{'lost':>8}{'others':>8}{'rejected':>9}"

    def row(self, title: str) -> str:
        """One row of a table; right* is before rejection."""
        return (
            f"{title:<40}{self.gestures:>9}{self.right_before:>8.3f}{self.right:>8.3f}{self.wrong:>8.3f}"
            f"{self.lost:>8.3f}{self.others:>8}{self.rejected:>9.3f}"
        )


Answers = tuple[NDArray[np.float32], NDArray[np.float32]]  # scores (N, G), unknown (N,)


def outcome(answers: Answers, labels: NDArray[np.int64], least: float, performed: int | None = None) -> Evaluation:
    """Judge answers against classes (N,), published from a confidence of `least` on.

    `performed`: how many gestures were performed, where some were never cut out.
    """
    scores, unknown = answers
    known = (labels >= 0) & (labels < scores.shape[1])
    total = max(performed or 0, int(known.sum()))
    published = scores.max(axis=1) * (1 - unknown) >= least
    right = scores.argmax(axis=1) == labels

    def share(chosen: NDArray[np.bool_], of: int) -> float:
        return float(chosen.sum() / of) if of else float("nan")

    hits, misses = share(right & published & known, total), share(~right & published & known, total)
    return Evaluation(
        total, int((~known).sum()), share(right & known, total), hits, misses, 1 - hits - misses,
        share(~published & ~known, int((~known).sum())),
    )  # fmt: skip


def model_answers(model: Model, samples: Samples) -> Answers:
    """Scores (N, G) and unknown (N,) of a model for all samples, in their order."""
    if model.metadata.features is not None:
        return model.run(samples.features())
    scores = np.zeros((len(samples), len(model.gestures)), np.float32)
    unknown = np.zeros(len(samples), np.float32)
    for length in np.unique(samples.lengths()):  # a window that is padded would seem to be over
        same = np.flatnonzero(samples.lengths() == length)
        for index in np.array_split(same, -(-len(same) // 200)):
            scores[index], unknown[index] = model.run(padded(samples, index, 100).numpy())
    return scores, unknown


def simulated_figures(models: Mapping[str, Path], data: TrainingData) -> dict[str, dict[str, Any]]:
    """Of each model and test set; with the share of each kind that was answered rightly."""
    found: dict[str, dict[str, Any]] = {}
    for name, path in models.items():
        model = open_model(path)
        found[name] = {}
        for test, samples in data.tests.items():
            given = model_answers(model, samples)
            result = outcome(given, targets(samples), model.threshold, data.performed[test])
            found[name][test] = asdict(result) | {"kinds": by_kind(given, samples, model.threshold)}
            print(result.row(f"{name}, simulated, {test}"), flush=True)
    return found


def print_curve(name: str, path: Path, data: TrainingData) -> None:
    """Right, wrong and accepted of a model on the test sets by the threshold from which answers are published."""
    model = open_model(path)
    points = {test: curve(*model_answers(model, s), targets(s)) for test, s in data.tests.items()}
    print(f"{name}: published from {model.threshold:.2f}", flush=True)
    print(f"{'threshold':>9}" + "".join(f"  {test + ': right':>16}{'wrong':>8}{'accepted':>10}" for test in points))
    for k, least in list(enumerate(THRESHOLDS))[::5]:
        cells = "".join(f"  {found[k][0]:>16.3f}{found[k][1]:>8.3f}{found[k][2]:>10.3f}" for found in points.values())
        print(f"{least:>9.2f}{cells}", flush=True)


def by_kind(given: Answers, samples: Samples, least: float) -> dict[str, float]:
    """Share of each gesture's samples named rightly, and of each non-gesture's rejected."""
    scores, unknown = given
    published = scores.max(axis=1) * (1 - unknown) >= least
    good = np.where(samples.labels == NONE, ~published, published & (scores.argmax(axis=1) == targets(samples)))
    return {str(kind): round(float(good[samples.kinds == kind].mean()), 3) for kind in np.unique(samples.kinds)}


def without(calibrated: Calibrated, real: Samples, held: NDArray[np.bool_]) -> Calibrated:
    """What is calibrated on without some of the real samples; those that have a class stand at its end."""
    left = ~held[targets(real) >= 0]
    keep = np.concatenate([np.ones(len(calibrated.labels) - len(left), bool), left])
    found = {name: x[torch.from_numpy(keep)] for name, x in calibrated.logits.items()}
    return Calibrated(found, calibrated.labels[keep], calibrated.sets[keep])


def real_figures(trained: Trained, calibrated: Calibrated, data: TrainingData) -> dict[str, Any]:
    """Real subjects, each by the networks that have not seen them, calibrated without them."""
    real = data.real
    if real is None or trained.held_out is None:
        print("real recordings: left out, they are not here (--real FOLDER)")
        return {}
    labels = targets(real)
    found: dict[str, Any] = {}
    for name in ("cnn_lstm", "lstm"):
        scores = np.zeros((len(real), len(GESTURES)), np.float32)
        unknown = np.zeros(len(real), np.float32)
        levels = []
        for held in folds(real):
            module, calibration, _ = judged(trained, name, without(calibrated, real, held))
            with torch.no_grad():
                out = module.decision(*(trained.held_out[n][torch.from_numpy(held)] for n in (name, "trajectory")))
            scores[held], unknown[held] = out[0].numpy(), out[1].numpy()
            levels.append(calibration["threshold"])
        least = float(np.mean(levels))
        both = (scores, unknown)
        judged_once = np.arange(len(real)) < data.real_judged
        for title in REAL_SETS:
            chosen = is_of(real.labels, title) & judged_once
            result = outcome((scores[chosen], unknown[chosen]), labels[chosen], least, data.performed.get(title))
            found.setdefault(name, {})[title] = asdict(result)
            print(result.row(f"{name}, real, {title}"), flush=True)
        found[name]["kinds"] = by_kind(both, real, least)
    return found


def held_out_kinds(trained: Trained, data: TrainingData, plan: TrainingPlan, name: str = "cnn_lstm") -> dict[str, Any]:
    """Non-gestures of kinds that the heads and the calibration have not seen: three groups of kinds, in turn."""
    net = trained.nets[name]
    assert isinstance(net, Recurrent)
    teach, calibrate = _cues(net, data.teach, plan, vary=True), _cues(net, data.calibrate, plan)
    tests = {test: _cues(net, samples, plan) for test, samples in data.tests.items()}
    kinds: dict[str, float] = {}
    rejected: list[float] = []
    for group in range(GROUPS):
        hidden = [CLASSES.index(kind) for kind in sorted(CLASSES[len(GESTURES) :])[group::GROUPS]]
        first, second = (_refit(teach, which, hidden, plan) for which in (0, 1))
        seen = ~np.isin(calibrate[2], hidden)
        decision = fit_decision(
            first(calibrate[0][seen]).detach(), second(calibrate[1][seen]).detach(), calibrate[2][seen], len(GESTURES)
        )
        with torch.no_grad():
            scores, unknown = decision(first(calibrate[0][seen]), second(calibrate[1][seen]))
            least = threshold(scores.numpy(), unknown.numpy(), calibrate[2][seen])
            for embedded, features, labels in tests.values():
                chosen = np.isin(labels, hidden)
                scores, unknown = decision(first(embedded[chosen]), second(features[chosen]))
                accepted = (scores.max(1).values * (1 - unknown) >= least).numpy()
                rejected += (~accepted).tolist()
                for k in hidden:
                    of = labels[chosen] == k
                    if of.any():
                        kinds[CLASSES[k]] = round(float((~accepted[of]).mean()), 3)
    share = float(np.mean(rejected))
    print(f"{f'{name}, non-gestures of held-out kinds':<40}{len(rejected):>49}{share:>9.3f}", flush=True)
    return {"rejected": share, "count": len(rejected), "kinds": kinds}


Cues = tuple[Tensor, Tensor, NDArray[np.int64]]  # embedding (N, 32), trajectory features (N, F), class (N,)


def _cues(net: Recurrent, samples: Samples, plan: TrainingPlan, *, vary: bool = False) -> Cues:
    """What the heads see. With `vary` a random part of the samples, as they are and varied."""
    labels = targets(samples)
    index = np.flatnonzero(labels >= 0)
    if vary:
        index = np.random.default_rng(plan.fit.seed).permutation(index)[:24_000]
    index = index[np.argsort(samples.lengths()[index], kind="stable")]
    generator = torch.Generator().manual_seed(plan.fit.seed)
    embedded, features, found = [], [], []
    net.eval()
    with torch.no_grad():
        for start in range(0, len(index), 256):
            chosen = index[start : start + 256]
            x = padded(samples, chosen, plan.fit.longest)
            lengths = lengths_of(samples, chosen, plan.fit.longest)
            for y in (x, varied(x, generator)) if vary else (x,):
                embedded.append(net.embed(y, lengths))
                features.append(trajectory_features(y, lengths))
                found.append(labels[chosen])
    return torch.cat(embedded), torch.cat(features), np.concatenate(found)


def _refit(cues: Cues, which: int, hidden: list[int], plan: TrainingPlan) -> nn.Module:
    """A fresh head (0: on the embedding, linear; 1: on the trajectory features) that never saw the hidden kinds."""
    torch.manual_seed(plan.fit.seed)
    seen = torch.from_numpy(~np.isin(cues[2], hidden))
    x, y = cues[which][seen], torch.from_numpy(cues[2])[seen]
    head: nn.Module
    if which == 0:
        head = nn.Linear(x.shape[1], len(CLASSES))
    else:
        head = Perceptron(x.shape[1], len(CLASSES))
        head.fit_scale(x)
    epochs = 6
    optimiser = torch.optim.AdamW(head.parameters(), lr=4e-3)
    steps = epochs * (-(-len(x) // 256))
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 4e-3, total_steps=steps, pct_start=0.1)
    criterion = nn.CrossEntropyLoss(label_smoothing=plan.fit.smoothing)
    for _ in range(epochs):
        for part in torch.split(torch.randperm(len(x)), 256):
            loss = criterion(head(x[part]), y[part])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    return head.eval()
