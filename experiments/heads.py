"""Heads that are trained anew on the states of a trained network, without some classes of non-gestures."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.augment import varied
from gestured.lab.decide import Answers, decided, fit_decision, threshold
from gestured.lab.fit import CLASSES, batch_of, targets
from gestured.lab.nets import Perceptron, Recurrent
from gestured.lab.samples import Samples
from gestured.lab.train import Trained, TrainingData, TrainingPlan
from gestured.lab.trajectory import trajectory_features
from gestured.simulator import GESTURES


class Cues(NamedTuple):
    """The inputs of the heads for some samples."""

    embedded: Tensor  # (N, 32)
    features: Tensor  # (N, F) of the trajectory
    labels: NDArray[np.int64]  # (N,) class
    of: NDArray[np.int64]  # (N,) sample

    @classmethod
    def made(cls, net: Recurrent, samples: Samples, plan: TrainingPlan, *, vary: bool = False) -> "Cues":
        """The cues of all samples that have a class; with `vary` those of a random part, as they are and varied."""
        labels = targets(samples)
        index = np.flatnonzero(labels >= 0)
        if vary:
            index = np.random.default_rng(plan.fit.seed).permutation(index)[:24_000]
        index = index[np.argsort(samples.lengths()[index], kind="stable")]
        generator = torch.Generator().manual_seed(plan.fit.seed)
        embedded, features, places = [], [], []
        net.eval()
        with torch.no_grad():
            for start in range(0, len(index), 256):
                chosen = index[start : start + 256]
                x, lengths = batch_of(samples, chosen)
                for y in (x, varied(x, generator)) if vary else (x,):
                    embedded.append(net.embed(y, lengths))
                    features.append(trajectory_features(y, lengths))
                    places.append(chosen)
        of = np.concatenate(places)
        return cls(torch.cat(embedded), torch.cat(features), labels[of], of)


class Heads(NamedTuple):
    """The inputs of a trained network's heads, which can be trained anew without some classes."""

    teach: Cues
    calibrate: Cues
    tests: dict[str, tuple[Cues, Samples]]

    @classmethod
    def of(cls, trained: Trained, data: TrainingData, plan: TrainingPlan, name: str) -> "Heads":
        """The heads' inputs for one of the recurrent networks and its second opinion."""
        net = trained.nets[name]
        assert isinstance(net, Recurrent)
        tests = {test: (Cues.made(net, samples, plan), samples) for test, samples in data.tests.items()}
        return cls(Cues.made(net, data.teach, plan, vary=True), Cues.made(net, data.calibrate, plan), tests)

    def without(self, classes: Sequence[int], plan: TrainingPlan) -> Iterator[tuple[str, Answers, Samples, float]]:
        """Answers on each test set of new heads and a new calibration, which have not seen these classes.

        Yields the test set's name, the answers, the samples that they belong to, and the confidence from which answers
        are published.
        """
        first, second = (_refit(self.teach, which, classes, plan) for which in (0, 1))
        seen = ~np.isin(self.calibrate.labels, classes)
        labels = self.calibrate.labels[seen]
        one, two = first(self.calibrate.embedded[seen]).detach(), second(self.calibrate.features[seen]).detach()
        decision = fit_decision(one, two, labels, len(GESTURES))
        least = threshold(decided(decision, one, two), labels)
        for test, (cues, samples) in self.tests.items():
            answers = decided(decision, first(cues.embedded).detach(), second(cues.features).detach())
            yield test, answers, samples.take(cues.of), least


def _refit(cues: Cues, which: int, hidden: Sequence[int], plan: TrainingPlan) -> nn.Module:
    """A fresh head (0: on the embedding, linear; 1: on the trajectory features) that never saw the hidden classes."""
    torch.manual_seed(plan.fit.seed)
    seen = torch.from_numpy(~np.isin(cues.labels, hidden))
    x, y = (cues.embedded, cues.features)[which][seen], torch.from_numpy(cues.labels)[seen]
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
