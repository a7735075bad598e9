"""A contact: when it was, where its centroid went, and what it leaves behind."""

import math

Centroid = tuple[float, float]  # (row, column) in taxel pitches

RESTS = 0.5  # taxel pitches: a shorter way has no direction, and a finger that goes no further rests
ON_SHARE = 0.20  # of a contact's peak: its frames above this share are strong, and a new contact must exceed it
RECOVERY_S = 1.0  # time constant of the after-effect, during which the baseline also follows faster
AFTER_S = 8.0  # after so long nothing is left of a contact: even a firm finger's after-effect is below the noise
SPIKE = 4.0  # times the second highest frame: a peak in a single frame counts as at most this
FIRM = 8.0  # times `on`: a contact's second highest frame counts as at least this, since a tap may have a single frame


class Stretch:
    """When one contact was touched, and where its centroid went."""

    __slots__ = ("_box", "began", "touched", "widest")

    def __init__(self, began: float) -> None:
        self.began = began  # s
        self.touched = began  # s, the last touched frame
        self.widest = 0.0  # taxel pitches, the diagonal of the box that holds the way of its centroid
        self._box: tuple[float, float, float, float] | None = None  # top, left, bottom, right

    def follow(self, place: Centroid) -> None:
        """The contact's centroid is at `place` now."""
        row, column = place
        top, left, bottom, right = self._box or (row, column, row, column)
        top, left, bottom, right = min(top, row), min(left, column), max(bottom, row), max(right, column)
        self._box = (top, left, bottom, right)
        self.widest = max(self.widest, math.hypot(bottom - top, right - left))


class AfterEffect:
    """What contacts leave behind: textile comes back slowly, or swings below its baseline.

    `on` is the activity from which there is a contact, in noise units.
    """

    def __init__(self, on: float) -> None:
        self._on = on
        self.clear()

    def clear(self) -> None:
        """Begin anew, as if there had been no contact."""
        self.peak = 0.0  # noise units, the highest activity of the contact that goes on, or of the last one
        self._next = 0.0  # noise units, the activity of that contact's second highest frame
        self._over = -math.inf  # s, the first frame after that contact; infinite while the contact goes on

    def begin(self) -> None:
        """A contact has begun."""
        self.peak = self._next = 0.0
        self._over = math.inf

    def touch(self, activity: float) -> None:
        """Take a frame of the contact, with its activity in noise units."""
        self._next = max(self._next, min(self.peak, activity))
        self.peak = max(self.peak, activity)

    def fade(self, t: float) -> None:
        """A frame at `t` s belongs to no contact. From the first such frame on, the after-effect fades."""
        if self._over == math.inf:
            self._over = t

    def leave(self, activity: float, t: float) -> None:
        """What had rested on the sensor, with that activity in noise units, has left at `t` s."""
        self.begin()
        self.peak = self._next = activity
        self._over = t

    def recovering(self, t: float) -> bool:
        """Whether a contact has ended so shortly before `t` s that the sensor shows its after-effect."""
        return t - self._over < RECOVERY_S

    def level(self, t: float) -> float:
        """The activity in noise units that a contact may have left behind at `t` s.

        A single frame far above all others is a fault of the readout and leaves nothing behind. Its full peak counts
        for RECOVERY_S all the same, so that the rest of its contact is not taken for a new one.
        """
        past = max(t - self._over, 0.0)
        if past > AFTER_S:
            return 0.0
        peak = self.peak
        if past > RECOVERY_S:
            peak = min(peak, SPIKE * max(self._next, FIRM * self._on))
        return ON_SHARE * peak * math.exp(-past / RECOVERY_S)
