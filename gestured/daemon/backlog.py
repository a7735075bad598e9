"""The backlog: packets that wait for their turn, and the choice among them if more come than can be served."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from itertools import accumulate
from operator import attrgetter
from typing import NamedTuple

from gestured.core.owner import Source
from gestured.daemon.mute import Sender

TOGETHER_S = 0.004  # packets that arrived so close to each other are served together
LIGHT_BYTES = 4 << 10  # owners of sensors that send no more than this in a turn of a flood are served together
GROUP, GROUP_BYTES = 256, 128 << 10  # the most packets that are served together, and the most bytes of several packets
ROOM_BYTES = 52 << 10  # a quarter of the smallest receive buffer that a kernel grants
MOST_BYTES = 32 << 20  # four times the kernel's buffer, which has twice the 4 MiB that we ask for
FLOOD_S = 1.0  # s of work after which we check whether the backlog shrinks; also the shortest duration of a flood
PACE = 0.5  # s of arrivals that one second of work must serve at least; else it is a flood
OWNERS_SHARE = 0.75  # of the time in a flood, for owners of sensors; strangers get the rest
# s of work that a sender begins with, and may save up, for each sensor that it owns; a stranger has it once. The
# largest packet of frames costs as much.
CREDIT_S = 0.02
FIRST_GUESS = 3e-7  # s of work for a byte, until a sender's packets have been measured
NEWEST = 0.2  # weight of the newest measurement of what a sender's packets cost
REMEMBERED_SENDERS = 4096  # senders whose costs and credit are remembered in a flood


Packet = tuple[bytes, Source]


class Datagram(NamedTuple):
    """A packet as it arrived."""

    arrival: float  # s, monotonic
    packet: bytes
    source: Source
    cost: float  # s of work, estimated; at most what any sender can save up, so that each is served in the end


class Group(NamedTuple):
    """Packets that arrived together and are served together in a flood, of one sender or of several light ones."""

    packets: list[Packet]
    arrival: float  # s, monotonic, of the last of them


class Backlog:
    """The packets that were read and not yet served, oldest first.

    In a flood, work is shared out: in each turn every sender gets the same time, time that one does not need goes to
    the others, and packets beyond a share are dropped, the oldest first. Owners of sensors that send little are served
    first and together, since a frame costs several times less with others than alone; then the senders that need the
    least time. A source that owns a sensor is a sender of its own, and gets its share before strangers; all strangers
    of one host are one sender, however many ports they open.
    """

    def __init__(self, owned: Callable[[Source], int]) -> None:
        """`owned` says how many sensors a source owns."""
        self._owned = owned
        self._packets: list[Packet] = []
        self._arrivals: list[float] = []  # s, of each
        self._bytes = 0
        # `worked` compares from time to time how much work was done with how many seconds of arrivals that served.
        self._work = 0.0  # s of work on groups since the last measurement
        self._oldest = 0.0  # s, the arrival of the oldest packet at the last measurement
        self._until = 0.0  # s, when the flood is over unless packets are dropped before
        self._cost: dict[Sender, float] = {}  # by sender: s of work that a byte costs
        self._credit: dict[Sender, tuple[float, float]] = {}  # by sender: s of work saved up, and `_equal` at that time
        self._equal = 0.0  # s of work that was offered to each owner in all turns of this flood
        self._turns = 0.0  # s of turns since a packet that costs more than a whole turn was last served

    def __bool__(self) -> bool:
        return bool(self._packets)

    @property
    def full(self) -> float:
        """The waiting packets as a share of what a read takes, or their bytes as one of ROOM_BYTES, the larger one."""
        return max(len(self._packets) / GROUP, self._bytes / ROOM_BYTES)

    @property
    def oldest(self) -> float:
        """When the oldest packet arrived, in s; infinite if none waits."""
        return self._arrivals[0] if self._arrivals else math.inf

    def add(self, packets: Sequence[Packet], arrivals: Sequence[float]) -> None:
        """Add packets in the order of their arrivals (s)."""
        if not self._packets and packets:
            self._work, self._oldest = 0.0, arrivals[0]
        self._packets += packets
        self._arrivals += arrivals
        self._bytes += sum([len(packet) for packet, _ in packets])

    def flooded(self, now: float) -> bool:
        """Whether more packets come than can be served; if not, costs and credit are forgotten."""
        if self._bytes > MOST_BYTES or now < self._until:
            return True
        self._credit.clear()
        self._cost.clear()
        return False

    def flood(self, until: float) -> None:
        """Treat packets as a flood at least `until` then (s)."""
        self._until = max(self._until, until)

    def worked(self, seconds: float, now: float) -> None:
        """Note `seconds` of work on groups; if the work does not catch up with the arrivals, it is a flood."""
        self._work += seconds
        if self._packets and self._work >= FLOOD_S:
            oldest = self.oldest
            if oldest - self._oldest < PACE * self._work and now - oldest >= FLOOD_S:
                self.flood(now + FLOOD_S)
            self._work, self._oldest = 0.0, oldest

    def group(self) -> tuple[list[Packet], float]:
        """Take the oldest packets that arrived together, at least one, and the arrival of the last of them in s."""
        n = bisect_left(self._arrivals, self._arrivals[0] + TOGETHER_S, hi=min(GROUP, len(self._arrivals)))
        ends = list(accumulate([len(packet) for packet, _ in self._packets[:n]]))
        n = max(1, bisect_right(ends, GROUP_BYTES))
        found, arrival = self._packets[:n], self._arrivals[n - 1]
        del self._packets[:n], self._arrivals[:n]
        self._bytes -= ends[n - 1]
        return found, arrival

    def share(self, seconds: float, now: float) -> tuple[list[Group], dict[Sender, list[bytes]]]:
        """The groups to serve in a turn of a flood that takes `seconds`, and by sender the packets that were dropped.

        No packet waits afterwards. A packet that costs more than a turn is served only after as much time in turns,
        since the kernel's buffer fills during the work on it.
        """
        by_sender: dict[Sender, list[Datagram]] = {}
        for (packet, source), arrival in zip(self._packets, self._arrivals, strict=True):
            key = self.sender(source)
            cost = min(len(packet) * self._cost.get(key, FIRST_GUESS), CREDIT_S)
            by_sender.setdefault(key, []).append(Datagram(arrival, packet, source, cost))
        self._packets, self._arrivals = [], []
        self._bytes = 0
        needs: dict[Sender, float] = {key: sum([each.cost for each in waiting]) for key, waiting in by_sender.items()}
        owners: dict[Sender, float] = {key: need for key, need in needs.items() if isinstance(key, tuple)}
        strangers = {key: need for key, need in needs.items() if key not in owners}
        shares = fair(owners, max(OWNERS_SHARE * seconds, seconds - sum(strangers.values())))
        spent = sum(min(shares[key], need) for key, need in owners.items())
        shares |= fair(strangers, seconds - spent)
        before = self._equal
        self._equal += min((shares[key] for key in owners), default=OWNERS_SHARE * seconds)
        self._turns = min(self._turns + seconds, CREDIT_S)
        light: list[Datagram] = []
        served: list[Group] = []
        dropped: dict[Sender, list[bytes]] = {}
        for key in sorted(by_sender, key=needs.__getitem__):
            kept = self._newest(key, by_sender[key], shares[key], before, seconds)
            if key in owners and sum([len(each.packet) for each in kept]) <= LIGHT_BYTES:
                light += kept
            else:
                served += _groups(kept)
            if left := by_sender[key][: len(by_sender[key]) - len(kept)]:
                dropped[key] = [datagram.packet for datagram in left]
        if dropped:
            self.flood(now + FLOOD_S)
        return _groups(sorted(light, key=attrgetter("arrival"))) + served, dropped

    def took(self, group: Group, seconds: float) -> None:
        """Note that a group of a flood was served in `seconds`, which shows what its senders' packets cost."""
        size = sum([len(packet) for packet, _ in group.packets])
        cost = seconds / size if size else 0.0
        for key in {self.sender(source) for _, source in group.packets}:
            if len(self._cost) < REMEMBERED_SENDERS or key in self._cost:
                before = self._cost.get(key, cost)
                self._cost[key] = before + NEWEST * (cost - before)

    def sender(self, source: Source) -> Sender:
        """The sender as which a source counts: the source itself if it owns a sensor, else its host."""
        return source if self._owned(source) else source[0]

    def _newest(
        self, key: Sender, datagrams: list[Datagram], share: float, before: float, seconds: float
    ) -> list[Datagram]:
        most = CREDIT_S * (self._owned(key) if isinstance(key, tuple) else 1)
        credit, equal = self._credit.get(key, (most, before))
        if isinstance(key, tuple):
            credit += before - equal  # for turns in which it sent nothing; a stranger earns nothing in a pause
        credit = min(credit + share, max(share, most))
        kept: list[Datagram] = []
        for datagram in reversed(datagrams):
            cost = datagram.cost
            if cost > credit or (cost > seconds and cost > self._turns):
                break
            credit -= cost
            if cost > seconds:
                self._turns -= cost
            kept.append(datagram)
        if len(self._credit) < REMEMBERED_SENDERS or key in self._credit:
            self._credit[key] = credit, self._equal
        return kept[::-1]


def _groups(datagrams: Sequence[Datagram]) -> list[Group]:
    """The groups of datagrams that arrived together; `datagrams` are the oldest first."""
    groups: list[list[Datagram]] = []
    for datagram in datagrams:
        if not groups or datagram.arrival - groups[-1][0].arrival >= TOGETHER_S:
            groups.append([])
        groups[-1].append(datagram)
    return [Group([(packet, source) for _, packet, source, _ in some], some[-1].arrival) for some in groups]


def fair(needs: dict[Sender, float], seconds: float) -> dict[Sender, float]:
    """By sender, its share of `seconds`: the same for all, but time that one does not need goes to the others."""
    shares: dict[Sender, float] = {}
    left = seconds
    for n, (key, need) in enumerate(sorted(needs.items(), key=lambda item: item[1])):
        shares[key] = left / (len(needs) - n)
        left -= min(need, shares[key])
    return shares
