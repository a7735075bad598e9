"""What a sensor went through before a contact, by which a model tells what was meant from everyday life."""

import math
from collections import deque

from gestured.core.frames import QUIET_S, Before

MOST = 64  # contacts that are remembered: more in ten seconds say nothing new


class Past:
    """The contacts of the last ten seconds."""

    def __init__(self) -> None:
        self._began: deque[float] = deque(maxlen=MOST)  # s
        self._ended = -math.inf  # s, the last contact's end
        self._length_s = 0.0  # of the last contact

    def begin(self, t: float, covered: float, rest: float) -> Before:
        """A contact begins at `t` s on a sensor on which something rests (`Before`): what was before it."""
        began = self._began
        while began and t - began[0] > QUIET_S:
            began.popleft()
        quiet_s = min(t - self._ended, QUIET_S)
        before = Before(quiet_s, len(began), self._length_s if quiet_s < QUIET_S else 0.0, covered, rest)
        began.append(t)
        return before

    def end(self, t: float) -> None:
        """The contact is over at `t` s, or what had rested has left then."""
        self._ended = t
        if self._began:
            self._length_s = max(t - self._began[-1], 0.0)
