"""Error against run time: what a gesture costs, from the segment that was cut to the answer, on one core.

Every method runs as well as it can here: networks, forests and boosting in onnxruntime (one thread), as in the daemon,
the rest in scikit-learn; the models that ship beside them. Window, features and decision are included. What counts is
the processor's time, so that other programs on the machine do not. All take turns gesture by gesture, in another order
each time: cold, 67 ms after the last one, as in a daemon at 15 Hz whose caches other programs have filled since; and
warm, the same gesture at once again. All are judged on people whom none has learned from, neither the study's models,
which learned from the whole cohort with shifted copies, nor the shipped ones. Memory is what a fresh process grows by,
with all libraries loaded, when it takes in the model and answers a few gestures. int8 is onnxruntime's dynamic
quantisation of matrix products and LSTMs.
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
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from gestured.core.frames import Segment
from gestured.lab.progress import progress
from gestured.lab.samples import WINDOW
from gestured.lab.study import onnx_form
from gestured.lab.study.bootstrap import interval, summary
from gestured.lab.study.cohort import Cohort
from gestured.lab.study.material import SHIFT, Data
from gestured.lab.study.methods import METHODS, Estimator
from gestured.lab.study.plan import Plan
from gestured.lab.study.protocols import PARTICIPANTS, fitted, material
from gestured.lab.study.tables import TUNED, task
from gestured.lab.study.training import Net
from gestured.lab.study.trajectory_boosting import trajectory_row
from gestured.lab.study.views import Values
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES

WARM = 20  # gestures that are answered before anything is timed
SHIPPED = {"cnn_lstm": "cnn_lstm", "lstm": "lstm", "tp_rf": "touch_pattern_rf"}  # methods, and the models that ship


class Runner(Protocol):
    """One model, from a segment to its answer; sent to another process to be weighed."""

    method: str
    precision: str
    settings: str

    def answer(self, segment: Segment) -> tuple[int, bool]:
        """The class that it holds for the best, and whether it says so or rejects."""
        ...

    def size(self) -> int:
        """Bytes on disk."""
        ...


@dataclass
class Learned:
    """A method of the study, which rejects nothing."""

    method: str
    precision: str
    values: Values
    model: Estimator | onnx_form.Graph
    from_frames: bool = False  # the graph takes the window itself
    settings: str = TUNED

    def answer(self, segment: Segment) -> tuple[int, bool]:
        """As in `Runner`."""
        window = WINDOW.apply(segment)
        seen = window[None] if self.from_frames else METHODS[self.method].view.one(window, self.values)
        if isinstance(self.model, Estimator):
            return int(self.model.fitted.predict(seen)[0]), True
        return int(self.model.run(seen).argmax()), True

    def size(self) -> int:
        """The graph, or scikit-learn's own form."""
        return len(pickle.dumps(self.model.fitted)) if isinstance(self.model, Estimator) else len(self.model.data)


@dataclass
class Shipped:
    """A model that ships, opened when it is first asked."""

    method: str
    path: Path
    precision: str = "float32"
    settings: str = "shipped"
    _model: Model | None = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_model": None}

    def answer(self, segment: Segment) -> tuple[int, bool]:
        """As in `Runner`, by the model's own threshold."""
        if self._model is None:
            self._model = open_model(self.path)
        found = self._model.classify(segment)
        best = int(found.values.argmax())
        name = self._model.gestures[best]
        return GESTURES.index(name), found.confidence >= found.threshold

    def size(self) -> int:
        """The file."""
        return self.path.stat().st_size


