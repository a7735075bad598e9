"""What `gesturectl status` shows: one object that says how the daemon is."""

import os
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from gestured import __version__
from gestured.core.events import Cancelled, Event, Gesture, Unknown

if TYPE_CHECKING:
    from gestured.daemon.service import Service

RECENT = 10  # answers that are shown


class Recent:
    """The last answers, as a person wants to see them."""

    def __init__(self) -> None:
        self._lines: deque[dict[str, Any]] = deque(maxlen=RECENT)

    def note(self, event: Event, epoch: float, test: bool) -> None:
        """Remember an answer; whatever else happened is passed over."""
        if isinstance(event, Gesture | Unknown | Cancelled):
            self._lines.append(
                {
                    "time": time.time() if isinstance(event, Cancelled) else event.decided + epoch,
                    "sensor": event.sensor,
                    "answer": _answer(event),
                    "confidence": None if isinstance(event, Cancelled) else round(event.confidence, 3),
                    "test": test,
                }
            )

    def lines(self) -> list[dict[str, Any]]:
        """Oldest first."""
        return list(self._lines)


def _answer(event: Gesture | Unknown | Cancelled) -> str:
    match event:
        case Gesture():
            return event.gesture
        case Unknown():
            return "unknown"
        case _:
            return f"cancelled: {event.reason}"


def status(service: "Service") -> dict[str, Any]:
    """Everything at once; durations in seconds, `time` since the Unix epoch."""
    now = time.monotonic()
    pipeline, health, metrics = service.pipeline, service.health, service.metrics
    ladder, watched = pipeline.watched.ladder, pipeline.watched
    model: Any = ladder.model
    return {
        "version": __version__,
        "instance": health.instance,
        "pid": os.getpid(),
        "time": time.time(),
        "uptime_s": round(now - service.started, 1),
        "state": health.status(now).state,
        "ready": health.readyz()[1],
        "addresses": service.addresses(),
        "model": {
            "active": ladder.active,
            "asked": ladder.name,
            "rung": ladder.rung,
            "degraded": ladder.degraded,
            "failures": ladder.failures,
            "file": ladder.source,
            "version": model.metadata.version,
            "sha256": model.sha256,
            "gestures": list(pipeline.gestures),
        },
        "sensors": {name: _sensor(service, name, asdict(r), now) for name, r in pipeline.readings(now).items()},
        "recent": service.recent.lines(),
        "answers": {
            "gestures": _by_label(metrics.gestures.values),
            "unknown": metrics.unknown.total(),
            "cancelled": _by_label(metrics.cancelled.values),
            "tests": metrics.tests.total(),
        },
        "shift": {
            "gestures": watched.shift.count,
            "outside": {name: round(share, 3) for name, share in watched.shift.shares().items()},
            "unlike": watched.shift.unlike(),
        },
        "shadow": watched.shadow.report() if watched.shadow else None,
        "input": {"dropped": _by_label(metrics.dropped.values), "kernel_drops": service.kernel_drops()},
        "output": {
            "subscribers": service.clients.count,
            "backlog_bytes": service.clients.backlog,
            "lines_lost": metrics.lost_lines.total(),
            "evicted": _by_label(metrics.evicted.values),
            "osc": _by_label(metrics.sent.values),
        },
        "loop_lag_s": round(health.lag_s, 4),
        "internal_errors": metrics.internal_errors.total(),
        "reloads": _by_label(metrics.reloads.values),
        "taps": service.taps.count,
        "flight_recorder": {"limit_bytes": service.taps.ring_bytes, "held_bytes": service.taps.held_bytes},
    }


def _sensor(service: "Service", name: str, reading: dict[str, Any], now: float) -> dict[str, Any]:
    rounded = {key: round(value, 4) if isinstance(value, float) else value for key, value in reading.items()}
    rounded["grid"] = str(service.pipeline.grid(name))
    sensor = service.pipeline.sensors.get(name)
    if sensor is None:
        return rounded
    return rounded | {
        "source": f"{sensor.owner.source[0]}:{sensor.owner.source[1]}",
        "heard_s_ago": round(now - sensor.owner.heard, 3),
        "lost": sensor.lost,
        "noise": round(sensor.recognizer.front_end.noise, 4),
        "touched": sensor.recognizer.front_end.touched,
        "gestures": sensor.recognizer.sequence,
    }


def _by_label(values: Mapping[tuple[str, ...], int]) -> dict[str, int]:
    return {" ".join(labels) or "all": count for labels, count in dict(values).items()}
