"""What the idle sensor shows: learned from a second in which nothing moved, then followed while it is idle."""

import math

import numpy as np
from numpy.typing import NDArray

from gestured.core.settling import Learned, Settling

Array = NDArray[np.float64]

BASELINE_TAU_S = 2.0  # time constant of the idle sensor: drift of hours and warmth of minutes are followed
RECOVERY_TAU_S = 0.4  # time constant just after a contact: textile comes back slowly, and that is no touch


class Baseline:
    """The counts of one idle sensor. It stands still under a contact: a tracker that went on would erase the hand."""

    def __init__(self, taxels: int) -> None:
        self.counts: Array = np.zeros(taxels)  # replaced, never changed in place
        self.known = False
        self.provisional = False  # it is doubtful, and the next stable second replaces it
        self._settling = Settling()
        self._followed: float | None = None  # s, the last idle frame; None after a contact or a silence

    def settle(self, t: float, raw: Array) -> Learned | None:
        """Offer (N,) counts that may be idle; what was learned, if a stable second ends here."""
        learned = self._settling.push(t, raw, patience=not self.known)
        if learned is not None:
            self.counts = learned.baseline
            self.known, self.provisional = True, not learned.stable
            self._followed = t
        return learned

    def unsettle(self) -> None:
        """Forget the frames that `settle` was offered: there is no need, or the sensor is touched."""
        self._settling.clear()

    def idle_since(self, t: float) -> float | None:
        """When the idle frame before that at `t` s was, in s; None where a contact or a silence lies between."""
        since, self._followed = self._followed, t
        return since

    def follow(self, t: float, since: float, above: Array, *, recovering: bool) -> None:
        """Follow the sensor, idle from `since` until `t` s and then (N,) counts `above` this; the step is exact."""
        tau = RECOVERY_TAU_S if recovering else BASELINE_TAU_S
        self.counts = self.counts + above * -math.expm1((since - t) / tau)

    def hold(self) -> None:
        """The sensor is touched: what passes now is not followed."""
        self._followed = None
        self._settling.clear()

    def doubt(self) -> None:
        """After a silence: go on, but replace it by the next stable second."""
        self.provisional = True
        self._followed = None

    def forget(self, *, keep: bool) -> None:
        """The next stable second is a new baseline. `keep`: what `settle` was offered counts for it."""
        self.known = self.provisional = False
        self._followed = None
        if not keep:
            self._settling.clear()
