"""Training: the three networks together on simulated people, then a little on real fingers.

Stage one learns once from everything simulated. Stage two continues with real recordings among the simulated ones; it
is short, so that each fold over real subjects can have its own. Every batch is varied after the split (`augment`), and
some of its windows are cut short (`prefixes`). Padding has no meaning: the networks are given the length of each
window.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.augment import symmetry_table, turned, varied
from gestured.lab.checkpoints import restore, store
from gestured.lab.nets import CnnLstm, Lstm, Opinion
from gestured.lab.prefixes import askable, drawn, floors, shortened
from gestured.lab.progress import progress
from gestured.lab.samples import EVERYDAY, WINDOW, Samples
from gestured.lab.trajectory import TrajectoryNet, trajectory_features
from gestured.lab.written import load, save
from gestured.simulator import GESTURES, NON_GESTURES, NONE

REAL_KINDS = {"tap_hold": "long_press", "drag_diagonal": "diagonal_swipe"}  # the classes of real non-gestures
# Non-gestures are classes of their own, which improves rejection.
CLASSES: list[str] = [*GESTURES, *NON_GESTURES, EVERYDAY]
LONGEST = 80  # frames that a network is shown: five seconds and their context


@dataclass(frozen=True, slots=True)
class FitConfig:
    """The numbers that shape a training run."""

    epochs: int = 20
    batch: int = 64  # with 128, half as many steps learned far less
    decay: float = 1e-2
    smoothing: float = 0.03  # of labels: keeps the scores calibrated
    clip: float = 1.0
    unfinished: float = 0.4  # share of the windows that are cut short
    real_epochs: int = 3
    real_rate: float = 0.15  # share of the learning rates in `KINDS`
    real_share: float = 0.3  # of stage two's samples that are real
    real_samples: int = 12000  # simulated samples an epoch of stage two
    seed: int = 1


KINDS: dict[str, tuple[type[Opinion], float]] = {  # each with its learning rate, which falls to 0 with a cosine
    "cnn_lstm": (CnnLstm, 4e-3),
    "lstm": (Lstm, 8e-3),
    "trajectory": (TrajectoryNet, 3e-3),
}
NETS = tuple(KINDS)
RECURRENT = tuple(name for name in KINDS if name != "trajectory")  # exported, with that net as their second opinion


def build(names: Iterable[str] = NETS) -> nn.ModuleDict:
    """Untrained networks of these `KINDS`."""
    return nn.ModuleDict({name: KINDS[name][0](WINDOW.rows, WINDOW.columns, len(CLASSES)) for name in names})


def targets(samples: Samples) -> NDArray[np.int64]:
    """(G,) class of each sample; -1 if its kind is none of `CLASSES`."""
    place = {name: i for i, name in enumerate(CLASSES)}
    names = np.where(samples.labels == NONE, samples.kinds, samples.labels)
    return np.array([place.get(REAL_KINDS.get(str(n), str(n)), -1) for n in names], dtype=np.int64)


def padded(samples: Samples, index: NDArray[np.int64], longest: int) -> Tensor:
    """(B, T, R, C) windows with zeros after each one's end."""
    time = min(int(samples.lengths()[index].max()), longest)
    out = np.zeros((len(index), time, WINDOW.rows, WINDOW.columns), np.float32)
    for row, i in enumerate(index):
        window = samples.frames[samples.offsets[i] : samples.offsets[i + 1]][:time]
        out[row, : len(window)] = window
    return torch.from_numpy(out)


