"""Error against run time: what a gesture costs, from the segment that was cut to the answer, on one core.

Every method runs as well as it can here: networks and forests in onnxruntime (one thread), as in the daemon, the rest
in scikit-learn. All take turns gesture by gesture, in another order each time, after a warm-up; window, features and
decision are included. What counts is the processor's time, so that other programs on the machine do not. All learned
from the same participants with shifted copies, and are judged on those held out of the first fold, so that rows
differ in the method alone. Memory is what a fresh process grows by, with all libraries loaded, when it takes in the
model and answers a few gestures. int8 is onnxruntime's dynamic quantisation of matrix products and LSTMs.
"""

import importlib
import multiprocessing
import os
import pickle
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from gestured.core.frames import Segment
from gestured.lab.dataset import WINDOW
from gestured.lab.progress import progress
from gestured.lab.study import onnx_form
from gestured.lab.study.bootstrap import summary
from gestured.lab.study.cohort import Cohort
from gestured.lab.study.material import SHIFT, Data
from gestured.lab.study.methods import METHODS, Estimator
from gestured.lab.study.plan import Plan
from gestured.lab.study.protocols import PARTICIPANTS, fitted, material, splits
from gestured.lab.study.tables import task
from gestured.lab.study.training import Net
from gestured.lab.study.trajectory_boosting import trajectory_row
from gestured.lab.study.views import Values
from gestured.simulator import GESTURES

WARM = 20  # gestures


@dataclass
class Runner:
    """One model, from a segment to its answer."""

    method: str
    precision: str
    values: Values
    model: Estimator | onnx_form.Graph

    def answer(self, segment: Segment) -> int:
        """The class that it names."""
        seen = METHODS[self.method].view.one(WINDOW.apply(segment), self.values)
        if isinstance(self.model, Estimator):
            return int(self.model.fitted.predict(seen)[0])
        return int(self.model.run(seen).argmax())

    def size(self) -> int:
        """Bytes on disk: the graph, or scikit-learn's own form."""
        return len(pickle.dumps(self.model.fitted)) if isinstance(self.model, Estimator) else len(self.model.data)


def runners(plan: Plan, tuned: Mapping[str, Values], data: Data) -> tuple[list[Runner], NDArray[np.int64]]:
    """Every method, fitted, in each precision; and the gestures of the participants whom none has seen."""
    out = []
    for method in progress(METHODS.values(), len(METHODS), "models to be timed"):
        of_task = task(method, tuned[method.id], SHIFT, PARTICIPANTS, "simulated", plan)
        of, inputs = material(of_task, data)
        train, test = next(splits(of_task, of))
        model = fitted(of_task, inputs, train, of.labels)
        values = dict(of_task.values)
        if isinstance(model, Net):
            graph = onnx_form.of_net(model.module, images=not method.elapses)
            out.append(Runner(method.id, "float32", values, graph))
            smaller = onnx_form.quantised(graph)
            if smaller is not None:
                out.append(Runner(method.id, "int8", values, smaller))
        elif isinstance(model, Estimator) and method.id.endswith("_rf"):
            out.append(Runner(method.id, "float32", values, onnx_form.of_forest(model.fitted)))
        else:
            assert isinstance(model, Estimator)
            out.append(Runner(method.id, "float64", values, model))
    return out, test


def measure(plan: Plan, tuned: Mapping[str, Values], cohort: Cohort, data: Data) -> list[dict[str, Any]]:
    """The section of study.json."""
    torch.set_num_threads(1)
    with _one_core(), threadpool_limits(1):
        found, test = runners(plan, tuned, data)
        segments = [cohort.segment(int(i)) for i in test]
        times = _timed(found, segments[: plan.timed], plan.seed)
        truth, people = data.gestures.labels[test], data.gestures.people[test]
        rows = []
        for runner, took in zip(found, times, strict=True):
            good = [GESTURES[runner.answer(s)] == label for s, label in zip(segments, truth, strict=True)]
            rows.append({
                "method": runner.method, "settings": "tuned", "precision": runner.precision, **summary(good, people),
                "median_us": round(float(np.median(took)) * 1e6, 1),
                "p95_us": round(float(np.quantile(took, 0.95)) * 1e6, 1),
                "memory_bytes": None if plan.quick else grown_by(runner, segments[:WARM]), "file_bytes": runner.size(),
            })  # fmt: skip
    for row in rows:
        row["front"] = not any(_beats(other, row) for other in rows)
    return rows


def _timed(found: list[Runner], segments: list[Segment], seed: int) -> list[list[float]]:
    """Seconds of each runner for each gesture, in turns and in another order each time."""
    for runner in found:
        for segment in segments[:WARM]:
            runner.answer(segment)
    took: list[list[float]] = [[] for _ in found]
    rng = np.random.default_rng([seed, 0x71])
    for segment in progress(segments, len(segments), "run time"):
        for k in rng.permutation(len(found)):
            start = time.process_time()
            found[k].answer(segment)
            took[k].append(time.process_time() - start)
    return took


def _beats(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether `one` is at least as right and as fast, and better at one of them."""
    first, second = (one["right"], -one["median_us"]), (other["right"], -other["median_us"])
    return first != second and all(a >= b for a, b in zip(first, second, strict=True))


@contextmanager
def _one_core() -> Iterator[None]:
    """This process on one of its cores, where the system can (Linux)."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def grown_by(runner: Runner, segments: list[Segment]) -> int:
    """Bytes that a fresh process grows by when it takes in the model and answers some gestures."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    child = context.Process(target=_weigh, args=(there,), daemon=True)
    child.start()
    here.send(segments)
    here.send(runner)
    grown: int = here.recv()
    child.join()
    return grown


def _weigh(pipe: Connection) -> None:
    """In the fresh process: everything that any model needs is loaded before the scales are read."""
    segments = pipe.recv()
    for name in ("onnxruntime", "sklearn.ensemble", "sklearn.neighbors", "sklearn.svm", "sklearn.pipeline"):
        importlib.import_module(name)
    torch.set_num_threads(1)
    trajectory_row(WINDOW.apply(segments[0]))  # torch takes its own share at the first call
    before = _resident()
    runner = pipe.recv()
    for segment in segments:
        runner.answer(segment)
    pipe.send(_resident() - before)


def _resident() -> int:
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
