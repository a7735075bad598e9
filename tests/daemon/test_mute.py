"""The kernel throws away what is muted, and nothing else."""

import ipaddress
import socket

import pytest

from gestured.daemon.mute import FIRST_S, HEADER_BYTES, LONGEST_S, TOO_MUCH, Muted, Rule, mute


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


def test_a_muted_port_says_nothing_of_its_host(wire: Wire) -> None:
    loud, steady = wire.sender("127.0.0.2"), wire.sender("127.0.0.2")
    mute(wire.receiver, [Rule("::ffff:127.0.0.2", loud.getsockname()[1], False)])
    assert wire.heard(loud, steady) == [False, True]


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
