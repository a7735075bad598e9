"""How a soft pressure matrix answers: viscoelastic lag, hysteresis, leakage between lines, compression.

Sources: the standard linear solid and its Prony series for relaxation; the play operator as the simplest
Preisach element for hysteresis; sneak paths in passive matrices for crosstalk and ghosts. Every lag steps by
`-expm1(-dt / tau)`, which is exact for an input held over dt and stable for any dt / tau.
"""

import math
from collections.abc import Sequence

import numpy as np

from gestured.simulator.kinematics import Array

REMANENCE_S = 1.5  # after a touch, what hysteresis has left behind fades that fast


def relax(field: Array, dt_s: float, amplitudes: Sequence[float], taus_s: Sequence[float], hysteresis: float) -> Array:
    """The lagging answer (N, R, C) to a pressure field (N, R, C) with frames dt_s apart.

    Each branch follows the input with its own tau and makes up its amplitude of the answer; a negative
    amplitude is an overshoot that relaxes. `hysteresis` is the width of the play operator in units of a
    touch.
    """
    if not len(amplitudes) and hysteresis <= 0.0:
        return field
    share = np.asarray(amplitudes, dtype=np.float64)[:, None, None]
    step = -np.expm1(-dt_s / np.asarray(taus_s, dtype=np.float64))[:, None, None]
    fade = math.exp(-dt_s / REMANENCE_S)
    state = np.zeros((len(amplitudes), *field.shape[1:]))
    play = np.zeros(field.shape[1:])
    out = np.empty_like(field)
    direct = 1.0 - float(share.sum())
    # A frame in which nothing was pressed and everything has decayed answers with exactly nothing.
    pressed = field.max(axis=(1, 2)) > 0.0
    resting = True
    for k in range(field.shape[0]):
        p = field[k]
        if resting and not pressed[k]:
            out[k] = 0.0
            continue
        state += step * (p - state)
        answer = direct * p + (share * state).sum(axis=0)
        if hysteresis > 0.0:
            play = np.minimum(np.maximum(play * fade, p - hysteresis), p + hysteresis)
            answer = 0.5 * (answer + play) + 0.5 * hysteresis * (p > 0.0) * np.minimum(p, 1.0)
        out[k] = answer
        resting = not pressed[k] and float(np.abs(state).max(initial=0.0)) < 1e-5 and float(np.abs(play).max()) < 1e-5
    return out


def leak(field: Array, row: float, column: float, ghost: float) -> Array:
    """Crosstalk (N, R, C): a share of each row's and column's sum, and ghosts where touched lines cross."""
    rows, columns = field.sum(axis=2, keepdims=True), field.sum(axis=1, keepdims=True)
    out = field + row * rows + column * columns
    if ghost > 0.0:
        out += ghost * rows * columns / np.maximum(field.sum(axis=(1, 2), keepdims=True), 1.0)
    return np.asarray(out)


def compress(field: Array, exponent: float, knee: float) -> Array:
    """Pressure to signal: u^n (1 + k) / (u^n + k), which is 1 at a normal touch.

    n > 1 ignores light touches, a small k saturates. What relaxation made negative stays as it is.
    """
    u = np.maximum(field, 0.0)
    if exponent != 1.0:
        u = u**exponent
    if math.isfinite(knee):
        u = u * (1.0 + knee) / (u + knee)
    return np.where(field < 0.0, field, u)


def tail_kernel(n: int, reach: float) -> Array:
    """A mixing matrix (n, n), rows of sum 1 at most: an exponential tail of `reach` taxels along an axis."""
    k = np.exp(-np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / reach)
    return np.asarray(k / k[n // 2].sum())
