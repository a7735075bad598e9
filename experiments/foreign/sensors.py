"""Sensors of the independent generator: compressible foam between two electrode layers, read out row by row.

Each pressure point loads a small square; a taxel's load is the exact area that the squares share with it
(box, no point spread). Foam of thickness 1 is squeezed by x and answers 1 / (1 - x) - 1; part of the
squeeze follows slowly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.foreign.hands import Array, Pad, Performance, Rng


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sheet with its electronics. Counts are before `scale`."""

    rows: int
    columns: int
    rate_hz: float
    pitch: float  # taxels of this grid per taxel of the 9 x 9 sheet that hands are described on
    shift: tuple[float, float]  # (x, y) taxels of this grid
    offset: Array  # (R, C) counts
    gain: Array  # (R, C)
    dead: NDArray[np.bool_]  # (R, C)
    stuck: NDArray[np.bool_]  # (R, C) flicker at a random level
    counts: float  # per unit of capacitance
    noise: float  # counts, white
    pink: float  # counts, 1/f
    drift: float  # counts a second
    hum: float  # counts
    hum_hz: float
    softness: float  # load at which the foam is squeezed half as far as it goes
    slow: float  # share of the squeeze that follows slowly
    creep_s: float
    recover_s: float
    cover: float  # taxels of the 9 x 9 sheet, how far the cloth on top carries a point's load sideways
    leak: float  # crosstalk to the four neighbours
    stripe: float  # crosstalk along rows and columns
    scan: float  # share of the frame's time that the read-out takes
    jitter: float  # s
    lost: float  # probability
    top: float  # counts at which the converter saturates
    scale: float | None  # None: uint16 counts; else float32, counts times this


def draw_sensor(rng: Rng, level: str, rows: int = 9, columns: int = 9, rate_hz: float = 15.0) -> Sensor:
    """A new sheet: `nominal` is a clean laboratory piece, `hard` a worn one in a vehicle."""
    hard = level == "hard"
    low, high = (8.0, 25.0) if hard else (40.0, 150.0)
    noise = float(rng.uniform(0.8, 4.0))
    snr = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    shape = (rows, columns)
    uneven = 0.22 if hard else 0.06
    gain = np.exp(rng.normal(0.0, uneven, shape) * 0.6)
    gain *= np.exp(rng.normal(0.0, uneven * 0.6, (rows, 1))) * np.exp(rng.normal(0.0, uneven * 0.6, (1, columns)))
    dead, stuck = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    if hard:
        spoiled = rng.choice(rows * columns, int(rng.integers(0, 4)), replace=False)
        for index in spoiled:
            (dead if rng.random() < 0.7 else stuck).flat[index] = True
    softness = float(rng.uniform(0.8, 2.5))
    pitch = min(rows, columns) / 9.0
    spare = np.array([columns, rows]) - 9.0 * pitch
    shift = spare * rng.uniform(0.0, 1.0, 2) + (pitch - 1) / 2
    usual = _answer(np.array(0.45 / (0.45 + softness)))  # what a usual press in the middle of a taxel gives
    pink = noise * float(rng.uniform(0.2, 0.6) if hard else rng.uniform(0.0, 0.2))
    hum = noise * float(rng.uniform(0.2, 0.9) if hard else rng.uniform(0.0, 0.2))
    amplitude = snr * float(np.sqrt(noise**2 + pink**2 + hum**2 / 2))
    return Sensor(
        rows=rows,
        columns=columns,
        rate_hz=rate_hz * float(rng.uniform(0.97, 1.03)),
        pitch=pitch,
        shift=(float(shift[0]), float(shift[1])),
        offset=rng.uniform(100.0, 600.0) + rng.normal(0.0, amplitude * 0.3, shape),
        gain=gain,
        dead=dead,
        stuck=stuck,
        counts=amplitude / float(usual),
        noise=noise,
        pink=pink,
        drift=amplitude * float(rng.uniform(-0.02, 0.02) if hard else rng.uniform(-0.001, 0.001)),
        hum=hum,
        hum_hz=float(rng.choice([50.0, 60.0]) + rng.normal(0.0, 0.05)),
        softness=softness,
        slow=float(rng.uniform(0.1, 0.35) if hard else rng.uniform(0.0, 0.12)),
        creep_s=float(rng.uniform(0.03, 0.2)),
        recover_s=float(rng.uniform(0.1, 0.5) if hard else rng.uniform(0.03, 0.12)),
        cover=float(rng.uniform(0.0, 0.6)),
        leak=float(rng.uniform(0.05, 0.14) if hard else rng.uniform(0.0, 0.03)),
        stripe=float(rng.uniform(0.01, 0.05) if hard else rng.uniform(0.0, 0.008)),
        scan=float(rng.uniform(0.3, 0.9)),
        jitter=(0.006 if hard else 0.0015) * 15.0 / rate_hz,
        lost=0.10 if hard else 0.003,
        top=float(600.0 + rng.uniform(0.9, 3.0) * amplitude if hard else 60000.0) + 400.0,
        scale=float(10.0 ** rng.uniform(-4, 1)) if rng.random() < 0.3 else None,
    )


