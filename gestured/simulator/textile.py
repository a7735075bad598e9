"""The response of a soft pressure matrix: viscoelastic lag, hysteresis, leakage between lines, compression.

Sources: the standard linear solid and its Prony series for relaxation; the play operator as the simplest Preisach
element for hysteresis; sneak paths in passive matrices for crosstalk and ghosts. Every lag steps by
`-expm1(-dt / tau)`, which is exact for an input held over dt, and stable for any dt / tau.
"""

import math
from collections.abc import Sequence

import numpy as np

from gestured.simulator.kinematics import Array

REMANENCE_S = 1.5  # time constant with which the rest of a touch (hysteresis) fades


def relax(field: Array, dt_s: float, amplitudes: Sequence[float], taus_s: Sequence[float], hysteresis: float) -> Array:
    """The lagging response (N, R, C) to a pressure field (N, R, C) with frames `dt_s` apart.

    Each branch follows the input with its own tau, and its amplitude is its share of the response; a negative one is an
    overshoot that relaxes. `hysteresis` is the width of the play operator in normal touches.
    """
    if not len(amplitudes) and hysteresis <= 0.0:
        return field
    lag = Lag(field.shape[1:], dt_s, amplitudes, taus_s, hysteresis)
    return np.stack([lag.answer(p) for p in field])


class Lag:
    """The lagging response of `relax`, frame by frame, for a grid of the given shape."""

    def __init__(
        self,
        shape: tuple[int, ...],
        dt_s: float,
        amplitudes: Sequence[float],
        taus_s: Sequence[float],
        hysteresis: float,
    ) -> None:
        self._share = np.asarray(amplitudes, dtype=np.float64)[:, None, None]
        self._step = -np.expm1(-dt_s / np.asarray(taus_s, dtype=np.float64))[:, None, None]
        self._fade = math.exp(-dt_s / REMANENCE_S)
        self._hysteresis = hysteresis
        self._direct = 1.0 - float(self._share.sum())
        self._state = np.zeros((len(amplitudes), *shape))
        self._play = np.zeros(shape)
        self._resting = True

    def answer(self, p: Array) -> Array:
        """The response (R, C) to the pressure (R, C) of the next frame.

        It is exactly 0 if nothing is pressed and earlier touches have decayed.
        """
        pressed = float(p.max()) > 0.0
        if self._resting and not pressed:
            return np.zeros_like(p)
        state, width = self._state, self._hysteresis
        state += self._step * (p - state)
        answer = self._direct * p + (self._share * state).sum(axis=0)
        if width > 0.0:
            self._play = np.minimum(np.maximum(self._play * self._fade, p - width), p + width)
            answer = 0.5 * (answer + self._play) + 0.5 * width * (p > 0.0) * np.minimum(p, 1.0)
        left = max(float(np.abs(state).max(initial=0.0)), float(np.abs(self._play).max()))
        self._resting = not pressed and left < 1e-5
        return np.asarray(answer)


def leak(field: Array, row: float, column: float, ghost: float) -> Array:
    """The field (N, R, C) with crosstalk: shares of each row's and column's sum, and ghosts at crossings of lines."""
    rows, columns = field.sum(axis=2, keepdims=True), field.sum(axis=1, keepdims=True)
    out = field + row * rows + column * columns
    if ghost > 0.0:
        out += ghost * rows * columns / np.maximum(field.sum(axis=(1, 2), keepdims=True), 1.0)
    return np.asarray(out)


def compress(field: Array, exponent: float, knee: float) -> Array:
    """Pressure to signal: u^n (1 + k) / (u^n + k), which is 1 at a normal touch.

    An exponent n > 1 weakens light touches, a small knee k saturates. Negative values, from relaxation, stay.
    """
    u = np.maximum(field, 0.0)
    if exponent != 1.0:
        u = u**exponent
    if math.isfinite(knee):
        u = u * (1.0 + knee) / (u + knee)
    return np.where(field < 0.0, field, u)


def tail_kernel(n: int, reach: float) -> Array:
    """A mixing matrix (n, n) with rows of sum 1 at most: an exponential tail of `reach` taxels along an axis."""
    k = np.exp(-np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / reach)
    return np.asarray(k / k[n // 2].sum())
