"""Random sensors of any nature (domain randomisation), from which models learn to work on strange sensors."""

import math

import numpy as np

from gestured.simulator.sensor import SimulatedSensor

# Shares of the hardest sensors.
FAINT = 0.3  # touches are faint: 8 to 25 times the noise
LINE_BURSTS = 0.15  # interference hits whole rows or columns for a frame
LOSS_IN_STEP = 0.15  # frames are lost at regular distances


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    """A random number between low and high, log-uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _grid(rng: np.random.Generator, screen: bool) -> tuple[int, int]:
    """Rows and columns: mostly 9 x 9, else 5 to 32, at most twice as long as wide; of screens often 27 x 15."""
    if rng.random() < 0.7:
        return 9, 9
    if screen and rng.random() < 0.6:
        return 27, 15
    small = int(rng.integers(5, 21)) if rng.random() < 0.8 else int(rng.integers(20, 33))
    if rng.random() < 0.4:
        return small, small
    long = min(32, max(5, round(small * rng.uniform(1.0, 2.0))))
    return (long, small) if rng.random() < 0.6 else (small, long)


def _lags(rng: np.random.Generator, hard: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Amplitudes and time constants (s) of viscoelastic branches, of smoothing, and of a baseline that follows."""
    branches = int(rng.integers(0, 4))
    amplitudes = [float(a) for a in rng.uniform(-0.12, 0.3, branches) * (0.3 + 0.7 * hard)]
    taus = [_log(rng, 0.01, 4.0) for _ in amplitudes]
    if rng.random() < 0.2 * hard:
        # Firmware that averages over time.
        amplitudes = [0.25 * a for a in amplitudes]
        amplitudes.append(float(rng.uniform(0.3, 0.75)))
        taus.append(_log(rng, 0.02, 0.12))
    if rng.random() < 0.2 * hard:
        # Firmware whose baseline follows under the finger, so that a held touch fades and leaves a hollow.
        amplitudes.append(-float(rng.uniform(0.05, 0.4)))
        taus.append(_log(rng, 0.8, 5.0))
    return tuple(amplitudes), tuple(taus)


def any_sensor(rng: np.random.Generator, hardness: float) -> SimulatedSensor:
    """A random sensor: a fifth are like touchscreens (sharp blobs, no offset, 8 bits), the others are textiles.

    `hardness`, from 0 (clean) to 1 (as bad as possible), scales all disturbances.
    """
    hard = min(max(hardness, 0.0), 1.0)
    screen = rng.random() < 0.22
    rows, columns = _grid(rng, screen)
    # The shorter side measures 45 to 120 mm with any grid, since hands do not scale with taxels.
    pitch = _log(rng, 45.0, 120.0) / min(rows, columns)
    rate = 15.0 * float(rng.normal(1.0, 0.03)) if rng.random() < 0.75 else _log(rng, 10.0, 100.0)

    def trouble(probability: float) -> bool:
        return bool(rng.random() < probability * hard)

    gain = float(rng.uniform(90.0, 220.0)) if screen else _log(rng, 40.0, 30000.0)
    snr = _log(rng, 300.0 * (8.0 / 300.0) ** hard if hard > 0 else 299.0, 300.0)
    if trouble(FAINT):
        snr = _log(rng, 8.0, 25.0)  # a thin or thickly covered textile, on which touches barely stand out
    noise = 1.0 / snr
    lines = noise * float(rng.uniform(0.0, 0.8)) * hard
    relaxation, taus = _lags(rng, hard)
    offset = 0.0 if screen else float(rng.choice([0.0, 1.0])) * _log(rng, 0.05, 3.0)
    top = 255 if screen or gain < 90.0 else int(max(gain * rng.uniform(1.2, 8.0) * (1.0 + offset), 300.0))
    clipped = screen or bool(rng.random() < 0.15)
    return SimulatedSensor(
        seed=int(rng.integers(1 << 31)),
        rows=rows,
        columns=columns,
        pitch_mm=pitch,
        rate_hz=max(rate, 8.0),
        scan=float(rng.uniform(0.0, 0.95)),
        gain=gain if top > 255 or screen else min(gain, 200.0 / (1.0 + offset)),
        gain_spread=float(rng.uniform(0.0, 0.05 + 0.22 * hard)),
        force_exponent=float(rng.uniform(0.15, 0.5)) if screen else float(rng.uniform(0.35, 1.1)),
        exponent=float(rng.uniform(0.65, 1.4)),
        knee=_log(rng, 0.5, 30.0) if rng.random() < 0.7 else math.inf,
        offset=offset,
        offset_spread=offset * float(rng.uniform(0.0, 0.25)),
        preload=float(rng.uniform(0.0, 0.12)) * hard,
        noise=noise,
        row_noise=lines * float(rng.random()),
        column_noise=lines * float(rng.random()),
        common_noise=lines * float(rng.random()),
        slow_noise=noise * float(rng.uniform(0.0, 0.8)) if trouble(0.3) else 0.0,
        signal_noise=float(rng.uniform(0.0, 0.08)) * hard,
        hum=noise * float(rng.uniform(0.3, 1.5)) if trouble(0.25) else 0.0,
        drift=0.0 if clipped else float(rng.exponential(0.08)) * hard,
        spread=float(rng.uniform(0.05, 0.35)) if screen else float(rng.uniform(0.1, 0.6 + 0.8 * rng.random())),
        tail=float(rng.uniform(0.0, 0.14)) * hard * (0.3 if screen else 1.0),
        tail_taxels=float(rng.uniform(0.6, 2.0)),
        row_crosstalk=float(rng.uniform(-0.012, 0.04)) * hard,
        column_crosstalk=float(rng.uniform(-0.012, 0.04)) * hard,
        ghost=float(rng.uniform(0.0, 0.12)) * hard if rng.random() < 0.25 else 0.0,
        relaxation=relaxation,
        taus_s=taus,
        hysteresis=float(rng.uniform(0.0, 0.08)) * hard if rng.random() < 0.5 else 0.0,
        saturation=top,
        dtype="uint8" if top <= 255 else "uint16" if top < 65536 and rng.random() < 0.6 else "int32",
        clipped=clipped,
        dead_zone=float(rng.uniform(1.0, 4.0)) * noise if clipped and rng.random() < 0.4 else 0.0,
        dead=int(rng.integers(1, 4)) if trouble(0.25) else 0,
        stuck=int(rng.integers(1, 3)) if trouble(0.15) else 0,
        bursts_per_minute=float(rng.exponential(6.0)) if trouble(0.2) else 0.0,
        line_bursts_per_minute=float(rng.exponential(40.0)) if trouble(LINE_BURSTS) else 0.0,
        jitter_s=float(rng.uniform(0.0, 0.012)) * hard,
        loss=float(rng.exponential(0.03)) if trouble(0.4) else 0.0,
        loss_run=int(rng.integers(2, 7)),
        loss_every=int(rng.integers(4, 12)) if trouble(LOSS_IN_STEP) else 0,
        duplicates=float(rng.uniform(0.0, 0.03)) if trouble(0.2) else 0.0,
        late=float(rng.uniform(0.0, 0.04)) if trouble(0.25) else 0.0,
        touch_noise=float(rng.uniform(0.03, 0.3)) if rng.random() < 0.6 else math.nan,
    )
