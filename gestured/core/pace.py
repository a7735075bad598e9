"""How fast the frames of one sensor come."""

SHARE = 0.05  # of the difference to the last interval that is followed: one late frame says little


class Pace:
    """The times of a sensor's frames, in seconds on the stream's clock."""

    def __init__(self) -> None:
        self.last: float | None = None  # s, the last frame
        self.interval_s = 0.0  # from frame to frame as they come, 0 before it is known

    def step(self, t: float) -> float:
        """Seconds from the last frame to one at `t` s, 0 before the first. Raises ValueError where time goes back."""
        if self.last is None:
            return 0.0
        step = t - self.last
        if not step > 0:
            raise ValueError(f"frame times must increase: {t} s after {self.last} s")
        return step

    def learn(self, step: float) -> None:
        """A frame has come so many seconds after the last one, without a silence between them."""
        self.interval_s += (step - self.interval_s) * (SHARE if self.interval_s else 1.0)
