"""How the daemon itself is: whether its loop turns and how late, and what systemd's watchdog may be told."""

import os
import time

TICK_S = 0.25  # the longest pause between two turns of the loop
FADING = 0.95  # share of the lag that is kept each tick, so that half of it is gone in about four seconds


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
