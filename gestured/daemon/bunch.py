"""Bunches: packets of a sensor that were held up on their way, as by Wi-Fi, and arrive right after each other."""

import math
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import NamedTuple

from gestured.core.owner import Source
from gestured.daemon.backlog import GROUP_BYTES, TOGETHER_S, Packet

QUIET_S = 0.2  # a bunch may come after so long a pause of its source; a shorter pause makes no hole in a contact
MOST_S, MOST = 0.05, 128  # the most seconds that a bunch is held back, and the most packets of a bunch
REMEMBERED_SOURCES = 4096  # sources whose last arrival is remembered


class Bunch(NamedTuple):
    """Packets of one source that came after a pause, each at most TOGETHER_S after the one before it."""

    packets: list[Packet]
    arrivals: list[float]  # s, monotonic, of each packet

    @property
    def over(self) -> float:
        """When the bunch is complete unless another packet comes before, in s."""
        if len(self.packets) >= MOST or sum([len(packet) for packet, _ in self.packets]) >= GROUP_BYTES:
            return self.arrivals[0]
        return min(self.arrivals[-1] + TOGETHER_S, self.arrivals[0] + MOST_S)


class Bunches:
    """Holds back packets that come after a pause for some milliseconds, until their bunch is complete.

    Frames without a time of their own are dated by their arrival. Packets that a network holds up arrive late, but in
    one bunch. If the hub gets the frames of a bunch together, it spaces them at the sensor's usual rate, up to their
    arrival. One by one, they would look like a hole in the contact, and then like frames at a much higher rate.
    """

    def __init__(self, owned: Callable[[Source], int]) -> None:
        """`owned` says how many sensors a source owns; packets of a source that owns none are never held back."""
        self._owned = owned
        self._heard: dict[Source, float] = {}  # s, when each source was heard last
        self._held: dict[Source, Bunch] = {}

    @property
    def oldest(self) -> float:
        """When the oldest packet that is held back came, in s; infinite if there is none."""
        return min([bunch.arrivals[0] for bunch in self._held.values()]) if self._held else math.inf

    @property
    def due(self) -> float:
        """When the next bunch is complete unless more packets come before, in s; infinite if there is none."""
        return min([bunch.over for bunch in self._held.values()]) if self._held else math.inf

    def pick(self, packets: Sequence[Packet], arrivals: Sequence[float]) -> tuple[list[Packet], list[float]]:
        """Hold back the packets that belong to bunches. Returns the others, and when they arrived (s).

        Both `packets` and the others are in the order of their arrivals.
        """
        heard, held = self._heard, self._held
        if len(heard) > REMEMBERED_SOURCES:
            heard.clear()
        sources = [source for _, source in packets]
        before = min([heard.get(source, arrivals[0]) for source in set(sources)], default=0.0)
        if not held and packets and arrivals[-1] - before < QUIET_S:  # none of these sources has paused, as is usual
            heard.update(zip(sources, arrivals, strict=True))
            return list(packets), list(arrivals)
        others: list[tuple[float, Packet]] = []
        for packet, arrival in zip(packets, arrivals, strict=True):
            source = packet[1]
            before = heard.get(source, arrival)
            heard[source] = arrival
            if source in held and arrival > held[source].over:  # the bunch was complete before
                complete = held.pop(source)
                others += [(complete.arrivals[-1], one) for one in complete.packets]
            if source in held or (arrival - before >= QUIET_S and self._owned(source)):
                bunch = held.setdefault(source, Bunch([], []))
                bunch.packets.append(packet)
                bunch.arrivals.append(arrival)
            else:
                others.append((arrival, packet))
        others.sort(key=itemgetter(0))
        return [packet for _, packet in others], [arrival for arrival, _ in others]

    def over(self, now: float) -> list[Bunch]:
        """Take the bunches that are complete at `now` (s); those that lie within TOGETHER_S become one."""
        if not self._held:
            return []
        complete = {source: bunch for source, bunch in self._held.items() if bunch.over <= now}
        found: list[Bunch] = []
        for source, bunch in sorted(complete.items(), key=lambda item: item[1].arrivals[-1]):
            del self._held[source]
            if found and bunch.arrivals[-1] - found[-1].arrivals[0] < TOGETHER_S:
                found[-1].packets.extend(bunch.packets)
                found[-1].arrivals.extend(bunch.arrivals)
            else:
                found.append(bunch)
        return found
