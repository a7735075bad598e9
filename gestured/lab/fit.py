"""Training, to be read aloud: the three networks together on simulated people, then a little on real fingers.

Stage one learns everything that is simulated, once. Stage two goes on from there with real recordings among the
simulated ones; it is short, so that folds over real subjects can each have their own. Every batch is varied after
the split (`augment`), and some of its windows are cut short (`prefixes`). Nothing is padded with meaning: the
networks are told how long each window is.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.augment import symmetry_table, turned, varied
from gestured.lab.checkpoints import restore, store
from gestured.lab.nets import CnnGru, CnnLstm, Lstm, Opinion
from gestured.lab.prefixes import askable, drawn, floors, shortened
from gestured.lab.progress import progress
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.trajectory import TrajectoryNet, trajectory_features
from gestured.simulator import GESTURES, NON_GESTURES, NONE

REAL_KINDS = {"tap_hold": "long_press", "drag_diagonal": "diagonal_swipe"}  # what real non-gestures are
CLASSES: list[str] = [*GESTURES, *NON_GESTURES]  # non-gestures are classes of their own: they reject better so


@dataclass(frozen=True, slots=True)
class FitConfig:
    """Every number that shapes a training run, with its reason."""

    epochs: int = 20
    batch: int = 64  # half as many steps with 128 learned far less
    decay: float = 1e-2
    smoothing: float = 0.03  # of labels: keeps the scores calibrated
    clip: float = 1.0
    longest: int = 80  # frames: five seconds and their context
    unfinished: float = 0.4  # share of the windows that are cut short
    real_epochs: int = 3
    real_rate: float = 0.15  # of the rates above
    real_share: float = 0.3  # of stage two's samples that are real
    real_samples: int = 12000  # simulated samples an epoch of stage two
    seed: int = 1


NETS = ("cnn_lstm", "lstm", "trajectory")  # those that the shipped models are made of
KINDS: dict[str, tuple[type[Opinion], float]] = {  # each with its learning rate, which falls to 0 with a cosine
    "cnn_lstm": (CnnLstm, 4e-3),
    "lstm": (Lstm, 8e-3),
    "trajectory": (TrajectoryNet, 3e-3),
    "cnn_gru": (CnnGru, 4e-3),
}


def build(names: Iterable[str] = NETS) -> nn.ModuleDict:
    """Untrained networks of these `KINDS`."""
    return nn.ModuleDict({name: KINDS[name][0](WINDOW.rows, WINDOW.columns, len(CLASSES)) for name in names})


def targets(samples: Samples) -> NDArray[np.int64]:
    """(G,) class of each sample; -1 where its kind is none of `CLASSES`."""
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


def lengths_of(samples: Samples, index: NDArray[np.int64], longest: int) -> Tensor:
    """(B,) frames of each window as `padded` gives it."""
    return torch.from_numpy(np.minimum(samples.lengths()[index], longest))


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
    torch.manual_seed(config.seed * 1000 + epoch)  # dropout, so that a resumed run is the same
    table = symmetry_table(CLASSES)
    criterion = nn.CrossEntropyLoss(label_smoothing=config.smoothing)
    nets.train()
    streams = [list(_plan(s, y, config, rng, chosen)) for s, y, chosen in sets]
    plan = [item for stream in streams for item in stream]
    known = {id(samples): (askable(samples), floors(samples)) for samples, _, _ in sets}
    total = 0.0
    for k in progress(rng.permutation(len(plan)), len(plan), title):
        samples, labels, index = plan[k]
        symmetry = int(rng.integers(8))
        asked, least = known[id(samples)]
        x, lengths = padded(samples, index, config.longest), lengths_of(samples, index, config.longest)
        cut = torch.from_numpy(np.minimum(drawn(index, samples, asked, config.unfinished, rng), config.longest))
        lengths = torch.where(cut > 0, cut, lengths)
        x = torch.where((cut > 0)[:, None, None, None], shortened(x, lengths, torch.from_numpy(least[index])), x)
        x = varied(turned(x, symmetry), generator)
        y = table[symmetry][torch.from_numpy(labels[index])]
        loss = torch.stack([criterion(net(x, lengths), y) for net in nets.values()]).sum()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(nets.parameters(), config.clip)
        optimiser.step()
        schedule.step()
        total += float(loss.detach())
    return total / len(plan)


def _plan(
    samples: Samples, labels: NDArray[np.int64], config: FitConfig, rng: np.random.Generator, chosen: NDArray[np.int64]
) -> Iterator[tuple[Samples, NDArray[np.int64], NDArray[np.int64]]]:
    """Groups of samples of similar length, so that little is padded."""
    lengths, order = samples.lengths(), rng.permutation(chosen)
    for start in range(0, len(order), 20 * config.batch):
        pool = order[start : start + 20 * config.batch]
        pool = pool[np.argsort(lengths[pool] + rng.random(len(pool)) * 3)]
        for i in range(0, len(pool), config.batch):
            yield samples, labels, pool[i : i + config.batch]


def pretrain(samples: Samples, config: FitConfig, checkpoint: Path, names: Sequence[str] = NETS) -> nn.ModuleDict:
    """Stage one, on simulated samples; goes on where an interrupted run stopped."""
    torch.manual_seed(config.seed)
    nets = build(names)
    labels = targets(samples)
    chosen = np.flatnonzero(labels >= 0)
    for net in nets.values():
        if isinstance(net, TrajectoryNet):
            _fit_scale(net, samples, chosen, config)
    steps = config.epochs * len(list(_plan(samples, labels, config, np.random.default_rng(0), chosen)))
    optimiser, schedule = _optimiser(nets, config, 1.0, steps)
    done = restore(checkpoint, nets, optimiser, schedule)
    for epoch in range(done, config.epochs):
        one_epoch(
            nets, optimiser, schedule, [(samples, labels, chosen)], config, epoch, f"epoch {epoch + 1}/{config.epochs}"
        )
        store(checkpoint, nets, optimiser, epoch + 1)
    return nets


def _fit_scale(net: TrajectoryNet, samples: Samples, chosen: NDArray[np.int64], config: FitConfig) -> None:
    """Standardise its features by some of the chosen samples."""
    some = np.random.default_rng(config.seed).choice(chosen, min(4000, len(chosen)), replace=False)
    with torch.no_grad():
        found = [
            trajectory_features(padded(samples, part, config.longest), lengths_of(samples, part, config.longest))
            for part in (some[i : i + 256] for i in range(0, len(some), 256))
        ]
        net.perceptron.fit_scale(torch.cat(found))


def finetune(start: nn.ModuleDict, simulated: Samples, real: Samples, config: FitConfig, title: str) -> nn.ModuleDict:
    """Stage two: go on from `start` with real samples among the simulated ones."""
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
        one_epoch(
            nets, optimiser, schedule, sets, config, 1000 + epoch, f"{title}, real {epoch + 1}/{config.real_epochs}"
        )
    return nets


def balanced(
    labels: NDArray[np.int64], usable: NDArray[np.int64], count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """`count` indices drawn so that rare classes come more often (square root of their number)."""
    weight = 1 / np.sqrt(np.bincount(labels[usable], minlength=len(CLASSES)))[labels[usable]]
    return rng.choice(usable, count, replace=True, p=weight / weight.sum())


def _optimiser(
    nets: nn.ModuleDict, config: FitConfig, share: float, steps: int
) -> tuple[torch.optim.Optimizer, torch.optim.lr_scheduler.LRScheduler]:
    rates = [share * KINDS[name][1] for name in nets]
    groups = [{"params": list(net.parameters()), "lr": rate} for net, rate in zip(nets.values(), rates, strict=True)]
    optimiser = torch.optim.AdamW(groups, weight_decay=config.decay)
    return optimiser, torch.optim.lr_scheduler.OneCycleLR(
        optimiser, rates, total_steps=max(steps, 11), pct_start=0.1, div_factor=10, cycle_momentum=False
    )


def logits(nets: nn.ModuleDict, samples: Samples, config: FitConfig) -> dict[str, Tensor]:
    """(G, K) logits of each network for all samples, in their order."""
    nets.eval()
    order = np.argsort(samples.lengths(), kind="stable")
    found: dict[str, list[Tensor]] = {name: [] for name in nets}
    with torch.no_grad():
        for i in range(0, len(order), 256):
            x = padded(samples, order[i : i + 256], config.longest)
            lengths = lengths_of(samples, order[i : i + 256], config.longest)
            for name, net in nets.items():
                found[name].append(net(x, lengths))
    back = torch.from_numpy(np.argsort(order, kind="stable"))
    return {name: torch.cat(parts)[back] for name, parts in found.items()}


def load_nets(path: Path) -> nn.ModuleDict:
    """What `save_nets` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        nets = build(dict.fromkeys(name.split(".")[0] for name in stored.files))
        nets.load_state_dict({name: torch.from_numpy(stored[name]) for name in stored.files})
    return nets
