"""Checkpoints and the schedule: each result is computed only once, on one machine or on a cluster.

A cell's file is named by a digest of the code that shapes it, its data and its task; it is written by the process
that collects the results, so that workers on other machines need no common folder.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from threadpoolctl import threadpool_limits

from gestured.core.errors import GesturedError
from gestured.lab.dataset import in_processes
from gestured.lab.digest import code_digest
from gestured.lab.progress import progress
from gestured.lab.study.material import Data
from gestured.lab.study.protocols import Result, Task, run
from gestured.lab.written import write


@dataclass(frozen=True)
class Schedule:
    """Where results are computed and kept."""

    cache: Path
    jobs: int
    cluster: str | None = None  # a Dask scheduler's address

    def path(self, task: Task, data: Data) -> Path:
        """The file in which a cell is kept."""
        return self._path(task.method, run.__module__, [data.key, asdict(task)])

    def once(self, name: str, module: str, key: Sequence[Any], make: Callable[[], Any]) -> Any:
        """The result of `make`, from its file if it was made before.

        The file is named by `key`, and by the code of `module` and of all that it uses.
        """
        path = self._path(name, module, key)
        found = _read(path) if path.exists() else None
        if found is None:
            found = json.loads(json.dumps(make()))
            keep(path, found)
        return found

    def _path(self, name: str, module: str, key: Sequence[Any]) -> Path:
        told = json.dumps([code_digest(module), *key], sort_keys=True, default=str)
        return self.cache / "cells" / f"{name}-{hashlib.sha256(told.encode()).hexdigest()[:20]}.json"

    def results(self, tasks: Sequence[Task], sets: Mapping[str, Data], title: str) -> dict[Task, Result]:
        """Every task's result, from its file if it was computed before."""
        paths = {task: self.path(task, sets[task.data]) for task in tasks}
        done = {task: _read(path) for task, path in paths.items() if path.exists()}
        found = {task: result for task, result in done.items() if result is not None}
        todo = [task for task in paths if task not in found]
        if not todo:
            return found
        if self.cluster is None:
            cells = [(task, sets[task.data]) for task in todo]  # a process is sent the data of its cell alone
            computed = in_processes(_cell, cells, self.jobs, title)
        else:
            computed = progress(_there(todo, sets, self.cluster), len(todo), title)
        for task, result in computed:
            keep(paths[task], result)
            found[task] = result
        return found


def compute(task: Task, data: Data) -> tuple[Task, Result]:
    """A task and its result, by one thread: other processes compute beside this one."""
    torch.set_num_threads(1)
    with threadpool_limits(1):
        return task, run(task, data)


def _cell(cell: tuple[Task, Data]) -> tuple[Task, Result]:
    return compute(*cell)


def _there(todo: Sequence[Task], sets: Mapping[str, Data], cluster: str) -> Iterator[tuple[Task, Result]]:
    """Compute on Dask's workers behind a scheduler's address. Raises GesturedError if it cannot."""
    try:
        from distributed import CancelledError, Client, KilledWorker, as_completed
    except ModuleNotFoundError:
        raise GesturedError("--cluster needs distributed: pip install 'gestured[cluster]'") from None
    try:
        client = Client(cluster, timeout=10)
    except (OSError, ValueError) as error:
        raise GesturedError(f"--cluster: no Dask scheduler answers at {cluster}: {error}") from error
    with client:
        held = {name: client.scatter(data, broadcast=True) for name, data in sets.items()}
        futures = [client.submit(compute, task, held[task.data], pure=False) for task in todo]
        try:
            for future in as_completed(futures):
                yield future.result()
        except (KilledWorker, CancelledError):
            reason = "as where there is too little memory; what is finished is kept"
            raise GesturedError(f"--cluster: workers or the scheduler at {cluster} were killed, {reason}") from None


def keep(path: Path, result: Any) -> None:
    """Write a checkpoint, all or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, json.dumps(result), durable=False)


def _read(path: Path) -> Result | None:
    """A checkpoint; None if the file is damaged, so that it is computed again."""
    try:
        found: Result = json.loads(path.read_text())
    except ValueError:
        return None
    return found
