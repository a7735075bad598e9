"""The simulated sensor: from contacts in continuous time to integer frames as they arrive.

The pressure of contacts is sampled while the rows are scanned (three instants a row), and spread by the textile. The
field leaks along lines, lags, and is compressed. It gets each taxel's gain and offset, drift, noise, interference and
bad taxels, and is rounded. The radio then delays, loses and doubles frames. All strengths are relative to `gain`, the
counts of a normal touch.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gestured.simulator.kinematics import Array
from gestured.simulator.nature import Nature
from gestured.simulator.people import Performance, generator
from gestured.simulator.readout import amplify, digitise, disturb, transmit
from gestured.simulator.sampling import sample
from gestured.simulator.textile import compress, leak, relax


@dataclass(frozen=True, slots=True)
class Act:
    """One performance in a take as it really was, from its first to its last contact in s on the take's clock."""

    label: str
    kind: str
    onset_s: float
    offset_s: float
    speed: str
    inclination: int
    participant: int

    @classmethod
    def of(cls, one: Performance, start: float) -> "Act":
        """The act of a performance that began at `start` s."""
        return cls(one.label, one.kind, start, start + one.duration_s, one.speed, one.inclination, one.participant)


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """What a sensor sent, and what was really performed. N frames arrived, duplicates included."""

    frames: NDArray[np.generic]  # (N, R, C) integer raw counts, row 0 on top
    times: Array  # (N,) arrival in seconds, strictly increasing
    sensor_times: Array  # (N,) s, when each frame was sampled
    counter: NDArray[np.int64]  # (N,) the sensor's frame counter: a gap is a lost frame, a repeat a duplicate
    touches: NDArray[np.float32]  # (N, 3, 2) x right, y upward from the bottom-left taxel, in pitches; NaN for none
    touch_ids: NDArray[np.int32]  # (N, 3); -1 for none
    events: tuple[Act, ...]
    sensor: "SimulatedSensor"

    @property
    def label(self) -> str:
        """The label of the only event, or "session" if there are none or several."""
        return self.events[0].label if len(self.events) == 1 else "session"


@dataclass(frozen=True)
class SimulatedSensor(Nature):
    """A sensor of some nature, which records performances."""

    @staticmethod
    def nominal(day: int | None = None) -> "SimulatedSensor":
        """The textile of 9 x 9 taxels at 15 Hz; with `day`, the same sensor as it is on that day."""
        sensor = SimulatedSensor(seed=1)
        if day is None:
            return sensor
        rng = generator(day, 0xDA7)
        return replace(
            sensor,
            gain=sensor.gain * float(rng.lognormal(0.0, 0.1)),
            offset=sensor.offset * float(rng.uniform(0.8, 1.2)),
            noise=sensor.noise * float(rng.uniform(0.7, 1.6)),
            preload=float(rng.uniform(0.0, 0.05)),
            drift=float(rng.uniform(0.0, 0.08)),
            spread=sensor.spread * float(rng.uniform(0.85, 1.2)),
            row_crosstalk=float(rng.uniform(0.005, 0.02)),
            column_crosstalk=float(rng.uniform(0.005, 0.02)),
            hysteresis=float(rng.uniform(0.0, 0.03)),
            loss=float(rng.choice([0.0, 0.005])),
        )

    def record(
        self, performances: Sequence[tuple[float, Performance]], duration_s: float, rng: np.random.Generator
    ) -> Take:
        """What this sensor sends in `duration_s` seconds during performances, each with its start in s.

        A start may be negative, so that the pad is touched from the first frame on. Without performances the recording
        is idle.
        """
        todo = list(performances)
        dt = 1.0 / self.rate_hz
        times: Array = np.arange(1, max(1, int(duration_s * self.rate_hz)) + 1, dtype=np.float64) * dt
        field, fingers = sample(self, todo, times, rng)
        field = leak(field, self.row_crosstalk, self.column_crosstalk, self.ghost)
        field = compress(relax(field, dt, self.relaxation, self.taus_s, self.hysteresis), self.exponent, self.knee)
        signal = amplify(self, field, times, todo[0][1].inclination if todo else 1, rng)
        disturb(self, signal, times, [(start, a) for start, p in todo for a in p.artefacts], rng)
        frames = digitise(self, signal)
        order, arrival = transmit(self, times, rng)
        events = tuple(Act.of(performance, start) for start, performance in todo)
        touches, ids = fingers.touches[order], fingers.ids[order]
        return Take(frames[order], arrival, times[order], order, touches, ids, events, self)
