"""The sensor: from contacts in continuous time to integer frames as they arrive.

Order of things: contacts are sampled while the rows are scanned (2 to 3 instants a row), spread by the textile, leak along lines, relax and hang
behind, are compressed, get each taxel's own gain and offset, drift, noise, interference, bad taxels, and are rounded. The radio then
delays, loses and doubles frames. All strengths are relative to `gain`, the counts of a normal touch.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .kinematics import Array, wander
from .people import Artefact, Contact, Performance, generator
from .textile import compress, leak, relax, tail_kernel

FINGER_MM = 3.7  # the finger that `gain` refers to


@dataclass(frozen=True, slots=True)
class Event:
    """What really happened in a take; times in seconds on the take's clock, first and last contact."""

    label: str
    kind: str
    onset_s: float
    offset_s: float
    speed: str
    inclination: int
    participant: int


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """What a sensor sent, and the truth. N frames arrived, duplicates included."""

    frames: NDArray[np.generic]  # (N, R, C) integer raw counts, row 0 on top
    times: Array  # (N,) arrival in seconds, strictly increasing
    sensor_times: Array  # (N,) when each frame was sampled
    counter: NDArray[np.int64]  # (N,) the sensor's frame counter: a gap is a lost frame, a repeat a duplicate
    touches: NDArray[np.float32]  # (N, 3, 2) x right, y upward from the bottom-left taxel, in pitches; NaN
    touch_ids: NDArray[np.int32]  # (N, 3), -1 for none
    events: tuple[Event, ...]
    sensor: "Sensor"

    @property
    def label(self) -> str:
        """The label of the one event, or "session" where there are none or several."""
        return self.events[0].label if len(self.events) == 1 else "session"

    @property
    def kind(self) -> str:
        """The kind of the one event, or "session"."""
        return self.events[0].kind if len(self.events) == 1 else "session"


