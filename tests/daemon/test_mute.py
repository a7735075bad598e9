"""The kernel throws away what is muted, and nothing else."""

import ctypes
import errno
import ipaddress
import socket
import struct

import pytest

from gestured.daemon.mute import (
    FIRST_S,
    HEADER_BYTES,
    LONGEST_S,
    MOST_RULES,
    RETURN,
    THROW_AWAY,
    TOO_MUCH,
    Muted,
    Rule,
    mute,
)


class Wire:
    """A receiver, and senders on several addresses of this machine."""

    def __init__(self, family: int, anywhere: str) -> None:
        self.receiver = socket.socket(family, socket.SOCK_DGRAM)
        if family == socket.AF_INET6:
            self.receiver.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
        self.receiver.bind((anywhere, 0))
        self.receiver.setblocking(False)
        self._senders: list[socket.socket] = []

    def sender(self, host: str) -> socket.socket:
        family = socket.AF_INET6 if ipaddress.ip_address(host).version == 6 else socket.AF_INET
        sock = socket.socket(family, socket.SOCK_DGRAM)
        sock.bind((host, 0))
        sock.connect(("::1" if family == socket.AF_INET6 else "127.0.0.1", self.receiver.getsockname()[1]))
        self._senders.append(sock)
        return sock

    def heard(self, *senders: socket.socket) -> list[bool]:
        """Whose packet arrives; on the loopback device it has when `send` returns."""
        found = []
        for sock in senders:
            sock.send(b"x")
            try:
                found.append(bool(self.receiver.recv(10)))
            except BlockingIOError:
                found.append(False)
        return found

    def close(self) -> None:
        for sock in (self.receiver, *self._senders):
            sock.close()


@pytest.fixture(params=[(socket.AF_INET, "0.0.0.0"), (socket.AF_INET6, "::")], ids=["IPv4", "both"])
def wire(request):
    try:
        made = Wire(*request.param)
    except OSError as error:
        pytest.skip(f"there is no such socket here: {error}")
    yield made
    made.close()


def test_a_muted_host_is_not_heard_but_for_the_ports_that_are_let_in(wire: Wire) -> None:
    loud, steady, other = wire.sender("127.0.0.2"), wire.sender("127.0.0.2"), wire.sender("127.0.0.3")
    assert wire.heard(loud, steady, other) == [True] * 3
    mute(wire.receiver, [Rule("127.0.0.2", steady.getsockname()[1], True), Rule("127.0.0.2", None, False)])
    assert wire.heard(loud, steady, other) == [False, True, True]
    mute(wire.receiver, [])
    assert wire.heard(loud, steady, other) == [True] * 3


def test_a_muted_port_says_nothing_of_its_host_or_of_others(wire: Wire) -> None:
    loud, steady = wire.sender("127.0.0.2"), wire.sender("127.0.0.2")
    more = [wire.sender(host) for host in ("127.0.0.3", "127.0.0.4")]
    ports = [loud.getsockname()[1], *(port for port in range(1, 200))]
    rules = [Rule("127.0.0.4", None, False), *(Rule("::ffff:127.0.0.2", port, False) for port in ports)]
    mute(wire.receiver, rules)
    assert wire.heard(loud, steady, *more) == [False, True, True, False]


def test_hosts_with_long_addresses() -> None:
    try:
        wire = Wire(socket.AF_INET6, "::")
        loud, other = wire.sender("::1"), wire.sender("127.0.0.1")
    except OSError as error:
        pytest.skip(f"there is no IPv6 here: {error}")
    mute(wire.receiver, [Rule("::1", None, False)])
    assert wire.heard(loud, other) == [False, True]
    wire.close()


def test_more_rules_than_the_kernel_takes_are_cut_off(wire: Wire) -> None:
    first = wire.sender("127.0.0.2")
    mute(wire.receiver, [Rule("127.0.0.2", None, False)] + [Rule("::1", port, False) for port in range(1000)])
    assert wire.heard(first) == [False]


