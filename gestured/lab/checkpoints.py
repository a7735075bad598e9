"""Networks and half-finished runs on disk: plain arrays, without pickles."""

import warnings
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.record.files import PUBLIC, atomic_write


def save_nets(path: Path, nets: nn.ModuleDict) -> None:
    """Weights as plain arrays, without pickles."""
    _write(path, {name: value.numpy() for name, value in nets.state_dict().items()})


def store(path: Path, nets: nn.ModuleDict, optimiser: torch.optim.Optimizer, epochs: int) -> None:
    """A run after so many epochs: what `restore` needs to go on."""
    arrays = {f"net.{name}": value.numpy() for name, value in nets.state_dict().items()}
    for i, state in optimiser.state_dict()["state"].items():
        arrays |= {f"optimiser.{i}.{name}": value.numpy() for name, value in state.items()}
    _write(path, arrays | {"epochs": np.array(epochs)})


def restore(
    path: Path, nets: nn.ModuleDict, optimiser: torch.optim.Optimizer, schedule: torch.optim.lr_scheduler.LRScheduler
) -> int:
    """Take up a run where `store` left it; returns the epochs that are done, 0 without a checkpoint."""
    if not path.exists():
        return 0
    with np.load(path, allow_pickle=False) as stored:
        nets.load_state_dict({n[4:]: torch.from_numpy(stored[n]) for n in stored.files if n.startswith("net.")})
        state: dict[int, dict[str, Tensor]] = {}
        for name in stored.files:
            if name.startswith("optimiser."):
                _, i, key = name.split(".")
                state.setdefault(int(i), {})[key] = torch.from_numpy(stored[name])
        epochs = int(stored["epochs"])
    whole = optimiser.state_dict()
    optimiser.load_state_dict({**whole, "state": state})
    steps = int(next(iter(state.values()))["step"]) if state else 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a step before the optimiser's
        for _ in range(steps):
            schedule.step()
    return epochs


def _write(path: Path, arrays: dict[str, NDArray[np.generic]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path, PUBLIC) as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
