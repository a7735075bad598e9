"""The owner of a sensor: the source that may feed it, which is the first one, until that has been silent."""

from dataclasses import dataclass, field

Source = tuple[str, int]  # host and port of a sender
PORTS = 1024  # ports remembered of a sender that opens a new one for each packet: one second of the fastest sensor


@dataclass(slots=True)
class Owner:
    """The source that may feed one sensor."""

    source: Source
    steady: bool = False  # whether `source` has sent more than one packet
    heard: float = 0.0  # s, on the hub's clock: the last packet that was admitted
    source_heard: float | None = None  # s, the last packet of `source` itself
    _ports: set[int] = field(default_factory=set)  # further ports of its host that have sent their one packet

    def admits(self, source: Source, now: float, stale_s: float) -> bool:
        """Whether a packet of `source` at `now` s may feed the sensor.

        A program may open a new port for each packet, as `oscsend` does. So while `source` has sent only one packet,
        each further port of its host may send one, too. A port that sends a second packet does not belong to such a
        program, and has to wait until `source` has been silent for `stale_s`, like anybody else.
        """
        if source == self.source:
            self.steady = self.source_heard is not None
            self.source_heard = self.heard = now
            return True
        if self.source_heard is None or now - self.source_heard > stale_s:
            self.source, self.steady, self.source_heard, self.heard = source, False, now, now
            self._ports.clear()
            return True
        if self.steady or source[0] != self.source[0] or source[1] in self._ports or len(self._ports) >= PORTS:
            return False
        self._ports.add(source[1])
        self.heard = now
        return True