class Old:
    """The kernel's side of a socket that takes filters of at most so many bytes, as net.core.optmem_max bounds them."""

    def __init__(self, most: int) -> None:
        self._most = most
        self.muted = 0  # rules in the filter that throw away

    def setsockopt(self, level: int, option: int, value: bytes | int) -> None:
        assert isinstance(value, bytes)
        count, address = struct.unpack("@HP", value)
        steps = list(struct.iter_unpack("@HBBI", ctypes.string_at(address, 8 * count)))
        if sum(8 * BECOMES[what & 7] for what, *_ in steps) > self._most:
            raise OSError(errno.ENOMEM, "Cannot allocate memory")
        self.muted = sum(what == RETURN and value == THROW_AWAY for what, _, _, value in steps)


# Into how many instructions of its own a kernel translates one, by the class of the instruction: loads take most.
BECOMES = {0: 7, 4: 1, 5: 2, 6: 2}
BEFORE_6_8 = 20480  # bytes


def test_an_older_kernel_takes_the_rules_of_all_ports_of_a_host() -> None:
    kernel = Old(BEFORE_6_8)
    mute(kernel, [Rule("10.0.0.1", port, False) for port in range(1, MOST_RULES + 1)])
    assert kernel.muted == MOST_RULES


def test_of_more_hosts_than_an_older_kernel_takes_it_takes_some() -> None:
    kernel = Old(BEFORE_6_8)
    mute(kernel, [Rule(f"fd00::{n:x}", None, False) for n in range(MOST_RULES)])
    assert 30 < kernel.muted < MOST_RULES


HOST, OWNER = "10.0.0.1", ("10.0.0.1", 5)
NEARLY, ENOUGH = [bytes(TOO_MUCH - 2 * HEADER_BYTES)], [b""]  # too much only together


def test_who_floods_is_muted_for_longer_each_time_but_never_for_good() -> None:
    muted, now, lengths = Muted(), 0.0, []
    for _ in range(6):
        assert muted.blame({HOST: NEARLY}, now, {}) == []
        assert muted.blame({HOST: ENOUGH}, now, {}) == [HOST]
        assert muted.blame({HOST: 9 * NEARLY}, now, {}) == []
        start = now
        assert muted.rules(now, [OWNER]) == [Rule(*OWNER, True), Rule(HOST, None, False)]
        while not muted.over(now):
            now += 0.125
        assert muted.rules(now, [OWNER]) == [] and muted.over(now) == []
        lengths.append(now - start)
        now += 1.5
    assert lengths == [FIRST_S, 2 * FIRST_S, 4 * FIRST_S, LONGEST_S, LONGEST_S, LONGEST_S]
    now += 3 * LONGEST_S
    assert muted.over(now) == [] and muted.blame({HOST: NEARLY + ENOUGH}, now, {}) == [HOST]
    assert muted.over(now + FIRST_S) == [HOST]  # what was long ago is forgotten


def test_an_owner_that_floods_is_muted_alone() -> None:
    muted = Muted()
    muted.blame({OWNER: NEARLY + ENOUGH, HOST: [b""] * (TOO_MUCH // HEADER_BYTES)}, 1.0, {OWNER: 1})
    assert muted.rules(1.0, [OWNER, (HOST, 6), ("10.0.0.2", 5)]) == [
        Rule(*OWNER, False), Rule(HOST, 6, True), Rule(HOST, None, False),
    ]  # fmt: skip


def test_what_is_dropped_of_a_source_counts_for_each_of_its_sensors() -> None:
    muted, once = Muted(), NEARLY + ENOUGH
    assert muted.blame({OWNER: 9 * once}, 0.2, {OWNER: 10}) == []
    assert muted.blame({OWNER: once}, 0.5, {OWNER: 10}) == [OWNER]
