"""A source that sends more than can be taken must not starve the others."""

FLOOD_S = 1.0  # the backlog that a stall has left is worked off sooner: nothing of it is dropped
RATE_BYTES = 512 << 10  # a second: ninety sensors of 9 x 9 floats at 15 Hz
BURST_BYTES = 64 << 10
SOURCES = 1024  # told apart; the rest share one ration

Source = tuple[str, int]  # host and port of a sender
Datagram = tuple[bytes, Source]


class Rations:
    """While packets of several sources come faster than they are taken, each source gets a ration (token bucket).

    It begins when every read for `FLOOD_S` has left something behind, and ends when nobody was held back for as
    long. A source that is alone is not held back: nobody else waits.
    """

    def __init__(self) -> None:
        self._full_since: float | None = None  # s
        self._heard: set[Source] = set()  # since then
        self._until = 0.0  # s, when rations end
        self._left: dict[Source | None, tuple[float, float]] = {}  # bytes that a source may still send, and when

    def on(self, now: float) -> bool:
        """Whether sources are held to their rations at `now` (s)."""
        return now < self._until

    def share(self, waiting: list[Datagram], full: bool, now: float) -> list[Datagram]:
        """What of a read may be taken at `now` (s); `full`: it has left something behind."""
        if not full:
            self._full_since = None
        else:
            if self._full_since is None:
                self._full_since = now
                self._heard.clear()
            if len(self._heard) < SOURCES:
                self._heard.update(source for _, source in waiting)
            if now - self._full_since >= FLOOD_S and len(self._heard) > 1:
                self._until = now + FLOOD_S
        if self.on(now):
            return [datagram for datagram in waiting if self._admits(*datagram, now)]
        self._left.clear()
        return waiting

    def _admits(self, packet: bytes, source: Source, now: float) -> bool:
        key = source if source in self._left or len(self._left) < SOURCES else None
        left, at = self._left.get(key, (BURST_BYTES, now))
        left = min(BURST_BYTES, left + (now - at) * RATE_BYTES)
        if left <= 0:
            self._until = now + FLOOD_S
            return False
        self._left[key] = left - len(packet), now
        return True
