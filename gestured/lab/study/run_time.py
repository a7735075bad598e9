"""Error against run time: what a gesture costs, from the segment that was cut to the answer, on one core.

The study's methods and the models that ship are timed, window, features and decision included: networks and forests in
onnxruntime (one thread), as in the daemon, the rest in scikit-learn. Processor time is measured, so that other programs
on the machine do not count. All take turns gesture by gesture, in another order each time: cold, 67 ms after the last
one, as in a daemon at 15 Hz whose caches other programs have filled since; and warm, the same gesture at once again.
All are judged on people from whom neither the study's models, which learned from the whole cohort with shifted copies,
nor the shipped ones have learned.

Errors are given in three fields. `simulated` is of those new people. For the study's methods, `foreign` and `real` are
the cells of these protocols (every gesture that was cut out is answered). For the shipped models, `foreign` is of what
they publish for the other generator's windows, and `real` has the manifest's figures of real subjects, each judged by
networks that never saw that subject.
"""

import os
import pickle
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits
from torch import Tensor, nn

from gestured.core.frames import Segment
from gestured.lab.evaluate import model_answers, outcome
from gestured.lab.export import measured
from gestured.lab.forest import OPSET, forest_graph
from gestured.lab.intervals import summary
from gestured.lab.progress import progress
from gestured.lab.samples import WINDOW, Samples
from gestured.lab.study.cohort import Cohort
from gestured.lab.study.material import SHIFT, UNCHANGED, Data, classes
from gestured.lab.study.methods import METHODS, Estimator
from gestured.lab.study.protocols import FOREIGN, PARTICIPANTS, REAL, fitted, material
from gestured.lab.study.tables import TUNED, Cell, Plan, task
from gestured.lab.study.training import SENSOR_SIDE, Answering, HistoryNet, Net
from gestured.lab.study.views import Values
from gestured.lab.train import REAL_SETS
from gestured.model.model import RUN_S
from gestured.model.opening import open_model
from gestured.model.session import Session
from gestured.model.shipped import shipped
from gestured.simulator import GESTURES

SHIPPED = {"cnn_lstm": "cnn_lstm", "lstm": "lstm", "tp_rf": "touch_pattern_rf"}  # methods, and the models that ship


@dataclass(frozen=True)
class Runner:
    """One model, from a segment to its answer."""

    method: str
    settings: str
    answer: Callable[[Segment], tuple[int, bool]]  # the best class, and whether it is published
    size: int  # bytes on disk


