"""The online protocol: continuous sessions of new participants over UDP to a real daemon, with the study's own models.

The touch-pattern forest, the LSTM and the CNN-LSTM learn from the whole cohort and its shifted copies, as in the paper,
are exported, and run by the daemon. They know ten gestures and nothing else: they reject nothing, so every non-gesture
(a fifth of what is performed) that is answered is false. The shipped models, which do reject, play the same sessions
for comparison (`shipped`). Each session is of another person; the interval is over people.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch

import gestured
from gestured.lab.export import Facts, export_forest, export_net
from gestured.lab.intervals import interval
from gestured.lab.online import play, takes, tallied
from gestured.lab.progress import progress
from gestured.lab.samples import WINDOW
from gestured.lab.study.material import SHIFT, Data, pool
from gestured.lab.study.methods import METHODS, Estimator
from gestured.lab.study.run_time import SHIPPED
from gestured.lab.study.tables import Plan
from gestured.lab.study.training import Answering
from gestured.lab.study.views import Values
from gestured.model.features import feature_names
from gestured.simulator import GESTURES, Take

FIRST_PERSON = 900  # the cohort's are 0 to 33
SPEED = 100.0  # times real time
CALIBRATION = {"threshold": 0.0}  # nothing is rejected


def export(name: str, values: Values, data: Data, seed: int, path: Path) -> None:
    """Fit a method to all gestures and their shifted copies, and write it as the daemon takes it."""
    method, of = METHODS[name], pool(data, SHIFT)
    if name == "tp_rf":
        values = {**values, "features": "daemon"}  # the daemon computes these, and no others
    inputs = method.view.all(of.samples, values, False)
    model = method.fit(inputs, np.arange(len(of.labels)), of.labels, len(GESTURES), values, seed)
    facts = Facts(SHIPPED[name], gestured.__version__, GESTURES, WINDOW, CALIBRATION, data.gestures.digest(), {})
    if isinstance(model, Estimator):
        export_forest(model.fitted, path, facts, feature_names(WINDOW.rows, WINDOW.columns))
    else:
        torch.set_num_threads(1)
        export_net(Answering(model.module), path, facts)


def score(model: str, sessions: list[Take], title: str) -> dict[str, Any]:
    """Play every session to a daemon with this model; returns shares of the gestures that were performed."""
    tallies = []
    for take in progress(sessions, len(sessions), title):
        events, zero = play(model, take, SPEED)
        tallies.append(tallied(take, zero, events)[0])
    of = {key: np.array([tally.counts[key] for tally in tallies]) for key in ("right", "wrong", "missed", "false")}
    performed = of["right"] + of["wrong"] + of["missed"]
    rights = np.concatenate([np.arange(n) < right for n, right in zip(performed, of["right"], strict=True)])
    right, low, high = interval(rights, np.repeat(np.arange(len(tallies)), performed))
    waits, total = [wait for tally in tallies for wait in tally.latencies], len(rights)
    minutes = sum(float(take.sensor_times[-1] - take.sensor_times[0]) / 60 for take in sessions)
    return {
        "gestures": total, "right": round(right, 4), "low": round(low, 4), "high": round(high, 4),
        "wrong": round(of["wrong"].sum() / total, 4), "missed": round(of["missed"].sum() / total, 4),
        "false_per_minute": round(of["false"].sum() / minutes, 3),
        "latency_ms": round(1000 * float(np.median(waits))) if waits else None,
    }  # fmt: skip


def online(plan: Plan, tuned: dict[str, Values], data: Data) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The rows of the study's models, and those of the shipped ones."""
    if not plan.minutes:
        return [], []
    sessions = list(takes(plan.minutes, FIRST_PERSON))
    ours, shipped = [], []
    for name in ("tp_rf", "lstm", "cnn_lstm"):
        published = METHODS[name].published_online
        with TemporaryDirectory() as folder:
            path = Path(folder, f"{name}.onnx")
            export(name, tuned[name], data, plan.seed, path)
            ours.append({"method": name, **score(str(path), sessions, f"sessions, {name}"), "published": published})
        theirs = score(SHIPPED[name], sessions, f"sessions, shipped {name}")
        shipped.append({"method": name, **theirs, "published": published})
    return ours, shipped
