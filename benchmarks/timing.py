"""Timing on a noisy machine: what is compared is measured in turn, and medians are given with their spread."""

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Row:
    """One line of the table: gestured against a comparison, and the goal."""

    figure: str
    ours: str
    against: str
    ratio: str
    goal: str
    reached: bool | None  # None if there is no goal


@dataclass(frozen=True)
class Ratio:
    """The quotients of paired measurements: their median, least and most."""

    median: float
    least: float
    most: float

    def __str__(self) -> str:
        return f"{self.median:.3g} ({self.least:.3g} to {self.most:.3g})"


def ratio(over: list[float], under: list[float]) -> Ratio:
    """The quotients of measurements that were taken in turn."""
    found = sorted(a / b for a, b in zip(over, under, strict=True))
    return Ratio(median(found), found[0], found[-1])


def cpu_us(work: Callable[[], object], times: int) -> float:
    """Microseconds of this process's CPU for one call of `work`, over `times` of them."""
    start = time.process_time()
    for _ in range(times):
        work()
    return 1e6 * (time.process_time() - start) / times


def interleaved(a: Callable[[], float], b: Callable[[], float], repeats: int) -> tuple[list[float], list[float]]:
    """Measure a, b, a, b ...; the first pair warms up and is thrown away."""
    pairs = [(a(), b()) for _ in range(repeats + 1)][1:]
    return [x for x, _ in pairs], [y for _, y in pairs]


def delay_ms(event: Mapping[str, Any], heard: float) -> float:
    """Milliseconds from the decision of an answer, or from the onset of a contact, to `heard` (monotonic s)."""
    epoch = time.time() - time.monotonic()
    return 1e3 * (heard - (float(event.get("decided", event["onset"])) - epoch))


def cpu_s_of(pid: int) -> float:
    """Seconds of CPU that all threads of a process have used, to the nanosecond (Linux)."""
    tasks = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(task.read_text().split()[0]) for task in tasks) / 1e9


def resident_kib(pid: int) -> int:
    """KiB of resident memory of a process (Linux)."""
    pages = Path(f"/proc/{pid}/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE") // 1024


def percentile(values: list[float], share: float) -> float:
    """The value below which a `share` of the values lies."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]
