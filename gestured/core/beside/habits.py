"""Habits: what the contacts of one sensor say of how it was connected, such as inverted counts."""

import numpy as np
from numpy.typing import NDArray

from gestured.core.front_end import Cut, Found, FrontEnd, Opened, Void

Array = NDArray[np.float64]
Counts = NDArray[np.generic]

ENOUGH = 3  # the fewest contacts that must speak for a fault before it is reported
MOSTLY = 3  # so many times more contacts must speak for a fault than against it
PAUSE_S = 0.3  # counts that fall below the baseline again after so long belong to another contact
ALIKE = 0.3  # neighbours with a higher correlation are alike, since a fingertip covers more than one taxel
CLEARLY = 0.1  # the correlation must be so much higher with rows and columns exchanged than as they are


class Habits:
    """What the contacts of a sensor of R x C taxels (as sent) say of how it was connected."""

    def __init__(self, rows: int, columns: int) -> None:
        self._rows, self._columns = rows, columns
        self.clear()

    def clear(self) -> None:
        """Forget all contacts: the sensor is learned anew."""
        self.falls = self.rises = 0  # contacts in which counts fell below the baseline, and in which they rose
        self.exchanges = self.fits = 0  # contacts that look like one finger with R and C exchanged, and as they are
        self._fell = -np.inf  # s, the last frame whose counts fell below the baseline
        self._falling = False  # whether a contact in which counts fell is not over
        self._idle: Counts | None = None  # (R, C) the last frame without a contact
        self._strongest: tuple[float, Counts | None] = 0.0, None  # the contact's strongest frame: activity, and (R, C)

    @property
    def falling(self) -> bool:
        """Whether idle frames are needed to end a contact in which counts fell; not those of a square grid."""
        return self._falling and self._rows != self._columns

    @property
    def inverted(self) -> bool:
        """Whether counts fall when the sensor is touched."""
        return self.falls >= ENOUGH and self.falls >= MOSTLY * self.rises

    @property
    def exchanged(self) -> bool:
        """Whether rows and columns are exchanged."""
        return self.exchanges >= ENOUGH and self.exchanges >= MOSTLY * self.fits

    def hear(self, found: Found) -> None:
        """Take note of what a front end has found of a contact."""
        if isinstance(found, Opened):
            self.rises += 1
            self._strongest, self._falling = (0.0, None), False
        elif isinstance(found, Cut) or (isinstance(found, Void) and found.reason == "stuck"):
            self._compare()

    def see(self, front_end: FrontEnd) -> None:
        """Take note of the last frame of a front end. On a square grid only a frame with `Look.burst` matters."""
        shown, look = front_end.last_sent, front_end.look
        if shown is None or look is None:
            return
        if look.burst and (fallen := front_end.conditioner.fallen(look)) >= front_end.segmenter.on:
            if self.paused(look.t):
                self.falls += 1
                self._strongest = 0.0, None
            self._fell, self._falling = look.t, True
            self._press(shown, fallen)
        if front_end.segmenter.phase.pending:
            self._press(shown, look.activity)
        elif not front_end.touched and not look.shifted and self.paused(look.t):
            self._idle = shown

    def paused(self, t: float) -> bool:
        """Whether no contact in which counts fell goes on at `t` s. If such a contact is over now, it is compared."""
        if t - self._fell <= PAUSE_S:
            return False
        if self._falling:
            self._falling = False
            self._compare()
        return True

    def _press(self, values: Counts, activity: float) -> None:
        """Take a frame of a contact: (R, C) counts as sent."""
        if activity > self._strongest[0]:
            self._strongest = activity, values

    def _compare(self) -> None:
        """Compare the strongest frame of a contact that is over with an idle frame."""
        pressed = self._strongest[1]
        if self._rows == self._columns or self._idle is None or pressed is None:
            return
        change = np.subtract(pressed, self._idle, dtype=np.float64).reshape(-1)
        own, other = neighbours_alike(change, self._columns), neighbours_alike(change, self._rows)
        self.fits += own > ALIKE and own > other
        self.exchanges += other > ALIKE and other > own + CLEARLY


def neighbours_alike(change: Array, columns: int) -> float:
    """The correlation, -1 to 1, of vertical neighbours in an (N,) frame's `change`, if it had so many `columns`."""
    change = np.where(np.abs(change) >= ALIKE * np.abs(change).max(), change, 0.0)  # without the idle sensor's noise
    total = float(change @ change)
    return float(change[:-columns] @ change[columns:]) / total if total > 0 else 0.0