@dataclass(frozen=True)
class Sensor:
    """One sensor's nature; `seed` fixes its taxels (gains, offsets, bad ones). Strengths are shares of `gain`."""

    seed: int = 0
    rows: int = 9
    columns: int = 9
    pitch_mm: float = 8.0
    rate_hz: float = 15.0
    scan: float = 0.6  # share of the frame's time in which the rows are read one after the other
    gain: float = 900.0  # counts of a normal touch
    gain_spread: float = 0.06
    force_exponent: float = 1.0  # a touchscreen hardly sees force (0.2), a pressure matrix does (1)
    exponent: float = 0.9
    knee: float = 3.0
    offset: float = 0.4
    offset_spread: float = 0.05
    preload: float = 0.02  # what stretching over another inclination adds
    noise: float = 0.012
    row_noise: float = 0.004
    column_noise: float = 0.004
    common_noise: float = 0.002
    drift: float = 0.03  # in a minute
    spread: float = 0.45  # taxels, Gaussian
    tail: float = 0.06  # share of a touch that reaches further
    tail_taxels: float = 1.0
    row_crosstalk: float = 0.012
    column_crosstalk: float = 0.01
    ghost: float = 0.0
    relaxation: tuple[float, ...] = (0.25, 0.08)
    taus_s: tuple[float, ...] = (0.03, 0.9)
    hysteresis: float = 0.012
    saturation: int = 4095
    dtype: str = "uint16"
    clipped: bool = False  # the firmware subtracts the baseline and sends no negatives
    dead: int = 0
    stuck: int = 0
    bursts_per_minute: float = 0.0
    jitter_s: float = 0.003
    loss: float = 0.0
    duplicates: float = 0.0
    late: float = 0.0
    touch_noise: float = 0.1  # taxels; NaN where the sensor reports no fingers

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of the pad in millimetres."""
        return self.columns * self.pitch_mm, self.rows * self.pitch_mm

    @staticmethod
    def nominal(day: int | None = None) -> "Sensor":
        """The 9 x 9 textile at 15 Hz; with a day, the same sensor a little different, as it is from day to day."""
        sensor = Sensor(seed=1)
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

    @staticmethod
    def wide(rng: np.random.Generator, hardness: float = 0.6) -> "Sensor":
        """Any sensor at all; `hardness` 0 (clean) .. 1 (as bad as it may get) scales all that disturbs."""
        from .variety import any_sensor

        return any_sensor(rng, hardness)

    def record(
        self, performances: Sequence[tuple[float, Performance]], duration_s: float, rng: np.random.Generator
    ) -> Take:
        """What this sensor sends in `duration_s` seconds while these performances start at these times."""
        n = max(1, int(duration_s * self.rate_hz))
        dt = 1.0 / self.rate_hz
        times = (np.arange(n) + 1) * dt
        field, touches, ids = self._sample(performances, times, rng)
        field = leak(field, self.row_crosstalk, self.column_crosstalk, self.ghost)
        field = compress(
            relax(field, dt, self.relaxation, self.taus_s, self.hysteresis), self.exponent, self.knee
        )
        inclination = performances[0][1].inclination if performances else 1
        counts = self._counts(field, times, inclination, rng)
        artefacts = [(start, a) for start, p in performances for a in p.artefacts]
        self._disturb(counts, times, artefacts, rng)
        frames = self._digitise(counts, rng)
        order, arrival = self._radio(times, rng)
        events = tuple(
            Event(p.label, p.kind, start, start + p.duration_s, p.speed, p.inclination, p.participant)
            for start, p in performances
        )
        return Take(
            frames[order],
            arrival,
            times[order],
            order.astype(np.int64),
            touches[order],
            ids[order],
            events,
            self,
        )

    def _sample(
        self, performances: Sequence[tuple[float, Performance]], times: Array, rng: np.random.Generator
    ) -> tuple[Array, NDArray[np.float32], NDArray[np.int32]]:
        """Pressure field (N, R, C) in touches, and the fingers as a tracking sensor reports them."""
        n, rows, columns, pitch = times.size, self.rows, self.columns, self.pitch_mm
        field = np.zeros((n, rows, columns))
        touches = np.full((n, 3, 2), np.nan, dtype=np.float32)
        ids = np.full((n, 3), -1, dtype=np.int32)
        taxel_x = (np.arange(columns) + 0.5) * pitch
        taxel_y = (rows - 0.5 - np.arange(rows)) * pitch
        dt = 1.0 / self.rate_hz
        order = np.arange(rows) / rows * self.scan * dt
        instants = (np.arange(3) + 0.5) / 3 * max(1.0 - self.scan, 0.1) * dt
        number = 0
        for start, performance in performances:
            for contact in performance.contacts:
                first = int(np.searchsorted(times, start + contact.t[0]))
                last = min(int(np.searchsorted(times, start + contact.t[-1] + dt)) + 1, n)
                if first >= last:
                    continue
                # (frames, instants, rows): a frame ends at its time, its rows are read one after the other before that.
                at = times[first:last, None, None] - dt - start + instants[:, None] + order
                field[first:last] += self._footprint(contact, at, taxel_x, taxel_y)
                if contact.finger and math.isfinite(self.touch_noise):
                    self._track(contact, times[first:last] - start, first, number, touches, ids, rng)
                    number += 1
        if self.tail > 0.0:
            far = np.matmul(
                np.matmul(tail_kernel(rows, self.tail_taxels), field),
                tail_kernel(columns, self.tail_taxels).T,
            )
            field = (1.0 - self.tail) * field + self.tail * 3.0 * far
        return field, touches, ids

    def _footprint(self, contact: Contact, at: Array, taxel_x: Array, taxel_y: Array) -> Array:
        """Mean pressure (F, R, C) of one contact over the instants `at` (F, S, R)."""
        force = np.interp(at, contact.t, contact.force, left=0.0, right=0.0)
        x, y = np.interp(at, contact.t, contact.x), np.interp(at, contact.t, contact.y)
        swell = np.maximum(force, 1e-3) ** contact.growth
        # The textile spreads, and a taxel averages over its own area.
        blur = (self.spread * self.pitch_mm) ** 2 + self.pitch_mm**2 / 12.0
        a2, b2 = (contact.length * swell) ** 2 + blur, (contact.width * swell) ** 2 + blur
        reference = FINGER_MM**2 + blur
        if contact.finger:
            height = force**self.force_exponent * reference / np.sqrt(a2 * b2)
        else:
            height = force**self.force_exponent * reference / (reference + 0.25 * np.sqrt(a2 * b2))
        dx, dy = taxel_x - x[..., None], (taxel_y - y)[..., None]
        c, s = math.cos(contact.angle), math.sin(contact.angle)
        q = (dx * c + dy * s) ** 2 / a2[..., None] + (dy * c - dx * s) ** 2 / b2[..., None]
        # Only what is larger than the blur can keep a flat top.
        own = contact.length * contact.width
        flat = 1.0 + (contact.flatness - 1.0) * own / (own + blur)
        if abs(flat - 1.0) > 0.02:
            q = q**flat
        return np.asarray((height[..., None] * np.exp(-0.5 * q)).mean(axis=1))

    def _track(
        self,
        contact: Contact,
        at: Array,
        first: int,
        number: int,
        touches: NDArray[np.float32],
        ids: NDArray[np.int32],
        rng: np.random.Generator,
    ) -> None:
        """Writes one finger's positions into the first free slot of each frame in which it presses enough."""
        force = np.interp(at, contact.t, contact.force, left=0.0, right=0.0)
        x = (
            np.interp(at, contact.t, contact.x) / self.pitch_mm
            - 0.5
            + rng.normal(0.0, self.touch_noise, at.size)
        )
        y = (
            np.interp(at, contact.t, contact.y) / self.pitch_mm
            - 0.5
            + rng.normal(0.0, self.touch_noise, at.size)
        )
        for k in np.flatnonzero(force > 0.15):
            free = np.flatnonzero(ids[first + k] < 0)
            if free.size:
                ids[first + k, free[0]] = number
                touches[first + k, free[0]] = (
                    min(max(x[k], 0.0), self.columns - 1.0),
                    min(max(y[k], 0.0), self.rows - 1.0),
                )

    def _counts(self, field: Array, times: Array, inclination: int, rng: np.random.Generator) -> Array:
        """Signal (N, R, C) in counts with this sensor's gains, offsets, drift and noise."""
        own = generator(self.seed, 0x5E5)
        rows, columns, n = self.rows, self.columns, times.size
        gain = np.exp(self.gain_spread * own.standard_normal((rows, columns)))
        offset = self.offset + self.offset_spread * own.standard_normal((rows, columns))
        u, v = np.linspace(-1.0, 1.0, columns), np.linspace(-1.0, 1.0, rows)[:, None]
        for pose in range(3):
            g = own.normal(0.0, 1.0, 4)
            if pose == inclination:
                offset = offset + self.preload * (g[0] + g[1] * u + g[2] * v + g[3] * u * v)
        out = field * gain
        if self.drift > 0.0:
            pattern = (
                1.0
                + 0.4 * rng.normal() * u
                + 0.4 * rng.normal() * v
                + 0.3 * rng.standard_normal((rows, columns))
            )
            way = wander(times, rng, 0.002, 0.05, 3)
            out += (self.drift * (way - way[0]))[:, None, None] * pattern
        out += self.noise * rng.standard_normal(out.shape)
        out += self.row_noise * rng.standard_normal((n, rows, 1)) + self.column_noise * rng.standard_normal(
            (n, 1, columns)
        )
        out += self.common_noise * rng.standard_normal((n, 1, 1))
        if not self.clipped:
            out += offset
        return out

    def _disturb(
        self,
        counts: Array,
        times: Array,
        artefacts: Sequence[tuple[float, Artefact]],
        rng: np.random.Generator,
    ) -> None:
        """Adds interference in place: what was performed, and this sensor's own bursts."""
        todo = list(artefacts)
        for start in rng.uniform(0.0, times[-1], int(rng.poisson(self.bursts_per_minute * times[-1] / 60.0))):
            form = str(rng.choice(["all", "row", "column", "taxel", "taxels"]))
            todo.append(
                (
                    float(start),
                    Artefact(0.0, float(rng.uniform(0.01, 0.15)), form, float(rng.normal(0.0, 0.4))),
                )
            )
        dt = 1.0 / self.rate_hz
        _, rows, columns = counts.shape
        for start, a in todo:
            first = int(np.searchsorted(times, start + a.start))
            last = max(int(np.searchsorted(times, start + a.stop + dt * rng.random())), first + 1)
            n = max(min(last, times.size) - first, 0)
            height = a.height * (1.0 - a.flicker + a.flicker * rng.normal(0.0, 1.0, (n, 1, 1)))
            mask = np.zeros((rows, columns))
            r, c = int(rng.integers(rows)), int(rng.integers(columns))
            if a.form == "all":
                mask += rng.uniform(0.4, 1.0, (rows, columns))
            elif a.form == "row":
                mask[r] = rng.uniform(0.6, 1.0, columns)
            elif a.form == "column":
                mask[:, c] = rng.uniform(0.6, 1.0, rows)
            elif a.form == "block":
                mask[r : r + 1 + rows // 3, c : c + 1 + columns // 3] = 1.0
            elif a.form == "taxel":
                mask[r, c] = 1.0
            else:
                mask[rng.random((rows, columns)) < 0.15] = 1.0
            counts[first : first + n] += height * mask

    def _digitise(self, counts: Array, rng: np.random.Generator) -> NDArray[np.generic]:
        """Integer frames (N, R, C): scaled, bad taxels put in, rounded, clipped."""
        own = generator(self.seed, 0xBAD)
        cells = own.permutation(self.rows * self.columns)
        out = np.rint(counts * self.gain)
        flat = out.reshape(out.shape[0], -1)
        base = 0.0 if self.clipped else self.offset * self.gain
        dead, stuck = cells[: self.dead], cells[self.dead : self.dead + self.stuck]
        flat[:, dead] = np.rint(base * own.uniform(0.0, 1.0, dead.size))
        flat[:, stuck] = np.rint(
            own.choice([0.3, 1.0, 1.0], stuck.size) * min(self.saturation, base + 2.0 * self.gain)
        )
        info = np.iinfo(self.dtype)
        low = 0 if self.clipped else max(info.min, -self.saturation)
        return np.clip(out, low, min(self.saturation, info.max)).astype(self.dtype)

    def _radio(self, times: Array, rng: np.random.Generator) -> tuple[NDArray[np.intp], Array]:
        """Which frames arrive (with repeats), and when: in order, strictly later one after the other."""
        n = times.size
        keep = rng.random(n) >= self.loss
        for k in np.flatnonzero(rng.random(n) < self.loss / 4.0):
            keep[k : k + int(rng.integers(2, 5))] = False
        if not keep.any():
            keep[0] = True
        copies = np.where(rng.random(n) < self.duplicates, 2, 1) * keep
        delay = rng.gamma(2.0, max(self.jitter_s, 1e-6) / 2.0, n)
        delay += np.where(rng.random(n) < self.late, rng.uniform(0.5, 3.5, n) / self.rate_hz, 0.0)
        order = np.repeat(np.arange(n), copies)
        arrival = (times + delay)[order]
        # In order; frames that waited for a late one come out together, a fifth of a millisecond apart.
        gap = 2e-4 * np.arange(order.size)
        return order, np.maximum.accumulate(arrival - gap) + gap
