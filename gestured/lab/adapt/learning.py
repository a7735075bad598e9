"""A few hundred steps from a model's own weights, with somebody's recordings among simulated takes.

What was learned before is kept in two ways: most of every batch is simulated, and of the way that the weights went
only a share is taken, which people decide who were held out (`adaptation`): a straight line between both ends keeps
what either knows better than any single step count does (Wortsman et al. 2022, "Robust fine-tuning").
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.augment import symmetry_table, turned, varied
from gestured.lab.fit import CLASSES, FitConfig, lengths_of, logits, padded, targets
from gestured.lab.nets import Judged, Opinion
from gestured.lab.prefixes import askable, drawn, floors, shortened
from gestured.lab.progress import progress
from gestured.lab.samples import Samples, join
from gestured.simulator import GESTURES

OTHER = len(CLASSES)  # a non-gesture of a kind that has no class


@dataclass(frozen=True, slots=True)
class Course:
    """Every number that shapes the steps, with its reason."""

    steps: int = 200  # some 15 seconds on one core
    batch: int = 64  # as in training
    rates: tuple[float, float] = (6e-4, 4.5e-4)  # of the network and of its second opinion; they fall to 0
    own_share: float = 0.4  # of a batch, at most
    repeats: float = 40.0  # times that each own sample is shown, at most: few samples are few steps' worth
    decay: float = 1e-2
    smoothing: float = 0.03  # of labels, as in training: keeps the scores calibrated
    clip: float = 1.0
    longest: int = 80  # frames
    unfinished: float = 0.4  # share of the windows that are cut short, as in training
    seed: int = 1


def classes_of(samples: Samples) -> NDArray[np.int64]:
    """(G,) class of each sample, `OTHER` for a non-gesture of a kind that has none."""
    found = targets(samples)
    return np.where(found < 0, OTHER, found)


def learned(start: Judged, simulated: Samples, own: Samples, course: Course, title: str) -> Judged:
    """Go on from `start`; the decision stays as it was."""
    judged = copy.deepcopy(start)
    nets: list[Opinion] = [judged.net, judged.trajectory]
    groups = [{"params": list(net.parameters()), "lr": rate} for net, rate in zip(nets, course.rates, strict=True)]
    optimiser = torch.optim.AdamW(groups, weight_decay=course.decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, list(course.rates), total_steps=course.steps + 1, pct_start=0.1, div_factor=10, cycle_momentum=False
    )
    rng = np.random.default_rng([course.seed, 77])
    generator = torch.Generator().manual_seed(course.seed)
    torch.manual_seed(course.seed)  # dropout, so that the same recordings give the same model
    table = torch.cat([symmetry_table(CLASSES), torch.full((8, 1), OTHER)], 1)
    both = join([simulated, own])
    classes, asked, least = classes_of(both), askable(both), floors(both)
    judged.train()
    for index in progress(_batches(both, classes, len(simulated), course, rng), course.steps, title):
        symmetry = int(rng.integers(8))
        x, lengths = padded(both, index, course.longest), lengths_of(both, index, course.longest)
        cut = torch.from_numpy(np.minimum(drawn(index, both, asked, course.unfinished, rng), course.longest))
        lengths = torch.where(cut > 0, cut, lengths)
        x = torch.where((cut > 0)[:, None, None, None], shortened(x, lengths, torch.from_numpy(least[index])), x)
        x = varied(turned(x, symmetry), generator)
        y = table[symmetry][torch.from_numpy(classes[index])]
        loss = torch.stack([_loss(net(x, lengths), y, course.smoothing) for net in nets]).sum()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(judged.parameters(), course.clip)
        optimiser.step()
        schedule.step()
    return judged.eval()


def between(start: Judged, end: Judged, share: float) -> Judged:
    """The networks a share of the way from `start` to `end`."""
    found = copy.deepcopy(start)
    ends = end.state_dict()
    found.load_state_dict({name: value + share * (ends[name] - value) for name, value in start.state_dict().items()})
    return found.eval()


def opinions(judged: Judged, samples: Samples, longest: int) -> tuple[Tensor, Tensor]:
    """(G, K) logits of the network and of its second opinion for all samples, in their order."""
    nets = nn.ModuleDict({"net": judged.net, "trajectory": judged.trajectory})
    found = logits(nets, samples, FitConfig(longest=longest))
    return found["net"], found["trajectory"]


def _batches(
    both: Samples, classes: NDArray[np.int64], simulated: int, course: Course, rng: np.random.Generator
) -> Iterator[NDArray[np.int64]]:
    """`steps` batches of samples of similar length: little is padded. Rare classes of the own ones count more."""
    own = len(both) - simulated
    share = min(course.own_share, course.repeats * own / (course.steps * course.batch))
    weight = np.full(len(both), (1 - share) / simulated)
    rarity = 1 / np.sqrt(np.bincount(classes[simulated:], minlength=OTHER + 1))[classes[simulated:]]
    weight[simulated:] = share * rarity / rarity.sum()
    weight /= weight.sum()
    lengths = both.lengths()
    for start in range(0, course.steps, 20):
        count = min(20, course.steps - start)
        pool = rng.choice(len(both), count * course.batch, p=weight)
        pool = pool[np.argsort(lengths[pool] + rng.random(len(pool)) * 3)]
        for k in rng.permutation(count):
            yield pool[k * course.batch : (k + 1) * course.batch]


def _loss(logits: Tensor, y: Tensor, smoothing: float) -> Tensor:
    """Cross entropy; of a non-gesture without a class, that it is any of the non-gestures."""
    log = logits.log_softmax(1)
    named = y < OTHER
    picked = log.gather(1, y.clamp(max=OTHER - 1)[:, None])[:, 0]
    likely = torch.where(named, picked, log[:, len(GESTURES) :].logsumexp(1))
    return -((1 - smoothing) * likely + smoothing * torch.where(named, log.mean(1), likely)).mean()
