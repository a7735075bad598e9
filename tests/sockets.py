"""Sockets for tests: addresses that nobody has, packets that come again and again, a stand-in for the event socket."""

import json
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any

from gestured.core.address import Address

PATIENCE_S = 30.0  # for whatever a test waits for; only a failure takes so long
HELLO = {
    "type": "hello",
    "protocol": 1,
    "version": "0.0",
    "instance": "a",
    "model": "cnn_lstm",
    "gestures": ["one_tap"],
    "sensors": {"armrest": 3},
}
GESTURE = {
    "type": "gesture",
    "sensor": "armrest",
    "id": 4,
    "gesture": "swipe_left",
    "confidence": 0.98,
    "sequence": 4,
    "onset": 1000.0,
    "offset": 1000.5,
    "decided": 1000.625,
    "frames": 8,
    "lost": 0,
    "model": "cnn_lstm",
    "degraded": False,
    "scores": {"swipe_left": 0.98},
}


def free_address(kind: int = socket.SOCK_DGRAM) -> Address:
    """An address of this machine that nobody has now, for UDP unless told."""
    with socket.socket(type=kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return Address(*probe.getsockname())


@contextmanager
def meanwhile(act: Callable[[], object]) -> Iterator[None]:
    """A thread does this inside of the block, whose end waits for it."""
    thread = Thread(target=act)
    thread.start()
    try:
        yield
    finally:
        thread.join()


@contextmanager
def sending(packets: Sequence[bytes], where: Address) -> Iterator[None]:
    """These packets are sent again and again inside of the block."""
    stop = Event()

    def send() -> None:
        with socket.socket(type=socket.SOCK_DGRAM) as sender:
            while not stop.wait(0.005):
                for packet in packets:
                    sender.sendto(packet, where)

    with meanwhile(send):
        try:
            yield
        finally:
            stop.set()


class FakeDaemon:
    """An event socket that says exactly what the test tells it to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(str(path))
        self.listener.listen()
        self.listener.settimeout(PATIENCE_S)
        self.client: socket.socket

    def accept(self, hello: object = HELLO) -> None:
        self.client, _ = self.listener.accept()
        self.client.settimeout(PATIENCE_S)
        self.say(hello)

    def say(self, *messages: object) -> None:
        for message in messages:
            self.client.sendall(message if isinstance(message, bytes) else json.dumps(message).encode() + b"\n")

    def request(self) -> Any:
        return json.loads(self.client.makefile("rb").readline())

    def close(self) -> None:
        self.client.close()
