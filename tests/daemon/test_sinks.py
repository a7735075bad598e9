"""Destinations that the settings name, where they cannot be reached at once."""

import socket
import time
from typing import Any

import pytest
from pythonosc.osc_message import OscMessage

from gestured.core.address import Address
from gestured.core.events import Status
from gestured.daemon import sinks
from gestured.daemon.metrics import Metrics
from gestured.daemon.sockets import resolve
from tests.daemon.harness import DEADLINE_S


def test_a_destination_whose_name_is_not_known_yet_is_looked_up_again(
    udp: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As at the start of a machine, whose network comes later than we do."""
    known = resolve(Address(*udp.getsockname()), socket.SOCK_DGRAM)
    found: list[Any] = [socket.gaierror(socket.EAI_AGAIN, "Temporary failure in name resolution")] * 2 + [known]

    def look_up(*_: object) -> Any:
        if isinstance(one := found.pop(0) if found else known, OSError):
            raise one
        return one

    monkeypatch.setattr(sinks, "resolve", look_up)
    monkeypatch.setattr(sinks, "LOOK_UP_S", 0.0)
    metrics = Metrics()
    sink = sinks.OscSink(Address("display.local", 9001), metrics)
    end = time.monotonic() + DEADLINE_S
    while ("sent",) not in metrics.sent.values and time.monotonic() < end:
        sink.publish(Status("ok", {}, "tiny", 0.0), 0.0)
    assert OscMessage(udp.recv(9999)).address == "/gestured/status" and metrics.sent.values["unresolved",] > 0
    sink.close()
