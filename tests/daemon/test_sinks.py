"""Destinations that the settings name, where they cannot be reached at once."""

import errno
import socket
import threading
import time
from typing import Any

import pytest
from pythonosc.osc_message import OscMessage

from gestured.client.address import look_up
from gestured.core.address import Address
from gestured.core.events import Status
from gestured.daemon import sinks
from gestured.daemon.metrics import Metrics
from tests.daemon.harness import DEADLINE_S

NOT_KNOWN = socket.gaierror(socket.EAI_AGAIN, "Temporary failure in name resolution")
# The broadcast address is refused by our own kernel at once: no packet leaves this machine.
ELSEWHERE = socket.AF_INET, ("255.255.255.255", 9)


@pytest.mark.parametrize(("before", "result"), [(NOT_KNOWN, "unresolved"), (ELSEWHERE, "unreachable")])
def test_a_destination_whose_name_is_not_known_yet_or_was_of_another_host_is_looked_up_again(
    udp: socket.socket, monkeypatch: pytest.MonkeyPatch, before: Any, result: str
) -> None:
    """As at the start of a machine, whose network comes later than we do, and where a host gets another address."""
    known = look_up(Address(*udp.getsockname()), socket.SOCK_DGRAM)
    found: list[Any] = [before] * 2

    def later(*_: object) -> Any:
        if isinstance(one := found.pop(0) if found else known, OSError):
            raise one
        return one

    monkeypatch.setattr(sinks, "look_up", later)
    monkeypatch.setattr(sinks, "LOOK_UP_S", 0.0)
    metrics = Metrics()
    sink = sinks.OscSink(Address("display.local", 9001), metrics)
    end = time.monotonic() + DEADLINE_S
    while ("sent",) not in metrics.sent.values and time.monotonic() < end:
        sink.publish(Status("ok", {}, "tiny", 0.0), 0.0)
    assert OscMessage(udp.recv(9999)).address == "/gestured/status" and metrics.sent.values[result,] > 0
    sink.close()


def test_a_name_server_that_does_not_answer_holds_up_neither_a_start_nor_what_goes_on_after_a_reload(
    udp: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = look_up(Address(*udp.getsockname()), socket.SOCK_DGRAM)
    answers: dict[str, Any] = {"first": known}
    asked, answered = threading.Event(), threading.Event()

    def slow(address: Address, kind: int) -> Any:
        if address.host not in answers:
            asked.set()
            assert answered.wait(DEADLINE_S)
        return known

    monkeypatch.setattr(sinks, "look_up", slow)
    monkeypatch.setattr(sinks, "START_S", 0.0)
    metrics = Metrics()
    status = Status("ok", {}, "tiny", 0.0)
    late = sinks.OscSink(Address("late", 9001), metrics)
    assert asked.wait(DEADLINE_S)
    late.publish(status, 0.0)
    assert metrics.sent.values == {("unresolved",): 1}

    before = sinks.OscSink(Address("first", 9001), metrics)
    end = time.monotonic() + DEADLINE_S
    while ("sent",) not in metrics.sent.values and time.monotonic() < end:
        before.publish(status, 0.0)
    del answers["first"]
    after = sinks.OscSink(Address("first", 9001), metrics)
    after.take_over(before)
    before.close()
    sent = metrics.sent.values["sent",]
    after.publish(status, 0.0)
    assert metrics.sent.values["sent",] == sent + 1

    answered.set()
    while metrics.sent.values["sent",] < sent + 2 and time.monotonic() < end:
        late.publish(status, 0.0)
    for _ in range(round(sent) + 2):
        assert OscMessage(udp.recv(9999)).address == "/gestured/status"
    late.close()
    after.close()


def test_after_this_machine_got_another_address_a_new_socket_is_taken(
    udp: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is connected keeps the address of then, and connecting it again does not help."""
    made: list[socket.socket] = []

    class Kept(socket.socket):
        def __init__(self, *which: Any) -> None:
            super().__init__(*which)
            made.append(self)

        def send(self, *data: Any) -> int:
            if self is made[0]:
                raise OSError(errno.ENETUNREACH, "Network is unreachable")
            return super().send(*data)

    monkeypatch.setattr(socket, "socket", Kept)
    monkeypatch.setattr(sinks, "LOOK_UP_S", 0.0)
    metrics = Metrics()
    sink = sinks.OscSink(Address(*udp.getsockname()), metrics)
    end = time.monotonic() + DEADLINE_S
    while ("sent",) not in metrics.sent.values and time.monotonic() < end:
        sink.publish(Status("ok", {}, "tiny", 0.0), 0.0)
    assert OscMessage(udp.recv(9999)).address == "/gestured/status" and metrics.sent.values["unreachable",] > 0
    sink.close()


def test_localhost_by_both_families_is_where_most_programs_listen(monkeypatch: pytest.MonkeyPatch) -> None:
    both = [(socket.AF_INET6, 2, 17, "", ("::1", 9001, 0, 0)), (socket.AF_INET, 2, 17, "", ("127.0.0.1", 9001))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: both)
    assert look_up(Address("localhost", 9001), socket.SOCK_DGRAM) == (socket.AF_INET, ("127.0.0.1", 9001))
    del both[1:]
    assert look_up(Address("localhost", 9001), socket.SOCK_DGRAM) == (socket.AF_INET6, ("::1", 9001, 0, 0))