def batch_of(samples: Samples, index: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
    """(B, T, R, C) windows as `padded` gives them, at most `LONGEST` frames, and (B,) frames of each."""
    return padded(samples, index, LONGEST), torch.from_numpy(np.minimum(samples.lengths()[index], LONGEST))


class Shown:
    """Samples as networks learn from them: a share of the windows is cut short, all are turned and varied."""

    def __init__(self, samples: Samples, unfinished: float) -> None:
        self._samples, self._unfinished = samples, unfinished
        self._asked, self._least = askable(samples), floors(samples)

    def batch(
        self, index: NDArray[np.int64], rng: np.random.Generator, generator: torch.Generator
    ) -> tuple[Tensor, Tensor, int]:
        """(B, T, R, C) windows, (B,) frames of each, and the row of `symmetry_table` for their classes."""
        symmetry = int(rng.integers(8))
        x, lengths = batch_of(self._samples, index)
        cut = torch.from_numpy(np.minimum(drawn(index, self._samples, self._asked, self._unfinished, rng), LONGEST))
        lengths = torch.where(cut > 0, cut, lengths)
        short = shortened(x, lengths, torch.from_numpy(self._least[index]))
        x = torch.where((cut > 0)[:, None, None, None], short, x)
        return varied(turned(x, symmetry), generator), lengths, symmetry


def one_epoch(
    nets: nn.ModuleDict,
    optimiser: torch.optim.Optimizer,
    schedule: torch.optim.lr_scheduler.LRScheduler,
    sets: Sequence[tuple[Samples, NDArray[np.int64], NDArray[np.int64]]],
    config: FitConfig,
    epoch: int,
    title: str,
) -> float:
    """Go once over `sets` of (samples, labels, chosen); returns the mean loss."""
    rng = np.random.default_rng([config.seed, epoch])
    generator = torch.Generator().manual_seed(config.seed * 1000 + epoch)
    torch.manual_seed(config.seed * 1000 + epoch)  # for dropout, so that a resumed run is the same
    table = symmetry_table(CLASSES)
    criterion = nn.CrossEntropyLoss(label_smoothing=config.smoothing)
    nets.train()
    plan = [(k, index) for k, (s, _, chosen) in enumerate(sets) for index in similar(s, chosen, config.batch, rng)]
    shown = [Shown(samples, config.unfinished) for samples, _, _ in sets]
    total = 0.0
    for place in progress(rng.permutation(len(plan)), len(plan), title):
        k, index = plan[place]
        x, lengths, symmetry = shown[k].batch(index, rng, generator)
        y = table[symmetry][torch.from_numpy(sets[k][1][index])]
        loss = torch.stack([criterion(net(x, lengths), y) for net in nets.values()]).sum()
        step(loss, nets, optimiser, schedule, config.clip)
        total += float(loss.detach())
    return total / len(plan)


def step(
    loss: Tensor,
    nets: nn.Module,
    optimiser: torch.optim.Optimizer,
    schedule: torch.optim.lr_scheduler.LRScheduler,
    clip: float,
) -> None:
    """Change the weights once, by gradients of at most the norm `clip`."""
    optimiser.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    nn.utils.clip_grad_norm_(nets.parameters(), clip)
    optimiser.step()
    schedule.step()


def similar(
    samples: Samples, chosen: NDArray[np.int64], batch: int, rng: np.random.Generator
) -> Iterator[NDArray[np.int64]]:
    """The chosen samples in batches of similar length, so that little is padded, but in random order."""
    lengths, order = samples.lengths(), rng.permutation(chosen)
    for start in range(0, len(order), 20 * batch):
        pool = order[start : start + 20 * batch]
        pool = pool[np.argsort(lengths[pool] + rng.random(len(pool)) * 3)]
        for i in range(0, len(pool), batch):
            yield pool[i : i + batch]


def pretrain(samples: Samples, config: FitConfig, checkpoint: Path, names: Sequence[str] = NETS) -> nn.ModuleDict:
    """Stage one, on simulated samples; resumes an interrupted run."""
    torch.manual_seed(config.seed)
    nets = build(names)
    labels = targets(samples)
    chosen = np.flatnonzero(labels >= 0)
    for net in nets.values():
        if isinstance(net, TrajectoryNet):
            _fit_scale(net, samples, chosen, config)
    steps = config.epochs * len(list(similar(samples, chosen, config.batch, np.random.default_rng(0))))
    optimiser, schedule = _optimiser(nets, config, 1.0, steps)
    done = restore(checkpoint, nets, optimiser, schedule)
    for epoch in range(done, config.epochs):
        title = f"epoch {epoch + 1}/{config.epochs}"
        one_epoch(nets, optimiser, schedule, [(samples, labels, chosen)], config, epoch, title)
        store(checkpoint, nets, optimiser, epoch + 1)
    return nets


def _fit_scale(net: TrajectoryNet, samples: Samples, chosen: NDArray[np.int64], config: FitConfig) -> None:
    """Standardise the net's features by some of the chosen samples."""
    some = np.random.default_rng(config.seed).choice(chosen, min(4000, len(chosen)), replace=False)
    with torch.no_grad():
        found = [trajectory_features(*batch_of(samples, some[i : i + 256])) for i in range(0, len(some), 256)]
        net.perceptron.fit_scale(torch.cat(found))


def finetune(start: nn.ModuleDict, simulated: Samples, real: Samples, config: FitConfig, title: str) -> nn.ModuleDict:
    """Stage two: continue from `start` with real samples among the simulated ones."""
    torch.manual_seed(config.seed)
    nets = build(start)
    nets.load_state_dict(start.state_dict())
    rng = np.random.default_rng([config.seed, 77])
    labels, real_labels = targets(simulated), targets(real)
    usable, real_usable = np.flatnonzero(labels >= 0), np.flatnonzero(real_labels >= 0)
    count = min(config.real_samples, len(usable))
    real_count = int(count * config.real_share / (1 - config.real_share))
    steps = config.real_epochs * (-(-count // config.batch) + -(-real_count // config.batch) + 2)
    optimiser, schedule = _optimiser(nets, config, config.real_rate, steps)
    for epoch in range(config.real_epochs):
        sets = [
            (simulated, labels, rng.choice(usable, count, replace=False)),
            (real, real_labels, balanced(real_labels, real_usable, real_count, rng)),
        ]
        told = f"{title}, real {epoch + 1}/{config.real_epochs}"
        one_epoch(nets, optimiser, schedule, sets, config, 1000 + epoch, told)
    return nets


def balanced(
    labels: NDArray[np.int64], usable: NDArray[np.int64], count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """`count` indices, drawn so that a class comes in proportion to the square root of its number."""
    weight = 1 / np.sqrt(np.bincount(labels[usable], minlength=len(CLASSES)))[labels[usable]]
    return rng.choice(usable, count, replace=True, p=weight / weight.sum())


def _optimiser(
    nets: nn.ModuleDict, config: FitConfig, share: float, steps: int
) -> tuple[torch.optim.Optimizer, torch.optim.lr_scheduler.LRScheduler]:
    rates = [share * KINDS[name][1] for name in nets]
    return optimiser_of(list(nets.values()), rates, config.decay, max(steps, 11))


def optimiser_of(
    nets: Sequence[nn.Module], rates: Sequence[float], decay: float, steps: int
) -> tuple[torch.optim.Optimizer, torch.optim.lr_scheduler.LRScheduler]:
    """AdamW with a rate for each network, which rises in a tenth of the steps and falls to 0."""
    groups = [{"params": list(net.parameters()), "lr": rate} for net, rate in zip(nets, rates, strict=True)]
    optimiser = torch.optim.AdamW(groups, weight_decay=decay)
    return optimiser, torch.optim.lr_scheduler.OneCycleLR(
        optimiser, list(rates), total_steps=steps, pct_start=0.1, div_factor=10, cycle_momentum=False
    )


def asked(samples: Samples, ask: Callable[[Tensor, Tensor], Sequence[Tensor]]) -> list[Tensor]:
    """The answers of `ask` to all samples, in their order.

    `ask` takes batches of windows of similar length, and the frames of each, as `batch_of` gives them.
    """
    order = np.argsort(samples.lengths(), kind="stable")
    with torch.no_grad():
        found = [ask(*batch_of(samples, order[i : i + 256])) for i in range(0, len(order), 256)]
    back = torch.from_numpy(np.argsort(order, kind="stable"))
    return [torch.cat(parts)[back] for parts in zip(*found, strict=True)]


def logits(nets: nn.ModuleDict, samples: Samples) -> dict[str, Tensor]:
    """(G, K) logits of each network for all samples, in their order."""
    nets.eval()
    found = asked(samples, lambda x, lengths: [net(x, lengths) for net in nets.values()])
    return dict(zip(nets, found, strict=True))


def kept_nets(path: Path, make: Callable[[], nn.ModuleDict]) -> nn.ModuleDict:
    """The networks that `make` gives, from their file if they were made before."""
    stored = load(path)
    if stored is None:
        stored = {name: value.numpy() for name, value in make().state_dict().items()}
        save(path, stored)
    nets = build(dict.fromkeys(name.split(".")[0] for name in stored))
    nets.load_state_dict({name: torch.from_numpy(value) for name, value in stored.items()})
    return nets
