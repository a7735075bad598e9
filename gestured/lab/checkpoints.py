"""Networks and interrupted training runs on disk: plain arrays, without pickles."""

import warnings
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from gestured.lab.written import load, save


def store(path: Path, nets: nn.ModuleDict, optimiser: torch.optim.Optimizer, epochs: int) -> None:
    """Store a run after so many `epochs`, from which `restore` can continue it."""
    arrays = {f"net.{name}": value.numpy() for name, value in nets.state_dict().items()}
    for i, state in optimiser.state_dict()["state"].items():
        arrays |= {f"optimiser.{i}.{name}": value.numpy() for name, value in state.items()}
    save(path, arrays | {"epochs": np.array(epochs)})


def restore(
    path: Path, nets: nn.ModuleDict, optimiser: torch.optim.Optimizer, schedule: torch.optim.lr_scheduler.LRScheduler
) -> int:
    """Restore a run that `store` has stored; returns the epochs that are done, 0 without a checkpoint."""
    stored = load(path)
    if stored is None:
        return 0
    nets.load_state_dict({n[4:]: torch.from_numpy(value) for n, value in stored.items() if n.startswith("net.")})
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in stored.items():
        if name.startswith("optimiser."):
            _, i, key = name.split(".")
            state.setdefault(int(i), {})[key] = torch.from_numpy(value)
    whole = optimiser.state_dict()
    optimiser.load_state_dict({**whole, "state": state})
    steps = int(next(iter(state.values()))["step"]) if state else 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about a schedule that steps before its optimiser
        for _ in range(steps):
            schedule.step()
    return int(stored["epochs"])
