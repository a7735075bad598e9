"""The sampling of contacts in continuous time: the pressure field at the sensor's instants, and finger reports."""

import math

import numpy as np
from numpy.typing import NDArray

from gestured.simulator.kinematics import Array
from gestured.simulator.nature import Nature
from gestured.simulator.people import Performance, Press
from gestured.simulator.textile import tail_kernel

FINGER_MM = 3.7  # the size (one standard deviation) of the finger that a sensor's `gain` refers to
INSTANTS = 3  # instants per row and frame at which contacts are sampled
TRACKED_FORCE = 0.15  # lighter fingers are not reported


class Fingers:
    """Finger reports of N frames: `touches` (N, 3, 2) in pitches from the bottom-left taxel, `ids` (N, 3)."""

    def __init__(self, frames: int) -> None:
        self.touches: NDArray[np.float32] = np.full((frames, 3, 2), np.nan, dtype=np.float32)
        self.ids: NDArray[np.int32] = np.full((frames, 3), -1, dtype=np.int32)
        self._number = 0

    def track(self, contact: Press, at: Array, first: int, sensor: Nature, rng: np.random.Generator) -> None:
        """Report one finger at times `at` (s on its own clock), which are those of the frames from `first` on."""
        force = np.interp(at, contact.t, contact.force, left=0.0, right=0.0)
        error = rng.normal(0.0, sensor.touch_noise, (2, at.size))
        x = np.clip(np.interp(at, contact.t, contact.x) / sensor.pitch_mm - 0.5 + error[0], 0.0, sensor.columns - 1)
        y = np.clip(np.interp(at, contact.t, contact.y) / sensor.pitch_mm - 0.5 + error[1], 0.0, sensor.rows - 1)
        for k in np.flatnonzero(force > TRACKED_FORCE):
            free = np.flatnonzero(self.ids[first + k] < 0)
            if free.size:
                self.ids[first + k, free[0]] = self._number
                self.touches[first + k, free[0]] = x[k], y[k]
        self._number += 1


def sample(
    sensor: Nature, performances: list[tuple[float, Performance]], times: Array, rng: np.random.Generator
) -> tuple[Array, Fingers]:
    """The pressure (N, R, C) in normal touches of frames that end at `times` (N,), and the finger reports.

    Within a frame the rows are read one after the other; each is a mean over a few instants.
    """
    n, rows, columns, pitch = times.size, sensor.rows, sensor.columns, sensor.pitch_mm
    field = np.zeros((n, rows, columns))
    fingers = Fingers(n)
    taxel_x: Array = (np.arange(columns, dtype=np.float64) + 0.5) * pitch
    taxel_y: Array = (rows - 0.5 - np.arange(rows, dtype=np.float64)) * pitch
    dt = 1.0 / sensor.rate_hz
    turns = np.arange(rows) / rows * sensor.scan * dt
    instants = (np.arange(INSTANTS) + 0.5) / INSTANTS * max(1.0 - sensor.scan, 0.1) * dt
    for start, performance in performances:
        for contact in performance.contacts:
            first = int(np.searchsorted(times, start + contact.t[0]))
            last = min(int(np.searchsorted(times, start + contact.t[-1] + dt)) + 1, n)
            if first >= last:
                continue
            at = times[first:last, None, None] - dt - start + instants[:, None] + turns  # (F, S, R)
            field[first:last] += footprint(sensor, contact, at, taxel_x, taxel_y)
            if contact.finger and math.isfinite(sensor.touch_noise):
                fingers.track(contact, times[first:last] - start, first, sensor, rng)
    if sensor.tail > 0.0:  # three times as much spreads as is taken, so that a fingertip's peak keeps about its height
        down, across = tail_kernel(rows, sensor.tail_taxels), tail_kernel(columns, sensor.tail_taxels)
        field = (1.0 - sensor.tail) * field + 3.0 * sensor.tail * np.matmul(np.matmul(down, field), across.T)
    return field, fingers


def footprint(sensor: Nature, contact: Press, at: Array, taxel_x: Array, taxel_y: Array) -> Array:
    """The mean pressure (F, R, C) of one contact over the instants `at` (F, S, R): a turned super-Gaussian."""
    force = np.interp(at, contact.t, contact.force, left=0.0, right=0.0)
    x, y = np.interp(at, contact.t, contact.x), np.interp(at, contact.t, contact.y)
    swell = np.maximum(force, 1e-3) ** contact.growth
    # The textile spreads the pressure, and a taxel averages over its own area.
    blur = (sensor.spread * sensor.pitch_mm) ** 2 + sensor.pitch_mm**2 / 12.0
    a2, b2 = (contact.length * swell) ** 2 + blur, (contact.width * swell) ** 2 + blur
    reference = FINGER_MM**2 + blur
    # A finger spreads its force over its area; the pressure of anything else falls less with its area.
    weaker = np.sqrt(a2 * b2) if contact.finger else reference + 0.25 * np.sqrt(a2 * b2)
    height = force**sensor.force_exponent * reference / weaker
    dx, dy = taxel_x - x[..., None], (taxel_y - y)[..., None]
    c, s = math.cos(contact.angle), math.sin(contact.angle)
    q = (dx * c + dy * s) ** 2 / a2[..., None] + (dy * c - dx * s) ** 2 / b2[..., None]
    # Only a contact that is larger than the blur keeps a flat top.
    own = contact.length * contact.width
    flat = 1.0 + (contact.flatness - 1.0) * own / (own + blur)
    if abs(flat - 1.0) > 0.02:
        q = q**flat
    return np.asarray((height[..., None] * np.exp(-0.5 * q)).mean(axis=1))
