"""Who may feed a sensor: the source that sent it first, until it has been silent."""

from dataclasses import dataclass

Source = tuple[str, int]  # host and port of a sender


@dataclass(slots=True)
class Owner:
    """Of one sensor."""

    source: Source
    before: Source | None = None  # the owner before this one
    packets: int = 0  # of this owner
    heard: float = 0.0  # s, monotonic

    def admits(self, source: Source, now: float, stale_s: float) -> bool:
        """Whether a packet of `source` at `now` s may feed the sensor; if so, it is its owner's last word."""
        if source != self.source:
            if now - self.heard <= stale_s and not self._one_shot(source):
                return False
            self.before, self.source, self.packets = self.source, source, 0
        self.packets += 1
        self.heard = now
        return True

    def _one_shot(self, source: Source) -> bool:
        """Whether the owner may be a program that opens a new port for each packet, as `oscsend` does.

        One packet from a port is no claim against another port of the same host; two are.
        """
        return self.packets == 1 and source[0] == self.source[0] and source != self.before
