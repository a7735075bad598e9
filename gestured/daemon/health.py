"""The health of the daemon itself: whether its loop turns, how late it is, and whether systemd's watchdog is fed."""

import os
import time
from random import Random  # numpy.random is large, and nothing else in the daemon needs it

import numpy as np

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.daemon.desk import Desk

TICK_S = 0.25  # the longest pause between two turns of the loop
FADING = 0.95  # share of the lag that is kept each tick, so that half of it is gone in about four seconds
CANARY_TAXELS = 4  # rows of the canary's grid, and columns


class Pulse:
    """The beat of the daemon's loop: set by the loop as long as it turns, read by any thread."""

    def __init__(self) -> None:
        self.beat = time.monotonic()
        self._lag = 0.0

    def woke(self, late_s: float) -> None:
        """Note that the loop came round, `late_s` s later than planned."""
        self.beat = time.monotonic()
        self._lag = max(late_s, FADING * self._lag)

    @property
    def age_s(self) -> float:
        """Seconds since the loop last came round."""
        return time.monotonic() - self.beat

    @property
    def lag_s(self) -> float:
        """How late the loop is, in s: the worst recent delay, or the time for which it has been hanging."""
        return max(self._lag, self.age_s - TICK_S)


def watchdog_period() -> float | None:
    """Seconds between two WATCHDOG=1, a third of what systemd allows; None if it does not watch us."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    if not microseconds.isdigit() or os.environ.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    return int(microseconds) / 3e6


class Canary:
    """An artificial sensor, with which a front end is tested each time before systemd's watchdog is fed.

    Its front end and its time are its own. It runs no model: a model that hangs stops the loop, and then nothing feeds
    the watchdog either.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._front_end = FrontEnd(CANARY_TAXELS, CANARY_TAXELS)
        self._random = Random(0)
        self._t = 0.0

    def sings(self) -> bool:
        """Whether the front end takes a frame. A failure is logged and counted; systemd restarts us if it lasts."""
        self._t += 0.1
        try:
            values = np.array([self._random.gauss(100.0, 1.0) for _ in range(CANARY_TAXELS * CANARY_TAXELS)])
            self._front_end.push(Frame(self._t, values.reshape(CANARY_TAXELS, CANARY_TAXELS)))
        except Exception:  # what fails for this frame also fails for those of real sensors
            self._desk.bug("in the way of the watchdog's frame")
            return False
        return True
