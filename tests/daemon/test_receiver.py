"""What is read from the socket, and what is known to have been served, with a clock that is written down."""

import asyncio
import math
import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from gestured.daemon import sockets
from gestured.daemon.udp import Receiver

FRAME = b"frame"


class Hub:
    """Notes what it is given."""

    owners: frozenset[Any] = frozenset()
    due = math.inf

    def __init__(self) -> None:
        self.heard: list[tuple[bytes, float]] = []
        self.dropped = 0
        self.cost_s = 0.0  # of the processor, for each packet

    def receive(self, packets: Any, now: float) -> list[Any]:
        self.heard += [(packet, now) for packet, _ in packets]
        begun = time.thread_time()
        while time.thread_time() < begun + self.cost_s * len(packets):
            pass
        return []

    def drop(self, reason: str, *, count: int = 1, error: str = "") -> None:
        self.dropped += count * (reason == "flood")

    def missed(self) -> None: ...


BATCH = 16  # packets that a read takes here, so that a small buffer holds more


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[socket.socket, socket.socket]]:
    """The daemon's socket, and one that sends to it."""
    monkeypatch.setattr("gestured.daemon.udp.BATCH", BATCH)
    kind = socket.AF_INET, socket.SOCK_DGRAM
    with socket.socket(*kind) as here, socket.socket(*kind) as there:
        here.bind(("127.0.0.1", 0))
        here.setblocking(False)
        sockets.stamp_arrivals(here)
        there.connect(here.getsockname())
        yield here, there


def receiver(sock: socket.socket, hub: Hub) -> Receiver:
    desk: Any = SimpleNamespace(take=lambda facts: None, drop=hub.drop, muted=lambda _: None)
    return Receiver(sock, time.monotonic(), hub, desk, SimpleNamespace(active=False))  # type: ignore[arg-type]


def test_what_waits_in_the_socket_behind_others_packets_is_not_served(pair: Any) -> None:
    """A stop of the daemon: a stranger's packets lie before a sensor's, and more than one read takes."""
    here, there = pair

    async def run() -> None:
        hub = Hub()
        subject = receiver(here, hub)
        for _ in range(BATCH):
            there.send(b"")
        there.send(FRAME)
        sent = time.monotonic()
        subject.read()
        assert FRAME not in dict(hub.heard)
        assert subject.served(time.monotonic() + 1.3) <= sent
        while FRAME not in dict(hub.heard):
            subject.read()
        subject.read()
        assert subject.served(time.monotonic()) > sent
        subject.close()

    asyncio.run(run())


def test_a_flood_that_comes_in_small_reads_is_held_back(pair: Any) -> None:
    """Each read finds two packets, which cost far more than a turn of a flood has time for."""
    here, there = pair

    async def run() -> None:
        hub = Hub()
        hub.cost_s = 0.02
        subject = receiver(here, hub)
        subject._backlog.flood(time.monotonic() + 60.0)
        for _ in range(20):
            there.send(FRAME)
            there.send(FRAME)
            subject.read()
        assert hub.dropped > len(hub.heard) > 0
        subject.close()

    asyncio.run(run())
