"""A few hundred training steps from a model's weights, with own recordings among simulated takes.

Two things keep what was learned before: most of every batch is simulated, and the weights go only a share of the way,
which is chosen on people who were held out (`adaptation`). Weights on the straight line between old and new ones keep
what either knows better than any number of steps does (Wortsman et al. 2022, "Robust fine-tuning").
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.augment import symmetry_table
from gestured.lab.dataset import OTHER_TRIALS, simulated
from gestured.lab.fit import CLASSES, FitConfig, Shown, optimiser_of, step, targets
from gestured.lab.nets import Judged, Opinion
from gestured.lab.progress import progress
from gestured.lab.samples import Samples, join
from gestured.lab.verifier import Evidence
from gestured.simulator import GESTURES, NONE

PEOPLE = 6  # of the nominal simulated set, whom no training has met
SEED = 31  # of all that is simulated here
OTHER = len(CLASSES)  # a non-gesture of a kind that has no class


@dataclass(frozen=True, slots=True)
class Course:
    """The numbers that shape the steps, each with its reason."""

    steps: int = 200  # some 15 seconds on one core
    rates: tuple[float, float] = (6e-4, 4.5e-4)  # learning rates of the network and its second opinion; they fall to 0
    own_share: float = 0.4  # share of a batch that own samples may have
    repeats: float = 40.0  # the most times that an own sample is shown: few samples get a small share of the batches
    fit: FitConfig = FitConfig()  # settings of a step that are those of training


@dataclass(frozen=True)
class Simulated:
    """Simulated takes of people whom no training has met."""

    teach: Samples
    check: Samples  # to fit the decision
    early: Samples  # for the thresholds of provisional events, together with `check`
    nominal: Samples  # to judge
    missed: NDArray[np.int64]  # people of the nominal gestures that were never cut out


def simulate(cache: Path, jobs: int) -> Simulated:
    """The simulated takes, cut once and then read from the cache."""
    teach = simulated(cache, "wide", SEED, 4_000, jobs)
    check = simulated(cache, "wide", SEED + 1, 1_500, jobs)
    early = simulated(cache, "wide", SEED + 2, 12_000, jobs)
    performed = 90 * PEOPLE
    others = len(OTHER_TRIALS) // 34 * PEOPLE
    nominal = join([simulated(cache, "cohort", SEED, performed, jobs), simulated(cache, "others", SEED, others, jobs)])
    lost = max(performed - int((nominal.labels != NONE).sum()), 0)
    return Simulated(teach, check, early, nominal, np.full(lost, nominal.people[0]))


def classes_of(samples: Samples) -> NDArray[np.int64]:
    """(G,) class of each sample, `OTHER` for a non-gesture of a kind that has none."""
    found = targets(samples)
    return np.where(found < 0, OTHER, found)


def learned(start: Judged, takes: Samples, own: Samples, course: Course, title: str) -> Judged:
    """Train copies of the networks of `start` further; the decision stays as it was."""
    judged = copy.deepcopy(start)
    nets: list[Opinion] = [judged.net, judged.trajectory]
    config = course.fit
    optimiser, schedule = optimiser_of(nets, course.rates, config.decay, course.steps + 1)
    rng = np.random.default_rng([config.seed, 77])
    generator = torch.Generator().manual_seed(config.seed)
    torch.manual_seed(config.seed)  # for dropout, so that the same recordings give the same model
    table = torch.cat([symmetry_table(CLASSES), torch.full((8, 1), OTHER)], 1)
    both = join([takes, own])
    classes, shown = classes_of(both), Shown(both, config.unfinished)
    judged.train()
    for index in progress(_batches(both, classes, len(takes), course, rng), course.steps, title):
        x, lengths, symmetry = shown.batch(index, rng, generator)
        y = table[symmetry][torch.from_numpy(classes[index])]
        loss = torch.stack([_loss(net(x, lengths), y, config.smoothing) for net in nets]).sum()
        step(loss, judged, optimiser, schedule, config.clip)
    return judged.eval()


def between(start: Judged, end: Judged, share: float) -> Judged:
    """Networks whose weights lie a `share` of the way from `start` to `end`."""
    found = copy.deepcopy(start)
    ends = end.state_dict()
    found.load_state_dict({name: value + share * (ends[name] - value) for name, value in start.state_dict().items()})
    return found.eval()


def opinions(judged: Judged, samples: Samples) -> Evidence:
    """The evidence of the network and its second opinion on all samples, in their order."""
    return Evidence.of(nn.ModuleDict({"net": judged.net, "trajectory": judged.trajectory}), "net", samples)


def _batches(
    both: Samples, classes: NDArray[np.int64], taken: int, course: Course, rng: np.random.Generator
) -> Iterator[NDArray[np.int64]]:
    """`steps` batches of samples of similar length, for little padding; rare classes of own samples weigh more."""
    own, batch = len(both) - taken, course.fit.batch
    share = min(course.own_share, course.repeats * own / (course.steps * batch))
    weight = np.full(len(both), (1 - share) / taken)
    rarity = 1 / np.sqrt(np.bincount(classes[taken:], minlength=OTHER + 1))[classes[taken:]]
    weight[taken:] = share * rarity / rarity.sum()
    weight /= weight.sum()
    lengths = both.lengths()
    for start in range(0, course.steps, 20):
        count = min(20, course.steps - start)
        pool = rng.choice(len(both), count * batch, p=weight)
        pool = pool[np.argsort(lengths[pool] + rng.random(len(pool)) * 3)]
        for k in rng.permutation(count):
            yield pool[k * batch : (k + 1) * batch]


def _loss(logits: Tensor, y: Tensor, smoothing: float) -> Tensor:
    """Cross entropy; for a non-gesture without a class, that of all classes of non-gestures together."""
    log = logits.log_softmax(1)
    named = y < OTHER
    picked = log.gather(1, y.clamp(max=OTHER - 1)[:, None])[:, 0]
    likely = torch.where(named, picked, log[:, len(GESTURES) :].logsumexp(1))
    return -((1 - smoothing) * likely + smoothing * torch.where(named, log.mean(1), likely)).mean()
