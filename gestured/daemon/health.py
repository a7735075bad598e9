"""How the daemon itself is: whether its loop turns and how late, and what systemd's watchdog may be told."""

import os
import time
from random import Random  # nothing else in the daemon needs numpy's own, which is large

import numpy as np

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.daemon.desk import Desk

TICK_S = 0.25  # the longest pause between two turns of the loop
FADING = 0.95  # share of the lag that is kept each tick, so that half of it is gone in about four seconds
CANARY_TAXELS = 4  # rows, and as many columns, of the canary's grid


class Pulse:
    """The beat of the daemon's loop: set by the loop as long as it turns, read by any thread."""

    def __init__(self) -> None:
        self.beat = time.monotonic()
        self._lag = 0.0

    def woke(self, late_s: float) -> None:
        """The loop came round, `late_s` s later than it wanted to."""
        self.beat = time.monotonic()
        self._lag = max(late_s, FADING * self._lag)

    @property
    def age_s(self) -> float:
        """Seconds since the loop last came round."""
        return time.monotonic() - self.beat

    @property
    def lag_s(self) -> float:
        """How late the loop is, in s: the worst of late, or how long it has been hanging."""
        return max(self._lag, self.age_s - TICK_S)


def watchdog_period() -> float | None:
    """Seconds between two WATCHDOG=1, a third of what systemd allows; None where it does not watch."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    if not microseconds.isdigit() or os.environ.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    return int(microseconds) / 3e6


class Canary:
    """A sensor that does not exist, on which the way of a frame is tried before systemd's watchdog is told anything.

    Its front end and its time are its own. No model is asked: one that hangs does so in the loop, which then feeds no
    watchdog either.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._front_end = FrontEnd(CANARY_TAXELS, CANARY_TAXELS)
        self._random = Random(0)
        self._t = 0.0

    def sings(self) -> bool:
        """Whether a frame came through. A failure is logged and counted; systemd restarts us if it lasts."""
        self._t += 0.1
        try:
            values = np.array([self._random.gauss(100.0, 1.0) for _ in range(CANARY_TAXELS * CANARY_TAXELS)])
            self._front_end.push(Frame(self._t, values.reshape(CANARY_TAXELS, CANARY_TAXELS)))
        except Exception:  # what fails for this frame fails for every sensor's
            self._desk.bug("in the way of the watchdog's frame")
            return False
        return True
