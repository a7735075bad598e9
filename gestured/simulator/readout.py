"""The electronics: gains, offsets, drift, noise, interference, bad taxels, rounding, and the radio link."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gestured.simulator.kinematics import Array, wander
from gestured.simulator.nature import Nature
from gestured.simulator.people import Artefact, generator


def amplify(sensor: Nature, field: Array, times: Array, inclination: int, rng: np.random.Generator) -> Array:
    """The signal (N, R, C) in normal touches: the field with this sensor's gains, offsets, drift and noise."""
    own = generator(sensor.seed, 0x5E5)
    rows, columns, n = sensor.rows, sensor.columns, times.size
    # Lines differ in length and contacts, and taxels differ, too.
    lines = 0.5 * own.standard_normal((rows, 1)) + 0.5 * own.standard_normal((1, columns))
    gain = np.exp(sensor.gain_spread * (0.7 * own.standard_normal((rows, columns)) + lines))
    offset = sensor.offset + sensor.offset_spread * own.standard_normal((rows, columns))
    u, v = np.linspace(-1.0, 1.0, columns), np.linspace(-1.0, 1.0, rows)[:, None]
    for pose, g in enumerate(own.normal(0.0, 1.0, (3, 4))):
        if pose == inclination:
            offset = offset + sensor.preload * (g[0] + g[1] * u + g[2] * v + g[3] * u * v)
    out = field * gain
    if sensor.signal_noise > 0.0:
        out += sensor.signal_noise * out * rng.standard_normal(out.shape)
    if sensor.drift > 0.0:
        pattern = 1.0 + 0.3 * rng.standard_normal((rows, columns)) + 0.4 * (rng.normal() * u + rng.normal() * v)
        way = wander(times, rng, 0.002, 0.05, 3)
        out += (sensor.drift * (way - way[0]))[:, None, None] * pattern
    out += sensor.noise * rng.standard_normal(out.shape)
    out += sensor.row_noise * rng.standard_normal((n, rows, 1))
    out += sensor.column_noise * rng.standard_normal((n, 1, columns))
    out += sensor.common_noise * rng.standard_normal((n, 1, 1))
    if sensor.slow_noise > 0.0:
        # A moving average over eight frames: noise that a mean over a few frames does not reduce.
        walk = np.cumsum(rng.standard_normal((n + 8, rows, columns)), axis=0)
        out += sensor.slow_noise / math.sqrt(8.0) * (walk[8:] - walk[:-8])
    if sensor.hum > 0.0:
        # The mains beats with the scan: a wave over time, shifted from row to row.
        phase = 2.0 * math.pi * (rng.uniform(0.1, 7.0) * times[:, None] + rng.uniform(0.0, 1.0) * np.arange(rows))
        out += (sensor.hum * np.sin(phase))[:, :, None]
    return out if sensor.clipped else out + offset


def disturb(
    sensor: Nature,
    signal: Array,
    times: Array,
    artefacts: Sequence[tuple[float, Artefact]],
    rng: np.random.Generator,
) -> None:
    """Add interference to the signal in place: the artefacts with their starts (s), and the sensor's own bursts."""
    todo, dt, end = list(artefacts), 1.0 / sensor.rate_hz, float(times[-1])
    for start in rng.uniform(0.0, end, int(rng.poisson(sensor.bursts_per_minute * end / 60.0))):
        form = str(rng.choice(["all", "row", "column", "taxel", "taxels"]))
        todo.append((float(start), Artefact(0.0, float(rng.uniform(0.01, 0.15)), form, float(rng.normal(0.0, 0.4)))))
    if sensor.line_bursts_per_minute > 0.0:
        for start in rng.uniform(0.0, end, int(rng.poisson(sensor.line_bursts_per_minute * end / 60.0))):
            form = str(rng.choice(["row", "column"]))
            todo.append((float(start), Artefact(0.0, 1e-3, form, float(rng.normal(0.0, 0.6)))))
    for start, artefact in todo:
        first = int(np.searchsorted(times, start + artefact.start))
        last = max(int(np.searchsorted(times, start + artefact.stop + dt * rng.random())), first + 1)
        n = max(min(last, times.size) - first, 0)
        flicker = artefact.flicker * rng.normal(0.0, 1.0, (n, 1, 1))
        signal[first : first + n] += (
            artefact.height * (1.0 - artefact.flicker + flicker) * _mask(artefact.form, signal, rng)
        )


