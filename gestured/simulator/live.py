"""A simulated sensor frame by frame, whose contacts are given while they happen."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gestured.simulator.people import Performance, Press, generator
from gestured.simulator.readout import amplify, digitise
from gestured.simulator.sampling import sample
from gestured.simulator.sensor import SimulatedSensor
from gestured.simulator.textile import Lag, compress, leak

NO_ACT = Performance("", "", (), 0.0, "normal", 1, 0)


class LiveTextile:
    """The textile and the electronics of a sensor, with their state from frame to frame.

    There is no drift, since drift is drawn for a whole recording at once.
    """

    def __init__(self, sensor: SimulatedSensor, seed: int) -> None:
        """`seed` is the seed of the noise."""
        self.sensor = replace(sensor, drift=0.0, touch_noise=math.nan)  # no finger reports: the caller has the contacts
        self._rng = generator(seed, 0x11FE)
        dt = 1.0 / sensor.rate_hz
        self._lag = Lag((sensor.rows, sensor.columns), dt, sensor.relaxation, sensor.taus_s, sensor.hysteresis)

    def frame(self, t: float, presses: Sequence[Press]) -> NDArray[np.generic]:
        """The (R, C) counts of the frame that ends at `t` s on the presses' clock; `t` must rise from call to call."""
        times, sensor = np.array([t]), self.sensor
        field, _ = sample(sensor, [(0.0, replace(NO_ACT, contacts=tuple(presses)))], times, self._rng)
        field = leak(field, sensor.row_crosstalk, sensor.column_crosstalk, sensor.ghost)
        field = compress(self._lag.answer(field[0])[None], sensor.exponent, sensor.knee)
        frame: NDArray[np.generic] = digitise(sensor, amplify(sensor, field, times, NO_ACT.inclination, self._rng))[0]
        return frame