def _answer(squeeze: Array) -> Array:
    """Capacitance over the idle one, less 1, of a foam squeezed by `squeeze` (0..1, 1 being 0.8 of it)."""
    return 1.0 / (1.0 - 0.8 * squeeze) - 1.0


def _share(at: Array, half: float, cells: Array) -> Array:
    """How much (0..1) of [at - half, at + half] lies in each cell [c - 0.5, c + 0.5]."""
    high = np.minimum(at + half, cells + 0.5)
    return np.maximum(high - np.maximum(at - half, cells - 0.5), 0.0) / (2 * half)


def _load(sensor: Sensor, pad: Pad, start: float, times: Array) -> tuple[slice, Array]:
    """The load of one pad, (n, R, C), for the frames in the slice; each row is read at its own time."""
    first = int(np.searchsorted(times, start + pad.t[0] - 1.0 / sensor.rate_hz))
    last = int(np.searchsorted(times, start + pad.t[-1] + 1.0 / sensor.rate_hz))
    rows, columns = np.arange(sensor.rows), np.arange(sensor.columns, dtype=np.float64)
    when = times[first:last, None] + sensor.scan / sensor.rate_hz * (rows / sensor.rows - 0.5) - start  # (n, R)
    force = np.interp(when, pad.t, pad.force, left=0.0, right=0.0) * sensor.pitch**2
    # A harder press makes a larger contact.
    grow = np.cbrt(np.clip(force / sensor.pitch**2, 0.2, 6.0))[..., None] if len(pad.points) < 25 else 1.0
    x = np.interp(when, pad.t, pad.x)[..., None] + grow * pad.points[:, 0]  # (n, R, P)
    y = np.interp(when, pad.t, pad.y)[..., None] + grow * pad.points[:, 1]
    x, y = x * sensor.pitch + sensor.shift[0], y * sensor.pitch + sensor.shift[1]
    half = (pad.half + sensor.cover) * sensor.pitch
    weight = pad.weights * _share(y, half, rows[:, None].astype(np.float64))  # (n, R, P)
    across = _share(x[..., None], half, columns)  # (n, R, P, C)
    return slice(first, last), force[..., None] * (weight[:, :, None, :] @ across)[:, :, 0, :]


def _pink(rng: Rng, count: int, cells: int) -> Array:
    """1/f noise of standard deviation about 1, (count, cells)."""
    spectrum = np.fft.rfft(rng.standard_normal((count, cells)), axis=0)
    k = np.arange(len(spectrum), dtype=np.float64)
    shape = 1.0 / np.sqrt(np.maximum(k, 1.0))
    spectrum *= shape[:, None] / np.sqrt(np.mean(shape**2))
    return np.fft.irfft(spectrum, count, axis=0)


def _times(sensor: Sensor, rng: Rng, length: float) -> Array:
    """Arrival times (s): jittered, some frames lost, strictly increasing."""
    times = np.arange(int(length * sensor.rate_hz) + 1) / sensor.rate_hz
    keep = rng.random(len(times)) >= sensor.lost
    times = times + rng.normal(0.0, sensor.jitter, len(times)).clip(-0.3 / sensor.rate_hz, 0.3 / sensor.rate_hz)
    return times[keep]


