"""The canary of the watchdog: whether the way of a frame works, tried on a sensor that does not exist."""

from random import Random  # nothing else in the daemon needs numpy's own, which is large

import numpy as np

from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.daemon.desk import Desk

CANARY_TAXELS = 4  # taxels


class Canary:
    """Pushes an idle frame through a front end of its own; its time is its own, too.

    No model is asked: one that hangs does so in the loop, which then feeds no watchdog either.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._front_end = FrontEnd("canary", CANARY_TAXELS, CANARY_TAXELS)
        self._random = Random(0)
        self._t = 0.0

    def sings(self) -> bool:
        """Whether a frame came through. A failure is logged and counted; systemd restarts us if it lasts."""
        self._t += 0.1
        try:
            values = np.array([self._random.gauss(100.0, 1.0) for _ in range(CANARY_TAXELS * CANARY_TAXELS)])
            self._front_end.push(Frame(self._t, values.reshape(CANARY_TAXELS, CANARY_TAXELS)))
        except Exception:  # whatever ends this frame ends those of every sensor
            self._desk.bug("in the way of the watchdog's frame")
            return False
        return True
