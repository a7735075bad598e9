"""Checkpoints: what is computed is not computed again; and the same numbers on a cluster."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gestured.core.errors import GesturedError
from gestured.lab.study import cells, study
from gestured.lab.study.cells import Schedule
from gestured.lab.study.protocols import CLEAN, PARTICIPANTS
from gestured.lab.study.tables import Plan
from tests.lab.study.material_made import data
from tests.lab.study.test_protocols import task

TASKS = [task(CLEAN), task(PARTICIPANTS), task(PARTICIPANTS, "none")]


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computes in this process: starting others takes longer than the work."""
    monkeypatch.setattr(cells, "in_processes", lambda make, todo, *_: map(make, todo))


def test_a_second_run_computes_nothing(tmp_path: Path, here: None, monkeypatch: pytest.MonkeyPatch) -> None:
    sets = {"simulated": data()}
    first = Schedule(tmp_path, 1).results(TASKS, sets, "cells")
    monkeypatch.setattr(cells, "compute", lambda *_: pytest.fail("computed again"))
    assert Schedule(tmp_path, 1).results(TASKS, sets, "cells") == first


def test_what_was_finished_before_an_interruption_is_kept(
    tmp_path: Path, here: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    sets, whole = {"simulated": data()}, cells.compute
    left = iter([whole, whole])

    def interrupted(*arguments: object) -> object:
        step = next(left, None)
        if step is None:
            raise KeyboardInterrupt
        return step(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(cells, "compute", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Schedule(tmp_path, 1).results(TASKS, sets, "cells")
    kept = list(tmp_path.glob("cells/*.json"))
    assert kept and all(json.loads(path.read_text()) for path in kept)
    monkeypatch.setattr(cells, "compute", whole)
    assert len(Schedule(tmp_path, 1).results(TASKS, sets, "cells")) == len(TASKS)


def test_a_damaged_checkpoint_is_made_again(tmp_path: Path, here: None) -> None:
    sets, schedule = {"simulated": data()}, Schedule(tmp_path, 1)
    first = schedule.results(TASKS[:1], sets, "cells")
    schedule.path(TASKS[0], sets["simulated"]).write_text("{")
    second = schedule.results(TASKS[:1], sets, "cells")
    assert second == first


def test_other_data_are_other_checkpoints(tmp_path: Path) -> None:
    schedule = Schedule(tmp_path, 1)
    assert schedule.path(TASKS[0], data(4)) != schedule.path(TASKS[0], data(5))


def test_other_shipped_models_are_played_again(tmp_path: Path, shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plays = iter(range(9))
    monkeypatch.setattr(study, "online", lambda *_: ([], [{"play": next(plays)}]))

    def play() -> int:
        _, ((row,)) = study.played(Plan.small(), {}, data(), Schedule(tmp_path, 1))
        return int(row["play"])

    assert play() == play() == 0
    with (shelf / "lstm.onnx").open("ab") as file:
        file.write(b"\0")
    assert play() == 1


@pytest.fixture
def cluster() -> Iterator[str]:
    """A real scheduler and two workers, each a process of its own."""
    pytest.importorskip("distributed", reason="distributed is not installed: pip install 'gestured[cluster]'")
    programs: list[subprocess.Popen[str]] = []
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    scheduler = subprocess.Popen([*dask, "--no-dashboard"], stderr=subprocess.PIPE, text=True)
    programs.append(scheduler)
    assert scheduler.stderr is not None
    address = next(line.split()[-1] for line in scheduler.stderr if "Scheduler at:" in line)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    programs += [subprocess.Popen([*worker, "--no-nanny"], stderr=subprocess.DEVNULL, text=True) for _ in range(2)]
    yield address
    for program in reversed(programs):
        program.terminate()
        program.wait(20)


@pytest.mark.slow
def test_a_cluster_gives_the_same_numbers(tmp_path: Path, cluster: str) -> None:
    sets = {"simulated": data()}
    alone = dict(cells.compute(one, sets["simulated"]) for one in TASKS)
    together = Schedule(tmp_path / "together", 1, cluster).results(TASKS, sets, "cells")
    assert together == alone


def test_workers_of_a_cluster_that_are_killed_are_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cluster: str
) -> None:
    # By value, so that the workers need not import this file and what it stands on.
    monkeypatch.setattr(cells, "compute", lambda *_: __import__("os").kill(__import__("os").getpid(), 9))
    with pytest.raises(GesturedError, match=f"--cluster: workers or the scheduler at {cluster} were killed"):
        Schedule(tmp_path, 2, cluster).results(TASKS, {"simulated": data()}, "cells")


def test_without_a_scheduler_one_sentence_says_so(tmp_path: Path) -> None:
    with pytest.raises(GesturedError, match="--cluster"):
        Schedule(tmp_path, 1, "tcp://127.0.0.1:9").results(TASKS[:1], {"simulated": data()}, "cells")