def _disturb(sensor: Sensor, rng: Rng, capacitance: Array, performed: Performance, start: float, times: Array) -> None:
    """Add an electrical burst to the counts."""
    size = sensor.counts * float(_answer(np.array(0.45 / (0.45 + sensor.softness))))
    for begin, length, where in performed.burst:
        hit = np.flatnonzero((times >= start + begin) & (times < start + begin + max(length, 1 / sensor.rate_hz)))
        pattern = rng.uniform(0.4, 1.2, (sensor.rows, sensor.columns))
        mask = np.zeros((sensor.rows, sensor.columns))
        if where == "all":
            mask[:] = 1.0
        elif where == "row":
            mask[rng.integers(sensor.rows, size=int(rng.integers(1, 4)))] = 1.0
        else:
            mask[:, rng.integers(sensor.columns, size=int(rng.integers(1, 4)))] = 1.0
        for frame in hit:
            sign = 1.0 if rng.random() < 0.7 else -1.0
            level = sign * size * rng.uniform(0.3, 1.2)
            capacitance[frame] += level * mask * (pattern + rng.normal(0.0, 0.2, pattern.shape))


def record(
    sensor: Sensor,
    rng: Rng,
    performances: Sequence[tuple[float, Performance]],
    length: float,
    warming: Callable[[Array], Array] | None = None,
) -> tuple[NDArray[np.uint16] | NDArray[np.float32], Array, Array]:
    """Record `length` seconds in which the performances begin at the given times.

    The sensor drifts by `drift` times `warming(times)`, or times the seconds themselves without `warming`. Returns
    frames (N, R, C), times (N,) in seconds, and what can be seen in each frame (N,): the strongest true signal of a
    working taxel, in units of all its noise together.
    """
    times = _times(sensor, rng, length)
    load = np.zeros((len(times), sensor.rows, sensor.columns))
    for start, performed in performances:
        for pad in performed.pads:
            where, part = _load(sensor, pad, start, times)
            load[where] += part
    squeeze = load / (load + sensor.softness)
    if sensor.slow > 0.0:
        state = np.zeros(squeeze.shape[1:])
        dt = np.diff(times, prepend=times[0] - 1 / sensor.rate_hz)
        up, down = -np.expm1(-dt / sensor.creep_s), -np.expm1(-dt / sensor.recover_s)
        late = np.empty_like(squeeze)
        for i, now in enumerate(squeeze):
            state = state + np.where(now > state, up[i], down[i]) * (now - state)
            late[i] = state
        squeeze = (1 - sensor.slow) * squeeze + sensor.slow * late
    signal = _answer(squeeze)
    if sensor.leak > 0.0:
        padded = np.pad(signal, ((0, 0), (1, 1), (1, 1)))
        near = padded[:, 2:, 1:-1] + padded[:, :-2, 1:-1] + padded[:, 1:-1, 2:] + padded[:, 1:-1, :-2]
        lines = signal.sum(axis=1, keepdims=True) + signal.sum(axis=2, keepdims=True)
        signal = signal + sensor.leak * near + sensor.stripe * lines
    counts = signal * sensor.gain * sensor.counts
    noise = np.sqrt(sensor.noise**2 + sensor.pink**2 + sensor.hum**2 / 2)
    seen = (counts * ~(sensor.dead | sensor.stuck)).max(axis=(1, 2)) / noise
    for start, performed in performances:
        if performed.burst:
            _disturb(sensor, rng, counts, performed, start, times)
    cells = sensor.rows * sensor.columns
    counts += sensor.offset
    counts += rng.normal(0.0, sensor.noise, counts.shape)
    if sensor.pink > 0.0:
        counts += sensor.pink * _pink(rng, len(times), cells).reshape(counts.shape)
    aged = times if warming is None else warming(times)
    counts += sensor.drift * aged[:, None, None] * rng.uniform(0.5, 1.5, counts.shape[1:])
    when = times[:, None] + sensor.scan / sensor.rate_hz * np.arange(sensor.rows) / sensor.rows
    wave = np.sin(2 * np.pi * sensor.hum_hz * when + rng.uniform(0, 2 * np.pi))[:, :, None]
    counts += sensor.hum * wave * rng.uniform(0.5, 1.5, sensor.columns)
    counts[:, sensor.dead] = sensor.offset[sensor.dead]
    if sensor.stuck.any():
        counts[:, sensor.stuck] = sensor.offset[sensor.stuck] + sensor.top / 3
    whole = np.clip(np.rint(counts), 0.0, min(sensor.top, 65535.0))
    if sensor.scale is None:
        return whole.astype(np.uint16), times, seen
    return (whole * sensor.scale).astype(np.float32), times, seen
