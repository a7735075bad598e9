"""Error against run time: what a gesture costs, from the segment that was cut to the answer, on one core.

What is timed are the study's methods and the models that ship (`runners`), window, features and decision included. What
counts is the processor's time, so that other programs on the machine do not. All take turns gesture by gesture, in
another order each time: cold, 67 ms after the last one, as in a daemon at 15 Hz whose caches other programs have filled
since; and warm, the same gesture at once again. All are judged on people whom none has learned from, neither the
study's models, which learned from the whole cohort with shifted copies, nor the shipped ones.
"""

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from gestured.core.frames import Segment
from gestured.lab.evaluate import outcome
from gestured.lab.intervals import summary
from gestured.lab.progress import progress
from gestured.lab.samples import WINDOW
from gestured.lab.study.cohort import Cohort
from gestured.lab.study.fields import field_of
from gestured.lab.study.material import Data
from gestured.lab.study.plan import Plan
from gestured.lab.study.runners import Runner, runners
from gestured.lab.study.views import Values
from gestured.simulator import GESTURES

WARM = 20  # gestures that are answered before anything is timed


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
            named, said = map(np.array, zip(*map(runner.answer, segments), strict=True))
            answers = np.eye(len(GESTURES), dtype=np.float32)[named], np.where(said, 0.0, 1.0).astype(np.float32)
            judged = outcome(answers, truth, 0.5, len(truth) + judges.lost, people)
            rows.append({
                "method": runner.method, "settings": runner.settings, **summary(named == truth, people),
                "fields": {"simulated": field_of(asdict(judged))},
                "cold_us": round(float(np.median(cold)) * 1e6, 1), "median_us": round(float(np.median(warm)) * 1e6, 1),
                "p95_us": round(float(np.quantile(warm, 0.95)) * 1e6, 1),
                "file_bytes": runner.size(),
            })  # fmt: skip
    for row in rows:
        row["front"] = not any(_beats(other, row) for other in rows)
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