def _mask(form: str, signal: Array, rng: np.random.Generator) -> Array:
    """How much an artefact of that form hits each taxel: (R, C), 0..1."""
    _, rows, columns = signal.shape
    mask = np.zeros((rows, columns))
    r, c = int(rng.integers(rows)), int(rng.integers(columns))
    if form == "all":
        mask += rng.uniform(0.4, 1.0, (rows, columns))
    elif form == "row":
        mask[r] = rng.uniform(0.6, 1.0, columns)
    elif form == "column":
        mask[:, c] = rng.uniform(0.6, 1.0, rows)
    elif form == "block":
        mask[r : r + 1 + rows // 3, c : c + 1 + columns // 3] = 1.0
    elif form == "taxel":
        mask[r, c] = 1.0
    else:
        mask[rng.random((rows, columns)) < 0.15] = 1.0
    return mask


def digitise(sensor: Nature, signal: Array) -> NDArray[np.generic]:
    """Integer frames (N, R, C): the signal scaled, with bad taxels, rounded and clipped."""
    own = generator(sensor.seed, 0xBAD)
    cells = own.permutation(sensor.rows * sensor.columns)
    out = np.rint(signal * sensor.gain)
    if sensor.dead_zone > 0.0:
        out[out < sensor.dead_zone * sensor.gain] = 0.0
    flat = out.reshape(out.shape[0], -1)
    base = 0.0 if sensor.clipped else sensor.offset * sensor.gain
    dead, stuck = cells[: sensor.dead], cells[sensor.dead : sensor.dead + sensor.stuck]
    flat[:, dead] = np.rint(base * own.uniform(0.0, 1.0, dead.size))
    high = min(float(sensor.saturation), base + 2.0 * sensor.gain)
    flat[:, stuck] = np.rint(own.choice([0.3, 1.0, 1.0], stuck.size) * high)
    info = np.iinfo(sensor.dtype)
    low = 0 if sensor.clipped else max(info.min, -sensor.saturation)
    return np.clip(out, low, min(sensor.saturation, info.max)).astype(sensor.dtype)


def transmit(sensor: Nature, times: Array, rng: np.random.Generator) -> tuple[NDArray[np.int64], Array]:
    """The indices of the frames that arrive (a repeated one is a duplicate), and their strictly increasing times."""
    n = times.size
    keep = rng.random(n) >= sensor.loss
    for k in np.flatnonzero(rng.random(n) < sensor.loss / 4.0):
        keep[k : k + int(rng.integers(2, sensor.loss_run + 1))] = False
    if sensor.loss_every > 0:
        keep[int(rng.integers(sensor.loss_every)) :: sensor.loss_every] = False
    if not keep.any():
        keep[0] = True
    copies = np.where(rng.random(n) < sensor.duplicates, 2, 1) * keep
    delay = rng.gamma(2.0, max(sensor.jitter_s, 1e-6) / 2.0, n)
    delay += np.where(rng.random(n) < sensor.late, rng.uniform(0.5, 3.5, n) / sensor.rate_hz, 0.0)
    order = np.repeat(np.arange(n, dtype=np.int64), copies)
    # Frames that waited for a late one come out together, a fifth of a millisecond apart.
    gap = 2e-4 * np.arange(order.size)
    return order, np.maximum.accumulate((times + delay)[order] - gap) + gap
