"""What `gesturectl status` shows: a snapshot and what was counted, as one JSON object."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured import __version__
from gestured.core.address import Address, Grid
from gestured.core.beside.reading import Reading, View
from gestured.core.own import Examples, to_dict
from gestured.daemon.metrics import Counter, Metrics
from gestured.daemon.settings import Settings
from gestured.daemon.snapshot import Snapshot

OPEN = {"armed": None, "closed": (), "until": None}  # of a sensor that always listens


def status(snapshot: Snapshot, metrics: Metrics) -> dict[str, Any]:
    """The answer to `status`; durations in seconds, `time` in seconds since the Unix epoch."""
    models, gates = snapshot.models, snapshot.listening
    return {
        "version": __version__,
        "instance": snapshot.instance,
        "pid": os.getpid(),
        "time": snapshot.time,
        "uptime_s": round(snapshot.uptime_s, 1),
        "state": snapshot.state,
        "ready": snapshot.readyz()[1],
        "addresses": snapshot.addresses,
        "model": {
            "active": models.active,
            "asked": models.asked,
            "rung": models.rung,
            "degraded": models.degraded,
            "failures": models.failures,
            "file": models.file,
            "version": models.version,
            "sha256": models.sha256,
            "gestures": list(snapshot.gestures),
        },
        "own": dict(snapshot.own),
        "sensors": {
            name: {**_sensor(reading, snapshot.now), **gates.get(name, OPEN), "zones": _zones(snapshot.settings, name)}
            for name, reading in snapshot.sensors.items()
        },
        "gates": list(snapshot.gates),
        "overdue": {gate: round(seconds, 1) for gate, seconds in snapshot.overdue.items()},
        "recent": list(snapshot.recent),
        "answers": {
            "gestures": _by_label(metrics.gestures.values),
            "unknown": metrics.unknown.total(),
            "suppressed": _by_label(metrics.suppressed.values),
            "cancelled": _by_label(metrics.cancelled.values),
            "tests": metrics.tests.total(),
        },
        "provisional": {"given": 0, "confirmed": 0, "revoked": 0} | _by_label(metrics.provisional.values),
        "shift": {
            "gestures": models.shift_count,
            "outside": {name: round(share, 3) for name, share in models.shift.items()},
            "unlike": list(models.unlike),
        },
        "input": {"dropped": _by_label(metrics.dropped.values), "kernel_drops": snapshot.kernel_drops},
        "output": {
            "subscribers": snapshot.clients,
            "backlog_bytes": snapshot.backlog_bytes,
            "lines_lost": metrics.lost_lines.total(),
            "evicted": _by_label(metrics.evicted.values),
            "osc": _by_label(metrics.sent.values),
        },
        "last_s_ago": {
            "dropped": _ages(metrics.dropped, snapshot.now),
            "kernel_drops": round(snapshot.now - metrics.kernel_dropped_at, 1) if metrics.kernel_drops else None,
            "lines_lost": _ages(metrics.lost_lines, snapshot.now),
            "evicted": _ages(metrics.evicted, snapshot.now),
            "osc": _ages(metrics.sent, snapshot.now),
            "internal_errors": _ages(metrics.internal_errors, snapshot.now),
            "reloads": _ages(metrics.reloads, snapshot.now),
        },
        "loop_lag_s": round(snapshot.loop_lag_s, 4),
        "internal_errors": metrics.internal_errors.total(),
        "reloads": _by_label(metrics.reloads.values),
        "taps": snapshot.taps,
        "flight_recorder": {"limit_bytes": snapshot.flight_limit_bytes, "held_bytes": snapshot.flight_held_bytes},
    }


def scene(snapshot: Snapshot, epoch_ns: int, own: Examples) -> dict[str, Any]:
    """What a recording must know to be understood without this daemon; `epoch_ns`: from the loop's clock to 1970."""
    models = snapshot.models
    return {
        "version": __version__,
        "instance": snapshot.instance,
        "epoch_ns": epoch_ns,
        "model": {
            "name": models.active,
            "sha256": models.sha256,
            "rows": models.grid[0],
            "columns": models.grid[1],
        },
        "gestures": list(snapshot.gestures),
        "own": to_dict(own),
        "settings": snapshot.settings.model_dump(mode="json"),
    }


def viewed(sensor: str, view: View, reading: Reading) -> dict[str, Any]:
    """One sensor at a moment, grids row by row; `values` are counts above the baseline, activity is in noise units."""
    return {
        "sensor": sensor,
        "state": reading.state,
        "t": view.t,
        "grid": list(view.values.shape if view.values is not None else reading.grid),
        "values": None if view.values is None else _rounded(view.values),
        "bad": [] if view.bad is None else np.flatnonzero(view.bad).tolist(),
        "raw_grid": list(reading.grid),
        "raw": None if view.raw is None else _rounded(view.raw),
        "noise": round(view.noise, 3),
        "activity": round(view.activity, 2),
        "on": round(view.on, 2),
        "off": round(view.off, 2),
        "phase": view.phase,
        "centroid": None if view.centroid is None else [round(place, 3) for place in view.centroid],
        "contact": reading.contact,
    }


def _rounded(grid: NDArray[Any]) -> list[float]:
    numbers: list[float] = np.round(grid.astype(np.float64), 2).reshape(-1).tolist()
    return numbers


def _sensor(reading: Reading, now: float) -> dict[str, Any]:
    shown = {
        "state": reading.state,
        "reason": reading.reason,
        "rate_hz": round(reading.rate_hz, 4),
        "jitter_s": round(reading.jitter_s, 4),
        "bad_taxels": reading.bad_taxels,
        "drift": round(reading.drift, 4),
        "grid": str(Grid(*reading.grid)),
    }
    if reading.source is None:
        return shown
    return shown | {
        "source": str(Address(*reading.source[:2])),
        "heard_s_ago": round(now - reading.heard, 3),
        "lost": reading.lost,
        "lost_s_ago": None if reading.lost_at is None else round(now - reading.lost_at, 1),
        "exchanged": reading.exchanged,
        "noise": round(reading.noise, 4),
        "touched": reading.touched,
        "gestures": reading.sequence,
    }


def _zones(settings: Settings, sensor: str) -> dict[str, tuple[float, ...]]:
    """Left, bottom, right and top edge of each zone of a sensor, in fractions of it."""
    own = settings.sensors.get(sensor)
    return {} if own is None else {name: zone.at for name, zone in own.zones.items()}


def _by_label(values: Mapping[tuple[str, ...], int]) -> dict[str, int]:
    return {" ".join(labels) or "all": count for labels, count in dict(values).items()}


def _ages(counter: Counter, now: float) -> dict[str, float]:
    """By label, how many seconds ago a counter was last raised."""
    return {" ".join(labels) or "all": round(now - last, 1) for labels, last in dict(counter.last).items()}
