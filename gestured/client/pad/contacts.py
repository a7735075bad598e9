"""The contacts of a pad, made from the samples that a browser sends, on our own clock."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from gestured.core.frames import Touch
from gestured.simulator import SimulatedSensor
from gestured.simulator.people import Press
from gestured.simulator.sampling import FINGER_MM

MOST = 10  # contacts at a time
KEPT_S = 1.0  # how old samples may be, and how long they are kept
SAMPLES = 1000  # of a contact that are kept at most
ENDED = 4 * MOST  # the most contacts that have ended within KEPT_S and are kept
APART_S = 1e-4  # between two samples of a contact, at least
SILENT_S = 2.0  # a browser sends what still touches ten times a second; after so long without a message, nothing does
FORCE = (0.3, 2.0)  # the least and the most of a contact; a browser's pressure of 0.5 is the force 1 of a normal finger
WIDE = 3.0  # a contact is as wide as so many standard deviations of its footprint
FOOTPRINT_MM = (2.2, 7.0)  # standard deviations of a footprint: the thinnest and the widest finger's

Sample = tuple[float, float, float, float]  # s; mm from the left, mm from the bottom; force


@dataclass(slots=True)
class _Contact:
    number: int  # counts the pad's contacts
    size: float = FINGER_MM  # mm, standard deviation of the footprint
    samples: deque[Sample] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    down: bool = True


class Contacts:
    """The contacts of one pad. Times are seconds on the clock of `now`, which may be any clock that never goes back."""

    def __init__(self, sensor: SimulatedSensor) -> None:
        self._sensor = sensor
        self._contacts: dict[int, _Contact] = {}  # by the browser's number
        self._ended: list[_Contact] = []
        self._number = 0
        self._behind = math.inf  # s, from the browser's clock to ours, by the fastest message so far
        self._heard = -math.inf

    @property
    def down(self) -> bool:
        """Whether anything touches the pad."""
        return bool(self._contacts)

    def take(self, sent: float, samples: Iterable[object], now: float) -> None:
        """Take samples that a browser sent at `sent` s of its clock. Raises ValueError for what is no sample.

        Each is its contact's number, s of the browser's clock, x and y (0..1 from the bottom-left corner), pressure
        (0: it has left) and width (shares of the pad's width; 0 is not known).
        """
        read = [_numbers(sample) for sample in samples]
        if not math.isfinite(sent):
            raise ValueError(f"sent: expected seconds, found {sent}")
        if not self._contacts and now - sent - self._behind > KEPT_S / 2:
            self._behind = math.inf  # a clock stood still, as in a machine that slept
        self._behind = min(self._behind, now - sent)
        self._heard = now
        for name, t, *what in read:
            self._touch(int(name), min(max(t + self._behind, now - KEPT_S), now), what)

    def lift(self) -> None:
        """End all contacts where they are."""
        for contact in self._contacts.values():
            contact.down = False
        self._ended += self._contacts.values()
        self._contacts.clear()

    def presses(self, t: float, now: float) -> tuple[list[Press], tuple[Touch, ...]]:
        """The contacts of the frame that ends at `t` s, and its fingers. Call it with times that increase."""
        if now - self._heard > SILENT_S:
            self.lift()
        dt, pitch = 1.0 / self._sensor.rate_hz, self._sensor.pitch_mm
        self._ended = [contact for contact in self._ended[-ENDED:] if contact.samples[-1][0] > t - dt - KEPT_S]
        presses, touches = [], []
        for contact in [*self._ended, *self._contacts.values()]:
            samples = contact.samples
            while len(samples) > 2 and samples[1][0] < t - 2 * dt:
                samples.popleft()
            held = (max(t, samples[-1][0]) + APART_S, *samples[-1][1:]) if contact.down else None
            times, x, y, force = np.array([*samples, *([held] if held else [])]).T
            presses.append(Press(times, x, y, force, contact.size, contact.size))
            if times[0] <= t <= times[-1]:
                ways = ((x, self._sensor.columns), (y, self._sensor.rows))
                place = (min(max(float(np.interp(t, times, way)) / pitch - 0.5, 0.0), n - 1.0) for way, n in ways)
                touches.append(Touch(contact.number, *place))
        return presses, tuple(touches)

    def _touch(self, name: int, t: float, what: list[float]) -> None:
        x, y, pressure, width = what
        contact = self._contacts.get(name)
        if pressure <= 0.0:
            if contact is not None:
                contact.samples.append((max(t, contact.samples[-1][0] + APART_S), *contact.samples[-1][1:]))
                contact.down = False
                self._ended.append(self._contacts.pop(name))
            return
        if contact is None:
            if len(self._contacts) >= MOST:
                return
            contact = self._contacts[name] = _Contact(self._number)
            self._number += 1
        wide, high = self._sensor.extent
        if width > 0.0:
            contact.size = min(max(width * wide / WIDE, FOOTPRINT_MM[0]), FOOTPRINT_MM[1])
        force = min(max(2.0 * pressure, FORCE[0]), FORCE[1])
        last = contact.samples[-1][0] + APART_S if contact.samples else t
        contact.samples.append((max(t, last), min(max(x, 0.0), 1.0) * wide, min(max(y, 0.0), 1.0) * high, force))


def _numbers(sample: object) -> list[float]:
    if isinstance(sample, list) and len(sample) == 6 and all(type(n) in (int, float) for n in sample):
        numbers = [float(n) for n in sample]  # an integer of too many digits is an OverflowError
        if all(map(math.isfinite, numbers)) and abs(numbers[0]) < 1 << 53:
            return numbers
    raise ValueError("samples: expected lists of six numbers: contact, s, x, y, pressure, width")
