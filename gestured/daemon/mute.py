"""Muted senders: a classic BPF filter of the kernel drops their packets before these take room in a socket's buffer.

The filter sees a packet from its UDP header on; its IP header begins at the offset `NETWORK` (linux/filter.h). A filter
is a list of rules: the first that matches a packet decides, and a packet that no rule matches is let in.
"""

import array
import errno
import ipaddress
import math
import socket
import struct
from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from gestured.core.owner import Source

# A sender is muted if so many of its bytes are dropped within a second, for each sensor that it owns. A source of many
# sensors for which a machine is too slow loses frames of all of them, but it is no flood.
TOO_MUCH = 64 << 10
HEADER_BYTES = 512  # that a packet takes in the kernel's buffer besides its own bytes
FIRST_S = 1.0  # how long a sender is muted at first; each further time lasts twice as long as the one before
LONGEST_S = 8.0  # the longest that a sender is muted, so that one that has ended its flood is soon heard
SO_ATTACH_FILTER, SO_DETACH_FILTER = 26, 27  # Linux; not in Python's socket module
NETWORK = 0xFFF00000
LOAD_WORD, LOAD_HALF, LOAD_BYTE, AND, JUMP, JUMP_EQUAL, RETURN = 0x20, 0x28, 0x30, 0x54, 0x05, 0x15, 0x06  # BPF
LET_IN, THROW_AWAY = 0xFFFFFFFF, 0
MOST_RULES = 256  # rules of one filter, at most 15 instructions each; the kernel takes 4096 instructions

Sender = Source | str  # host and port, or a host for all its ports


class Muted:
    """Which senders are muted, and until when."""

    def __init__(self) -> None:
        self._until: dict[Sender, tuple[float, float]] = {}  # by sender: until when, and for how long (s)
        self._next = math.inf  # s, when the first muted sender is to be heard again
        self._dropped: dict[Sender, int] = {}  # by sender: bytes that were dropped since `_since`
        self._since = 0.0  # s, when the second began in which `_dropped` is counted

    def blame(
        self, dropped: Mapping[Sender, Collection[bytes]], now: float, owners: Mapping[Source, int]
    ) -> list[Sender]:
        """Count packets of senders that were dropped; returns the senders that are muted for it from `now` on.

        `owners`: how many sensors each source owns.
        """
        if now - self._since > 1.0:
            self._dropped, self._since = {}, now
        found: list[Sender] = []
        for sender, packets in dropped.items():
            size = self._dropped.get(sender, 0) + sum(map(len, packets)) + HEADER_BYTES * len(packets)
            self._dropped[sender] = size
            until, before = self._until.get(sender, (0.0, 0.0))
            bearable = TOO_MUCH * (1 if isinstance(sender, str) else max(owners.get(sender, 1), 1))
            if size >= bearable and now >= until:
                again = now < until + 2 * LONGEST_S
                length = min(LONGEST_S, 2 * before) if again and before else FIRST_S
                self._until[sender] = now + length, length
                self._next = min(self._next, now + length)
                found.append(sender)
        return found

    def over(self, now: float) -> list[Sender]:
        """The senders whose mute has ended since the last call."""
        if now < self._next:
            return []
        found = [sender for sender, (until, _) in self._until.items() if self._next <= until <= now]
        self._until = {sender: one for sender, one in self._until.items() if now < one[0] + 2 * LONGEST_S}
        self._next = min((until for until, _ in self._until.values() if until > now), default=math.inf)
        return found

    def rules(self, now: float, owners: Collection[Source]) -> list["Rule"]:
        """The rules of the filter at `now`. Ports of a muted host that own a sensor are still let in."""
        muted = [sender for sender, (until, _) in self._until.items() if until > now]
        ports = [Rule(*sender, False) for sender in muted if not isinstance(sender, str)]
        hosts = {sender for sender in muted if isinstance(sender, str)}
        let_in = [Rule(*owner, True) for owner in owners if owner[0] in hosts and owner not in muted]
        return [*ports, *let_in, *(Rule(host, None, False) for host in hosts)]


class Rule(NamedTuple):
    """Whether the kernel lets the packets of a sender in."""

    host: str
    port: int | None  # None: any
    let_in: bool


def mute(sock: socket.socket, rules: Iterable[Rule]) -> None:
    """Filter a UDP socket by these rules, as many as the kernel takes; without any, let in everything. Raises OSError.

    Before Linux 6.8 a filter may have 20 KiB (net.core.optmem_max) in the kernel's own instructions.
    """
    kept = list(rules)[:MOST_RULES]
    while kept:
        code = array.array("B", _program(kept))
        address, size = code.buffer_info()
        try:
            sock.setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, struct.pack("@HP", size // 8, address))
            return
        except OSError as error:
            if error.errno != errno.ENOMEM:
                raise
            kept = kept[: len(kept) // 2]
    sock.setsockopt(socket.SOL_SOCKET, SO_DETACH_FILTER, 0)


def _program(rules: Iterable[Rule]) -> bytes:
    by_host: dict[ipaddress.IPv4Address | ipaddress.IPv6Address, list[Rule]] = {}
    for rule in rules:
        address = ipaddress.ip_address(rule.host.partition("%")[0])
        by_host.setdefault(getattr(address, "ipv4_mapped", None) or address, []).append(rule)
    return b"".join([_block(*one) for one in by_host.items()]) + _step(RETURN, LET_IN)


def _block(address: ipaddress.IPv4Address | ipaddress.IPv6Address, rules: Iterable[Rule]) -> bytes:
    """What is done with the packets of one host. The port is loaded once for all rules, since a load costs most."""
    block = _step(LOAD_HALF, 0)
    for rule in rules:
        block += _step(JUMP_EQUAL, rule.port, otherwise=1) if rule.port is not None else b""
        block += _step(RETURN, LET_IN if rule.let_in else THROW_AWAY)
    version, start = (0x40, 12) if address.version == 4 else (0x60, 8)
    words = struct.unpack(f">{len(address.packed) // 4}I", address.packed)
    steps = [_step(LOAD_BYTE, NETWORK), _step(AND, 0xF0), _step(JUMP_EQUAL, version, otherwise=2 * len(words))]
    for left, word in zip(range(len(words) - 1, -1, -1), words, strict=True):
        steps += [_step(LOAD_WORD, NETWORK + start), _step(JUMP_EQUAL, word, then=not left, otherwise=2 * left)]
        start += 4
    return b"".join([*steps, _step(JUMP, len(block) // 8), block])


def _step(what: int, value: int, then: int = 0, otherwise: int = 0) -> bytes:
    """One BPF instruction; a comparison skips `then` instructions if it holds, else `otherwise`."""
    return struct.pack("@HBBI", what, then, otherwise, value)
