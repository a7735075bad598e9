"""The status of the daemon, which `gesturectl status` shows; /readyz and the gauges of /metrics are parts of it."""

import os
import time
from collections.abc import Mapping
from typing import Any

from gestured import __version__
from gestured.core.address import Address, Grid
from gestured.core.beside.reading import SILENT, Reading
from gestured.daemon.metrics import Counter
from gestured.daemon.parts import Parts, heeds
from gestured.daemon.sockets import kernel_drops

HANG_S = 2.0  # the loop counts as hanging after so long without a beat


def status(parts: Parts) -> dict[str, Any]:
    """The answer to the verb `status`; durations are in seconds, `time` and `started` in s since the Unix epoch."""
    now, metrics, ladder, shift = time.monotonic(), parts.metrics, parts.ladder, parts.desk.shift
    epoch, readings, scene = time.time() - now, parts.readings(), parts.hub.scene
    states = {name: reading.state for name, reading in readings.items()}
    ready = _ready(parts, states)
    return {
        "version": __version__,
        "instance": parts.instance,
        "pid": os.getpid(),
        "time": now + epoch,
        "started": parts.started,
        "uptime_s": round(now - parts.begun, 1),
        "state": ready["state"],
        "ready": ready,
        "addresses": parts.bound.addresses(),
        "model": {
            "active": ladder.active,
            "asked": ladder.name,
            "rung": ladder.rung,
            "degraded": ladder.degraded,
            "failures": ladder.failures,
            "refused": ladder.refused,
            "file": ladder.source,
            "version": ladder.model.metadata.version,
            "sha256": ladder.model.sha256,
            "gestures": list(scene.gestures),
        },
        "own": parts.own.report(),
        "sensors": {
            name: {**sensor(reading, now, epoch), "zones": {k: zone.at for k, zone in scene.setup(name).zones.items()}}
            for name, reading in readings.items()
        },
        "gates": sorted(parts.hub.gates.of(None)),
        "overdue": {gate: round(seconds, 1) for gate, seconds in parts.gates.overdue(now).items()},
        "recent": list(parts.desk.recent),
        "answers": {
            "gestures": _by_label(metrics.gestures.values),
            "unknown": metrics.unknown.total(),
            "suppressed": _by_label(metrics.suppressed.values),
            "cancelled": _by_label(metrics.cancelled.values),
        },
        "provisional": {"given": 0, "confirmed": 0, "revoked": 0} | _by_label(metrics.provisional.values),
        "shift": {
            "gestures": shift.count,
            "outside": {name: round(share, 3) for name, share in shift.shares().items()},
            "unlike": shift.unlike(),
        },
        "input": {
            "dropped": _by_label(metrics.dropped.values),
            "kernel_drops": kernel_drops(parts.bound.udp),
            "implausible": metrics.implausible.total(),
        },
        "output": {
            "subscribers": parts.clients.count,
            "backlog_bytes": parts.clients.backlog,
            "lines_lost": metrics.lost_lines.total(),
            "evicted": _by_label(metrics.evicted.values),
            "osc": _by_label(metrics.sent.values),
        },
        "last_s_ago": {
            "dropped": _ages(metrics.dropped, now),
            "kernel_drops": round(now - metrics.kernel_dropped_at, 1) if metrics.kernel_drops else None,
            "implausible": _ages(metrics.implausible, now),
            "lines_lost": _ages(metrics.lost_lines, now),
            "evicted": _ages(metrics.evicted, now),
            "osc": _ages(metrics.sent, now),
            "internal_errors": _ages(metrics.internal_errors, now),
            "reloads": _ages(metrics.reloads, now),
        },
        "loop_lag_s": round(parts.late_s, 4),
        "internal_errors": metrics.internal_errors.total(),
        "reloads": _by_label(metrics.reloads.values),
        "taps": parts.taps.count,
        "flight_recorder": {"limit_bytes": parts.taps.ring_bytes, "held_bytes": parts.taps.held_bytes},
    }


def healthy(parts: Parts) -> dict[str, Any]:
    """The answer of /healthz: whether the loop turns."""
    age_s = parts.pulse.age_s
    return {"healthy": age_s < HANG_S, "loop_age_s": round(age_s, 3)}


def overall(states: Mapping[str, str], *, impaired: bool) -> str:
    """The daemon's state by those of its sensors: "ok", "degraded" (if it is `impaired`) or "no_data"."""
    if all(state in SILENT for state in states.values()):
        return "no_data"
    return "degraded" if impaired else "ok"


def sensor(reading: Reading, now: float, epoch: float) -> dict[str, Any]:
    """One sensor as the status shows it at `now`, in monotonic s; `now + epoch` is in s since the Unix epoch.

    Only ages are rounded: rounding costs more than all else here, and /metrics shows the same figures.
    """
    shown = {
        "state": reading.state,
        "reason": reading.reason,
        "rate_hz": reading.rate_hz,
        "jitter_s": reading.jitter_s,
        "bad_taxels": reading.bad_taxels,
        "drift": reading.drift,
        "grid": str(Grid(*reading.grid)),
        **heeds(reading.gate, epoch),
    }
    if reading.source is not None:
        shown |= {
            "source": str(Address(*reading.source[:2])),
            "heard_s_ago": round(now - reading.heard, 3),
            "lost": reading.lost,
            "lost_s_ago": None if reading.lost_at is None else round(now - reading.lost_at, 1),
            "exchanged": reading.exchanged,
            "noise": reading.noise,
            "touched": reading.touched,
            "gestures": reading.sequence,
        }
    return shown


def _ready(parts: Parts, states: Mapping[str, str]) -> dict[str, Any]:
    """The answer of /readyz: whether frames that come now would be answered, and why not."""
    reasons = {
        "the event loop hangs": not healthy(parts)["healthy"],
        "the daemon is stopping": parts.stopping,
        "no model could classify the last segment": parts.desk.models_failed,
    }
    return {
        "ready": not any(reasons.values()),
        "reason": "; ".join(reason for reason, holds in reasons.items() if holds) or None,
        "state": overall(states, impaired=parts.impaired),
        "loop_lag_s": round(parts.late_s, 3),
        "shift": parts.desk.shift.unlike(),
        "model": parts.ladder.active,
        "degraded": parts.ladder.degraded,
        "sensors": states,
    }


def _by_label(values: Mapping[tuple[str, ...], int]) -> dict[str, int]:
    return {" ".join(labels) or "all": count for labels, count in dict(values).items()}


def _ages(counter: Counter, now: float) -> dict[str, float]:
    """By label, how many seconds ago a dated counter was last raised."""
    return {" ".join(labels) or "all": round(now - last, 1) for labels, last in dict(counter.last).items()}
