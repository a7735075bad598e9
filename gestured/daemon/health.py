"""Whether the loop turns, and how late it comes round."""

import time

TICK_S = 0.25  # the loop comes round at least so often
FADING = 0.95  # of the lag that is left after a tick: half of it in about four seconds


class Pulse:
    """Set by the loop as long as it turns, read by any thread."""

    def __init__(self) -> None:
        self.beat = time.monotonic()
        self._lag = 0.0

    def woke(self, late_s: float) -> None:
        """The loop came round, `late_s` after it wanted to."""
        self.beat = time.monotonic()
        self._lag = max(late_s, FADING * self._lag)

    @property
    def age_s(self) -> float:
        """Since it came round."""
        return time.monotonic() - self.beat

    @property
    def lag_s(self) -> float:
        """How late it is: its worst of late, and while it hangs, how long it does."""
        return max(self._lag, self.age_s - TICK_S)