def runners(plan: Plan, tuned: Mapping[str, Values], data: Data) -> list[Runner]:
    """Every method, fitted to all gestures and their shifted copies, in each precision; then the shipped models."""
    out: list[Runner] = []
    for method in progress(METHODS.values(), len(METHODS), "models to be timed"):
        of_task = task(method, tuned[method.id], SHIFT, PARTICIPANTS, "simulated", plan)
        of, inputs = material(of_task, data)
        model = fitted(of_task, inputs, np.arange(len(of.labels)), of.labels)
        values = dict(of_task.values)
        if isinstance(model, Net):
            graph = onnx_form.of_net(model.module, images=not method.elapses)
            out.append(Learned(method.id, "float32", values, graph))
            smaller = onnx_form.quantised(graph)
            if smaller is not None:
                out.append(Learned(method.id, "int8", values, smaller))
            continue
        assert isinstance(model, Estimator)
        if method.id.endswith("_rf"):
            out.append(Learned(method.id, "float32", values, onnx_form.of_forest(model.fitted)))
        elif method.id == "trajectory_gb":
            out.append(Learned(method.id, "float32", values, onnx_form.of_boosting(model.fitted), from_frames=True))
        else:
            out.append(Learned(method.id, "float64", values, model))
    return out + [Shipped(method, shipped()[name]) for method, name in SHIPPED.items() if shipped()[name].exists()]


def measure(plan: Plan, tuned: Mapping[str, Values], judges: Cohort, data: Data) -> list[dict[str, Any]]:
    """The section of study.json; `judges` are people whom nothing has learned from."""
    torch.set_num_threads(1)
    with _one_core(), threadpool_limits(1):
        found = runners(plan, tuned, data)
        segments = [judges.segment(i) for i in range(len(judges))]
        few = segments[:: max(1, len(segments) // plan.timed)][: plan.timed]  # of all people
        times = _timed(found, few, plan.seed)
        truth = np.array([GESTURES.index(trial.gesture) for trial in judges.trials()])
        people = np.array([trial.participant for trial in judges.trials()])
        rows = []
        for runner, (cold, warm) in zip(found, times, strict=True):
            answers = [runner.answer(segment) for segment in segments]
            named, said = (np.array(column) for column in zip(*answers, strict=True))
            rows.append({
                "method": runner.method, "settings": runner.settings, "precision": runner.precision,
                **summary(named == truth, people), **told(named, said, truth, people, judges.lost),
                "cold_us": round(float(np.median(cold)) * 1e6, 1), "median_us": round(float(np.median(warm)) * 1e6, 1),
                "p95_us": round(float(np.quantile(warm, 0.95)) * 1e6, 1),
                "memory_bytes": None if plan.quick else grown_by(runner, segments[:WARM]), "file_bytes": runner.size(),
            })  # fmt: skip
    for row in rows:
        row["front"] = not any(_beats(other, row) for other in rows)
    return rows


def told(
    named: NDArray[np.int64], said: NDArray[np.bool_], truth: NDArray[np.int64], people: NDArray[np.int64], lost: int
) -> dict[str, Any]:
    """Of all gestures that were performed: `wrong` were said wrongly, `lost` rejected or never cut; with intervals."""
    count = len(truth) + lost
    wrong, low, high = interval(said & (named != truth), people)
    either, either_low, either_high = interval(~said | (named != truth), people)
    cut = len(truth) / count
    return {
        "wrong": round(wrong * cut, 4), "wrong_low": round(low * cut, 4), "wrong_high": round(high * cut, 4),
        "error": round(either * cut + lost / count, 4), "error_low": round(either_low * cut + lost / count, 4),
        "error_high": round(either_high * cut + lost / count, 4), "performed": count,
    }  # fmt: skip


def _timed(found: list[Runner], segments: list[Segment], seed: int) -> list[tuple[list[float], list[float]]]:
    """Seconds of each runner for each gesture, cold and then warm, in turns and in another order each time."""
    for runner in found:
        for segment in segments[:WARM]:
            runner.answer(segment)
    cold: list[list[float]] = [[] for _ in found]
    warm: list[list[float]] = [[] for _ in found]
    rng = np.random.default_rng([seed, 0x71])
    for segment in progress(segments, len(segments), "run time"):
        for k in rng.permutation(len(found)):
            time.sleep(1 / WINDOW.rate_hz)
            for times in (cold[k], warm[k]):
                start = time.process_time()
                found[k].answer(segment)
                times.append(time.process_time() - start)
    return list(zip(cold, warm, strict=True))


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