class Graph:
    """A network or a forest as ONNX, opened and run as the daemon does."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self._session = Session(data)

    @classmethod
    def of_net(cls, module: nn.Module) -> "Graph":
        """The graph of a trained network; batch, and time if there is one, stay open."""
        if isinstance(module, HistoryNet):
            return cls._traced(module, torch.rand(2, SENSOR_SIDE, SENSOR_SIDE), {0: "B"})
        return cls._traced(Answering(module), torch.rand(2, 5, SENSOR_SIDE, SENSOR_SIDE), {0: "B", 1: "T"})

    @classmethod
    def _traced(cls, net: nn.Module, example: Tensor, axes: dict[int, str]) -> "Graph":
        with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
            warnings.simplefilter("ignore")  # warnings of the tracer; tests compare graph and network
            path = Path(folder) / "net.onnx"
            torch.onnx.export(
                net.eval(), (example,), path, dynamo=False, opset_version=OPSET,
                input_names=["features"], output_names=["scores"], dynamic_axes={"features": axes, "scores": {0: "B"}},
            )  # fmt: skip
            return cls(path.read_bytes())

    def run(self, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """(1, ...) inputs -> (1, G) scores."""
        return self._session.run(["scores"], {"features": inputs}, RUN_S)[0]


def _learned(method: str, values: Values, model: Estimator | Graph) -> Runner:
    """A method of the study, which rejects nothing; the size of a scikit-learn model is that of its pickle."""
    view = METHODS[method].view

    def answer(segment: Segment) -> tuple[int, bool]:
        seen = view.one(WINDOW.apply(segment), values)
        if isinstance(model, Estimator):
            return int(model.fitted.predict(seen)[0]), True
        return int(model.run(seen).argmax()), True

    size = len(pickle.dumps(model.fitted)) if isinstance(model, Estimator) else len(model.data)
    return Runner(method, TUNED, answer, size)


def _shipped(method: str, path: Path) -> Runner:
    """A model that ships, by its own threshold."""
    model = open_model(path)

    def answer(segment: Segment) -> tuple[int, bool]:
        found = model.classify(segment)
        name = model.gestures[int(found.values.argmax())]
        return GESTURES.index(name), found.confidence >= found.threshold

    return Runner(method, "shipped", answer, path.stat().st_size)


def runners(plan: Plan, tuned: Mapping[str, Values], data: Data) -> list[Runner]:
    """Every method, fitted to all gestures and their shifted copies, then the shipped models."""
    out: list[Runner] = []
    for method in progress(METHODS.values(), len(METHODS), "models to be timed"):
        of_task = task(method, tuned[method.id], SHIFT, PARTICIPANTS, "simulated", plan)
        of, inputs = material(of_task, data)
        model = fitted(of_task, inputs, np.arange(len(of.labels)), of.labels)
        values = dict(of_task.values)
        form: Estimator | Graph
        if isinstance(model, Net):
            form = Graph.of_net(model.module)
        elif method.id.endswith("_rf"):
            form = Graph(forest_graph(model.fitted, len(GESTURES), {}).SerializeToString(deterministic=True))
        else:
            form = model
        out.append(_learned(method.id, values, form))
    return out + [_shipped(method, shipped()[name]) for method, name in SHIPPED.items()]


WARM = 20  # gestures that are answered before anything is timed


def measure(plan: Plan, tuned: Mapping[str, Values], judges: Cohort, data: Data) -> list[dict[str, Any]]:
    """The section `run_time` of study.json; `judges` are people from whom nothing has learned."""
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
            named, said = map(np.array, zip(*map(runner.answer, segments), strict=True))
            answers = np.eye(len(GESTURES), dtype=np.float32)[named], np.where(said, 0.0, 1.0).astype(np.float32)
            judged = outcome(answers, truth, 0.5, len(truth) + judges.lost, people)
            rows.append({
                "method": runner.method, "settings": runner.settings, **summary(named == truth, people),
                "fields": {"simulated": field_of(asdict(judged))},
                "cold_us": round(float(np.median(cold)) * 1e6, 1), "median_us": round(float(np.median(warm)) * 1e6, 1),
                "p95_us": round(float(np.quantile(warm, 0.95)) * 1e6, 1),
                "file_bytes": runner.size,
            })  # fmt: skip
    return rows


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


@contextmanager
def _one_core() -> Iterator[None]:
    """Bind this process to one of its cores, if the system can (Linux)."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


SEEN = {"foreign": (FOREIGN, SHIFT), "real": (REAL, UNCHANGED)}  # protocol and augmentation of the study's own cells


def field_of(evaluation: Mapping[str, Any]) -> dict[str, Any]:
    """The shares of an `Evaluation`, as JSON has it, that are wrong, and that are wrong or lost, with intervals."""
    right, wrong = (
        [evaluation[name], *(evaluation["intervals"][name][end] for end in ("low", "high"))]
        for name in ("right", "wrong")
    )
    error = [1 - right[0], 1 - right[2], 1 - right[1]]
    shares = {"wrong": wrong, "error": error}
    ends = {f"{name}{end}": of[k] for name, of in shares.items() for k, end in enumerate(("", "_low", "_high"))}
    return {name: round(share, 4) for name, share in ends.items()} | {"performed": evaluation["gestures"]}


def with_fields(
    rows: Sequence[Mapping[str, Any]], cells: Mapping[Cell, Mapping[str, Any]], judges: tuple[Samples, int] | None
) -> list[dict[str, Any]]:
    """The rows of run time with all fields; `cells` as study.json has them, `judges` and how many were performed."""
    return [{**row, "fields": row["fields"] | _others(row, cells, judges)} for row in rows]


def _others(
    row: Mapping[str, Any], cells: Mapping[Cell, Mapping[str, Any]], judges: tuple[Samples, int] | None
) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if row["settings"] == "shipped":
        path = shipped()[SHIPPED[row["method"]]]
        model = open_model(path)
        if judges and model.metadata.window == WINDOW and model.gestures == tuple(GESTURES):
            samples, performed = judges
            answers = model_answers(model, samples)
            judged = outcome(answers, classes(samples), model.threshold, performed, samples.people)
            found["foreign"] = field_of(asdict(judged))
        if real := measured(path).get("real", {}).get(REAL_SETS[0]):
            found["real"] = field_of(real)
        return found
    for field, (protocol, augmentation) in SEEN.items():
        if cell := cells.get(Cell(row["method"], TUNED, augmentation, protocol, field)):
            wrong = {"low": 1 - cell["high"], "high": 1 - cell["low"]}
            ends = {"wrong": wrong, "right": cell}
            found[field] = field_of({**cell, "wrong": 1 - cell["right"], "gestures": cell["n"], "intervals": ends})
    return found
