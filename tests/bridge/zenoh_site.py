"""A router of Zenoh and a client of it, from Zenoh's own wheel, and a bridge that calls the router."""

import json
import queue
import socket
from collections.abc import Callable
from typing import Any

import pytest

from tests.bridge.conftest import Process, wait
from tests.daemon.harness import DEADLINE_S
from tests.sockets import FakeDaemon, free_address

zenoh = pytest.importorskip("zenoh", reason="the bridge to Zenoh needs the extra [zenoh]")


def opened(mode: str, *, listen: str = "", connect: str = "") -> Any:
    """A session that looks for nobody by itself."""
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        "listen/endpoints": [listen] if listen else [],
        "connect/endpoints": [connect] if connect else [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


class Site:
    """A router, and a client of it that hears all."""

    def __init__(self) -> None:
        self.endpoint = f"tcp/{free_address(socket.SOCK_STREAM)}"
        self.router = opened("router", listen=self.endpoint)
        self.client = opened("client", connect=self.endpoint)
        self.samples: queue.Queue[Any] = queue.Queue()
        self.tokens: queue.Queue[tuple[str, bool]] = queue.Queue()
        self._hears = self.client.declare_subscriber("gestured/**", self.samples.put)
        self._sees = self.client.liveliness().declare_subscriber(
            "gestured/**", lambda sample: self.tokens.put((str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))
        )

    def event(self) -> tuple[str, dict[str, Any]]:
        """The next event, and its key."""
        sample = self.samples.get(timeout=DEADLINE_S)
        return str(sample.key_expr), json.loads(sample.payload.to_bytes())

    def token(self) -> tuple[str, bool]:
        """The next token that comes (True) or goes."""
        return self.tokens.get(timeout=DEADLINE_S)

    def get(self, key: str) -> dict[str, Any]:
        """What is answered to a question."""
        replies = self.client.get(key)
        return {str(reply.ok.key_expr): json.loads(reply.ok.payload.to_bytes()) for reply in replies if reply.ok}

    def publisher(self, key: str) -> Any:
        """For what somebody else than this site hears: its router knows of it."""
        publisher = self.client.declare_publisher(key, allowed_destination=zenoh.Locality.REMOTE)
        wait(lambda: publisher.matching_status.matching)
        return publisher

    def close(self) -> None:
        self.client.close()
        self.router.close()


def begin(bridge: Callable[..., Process], site: Site, daemon: Any, *more: object) -> Process:
    """A bridge of the site `car`."""
    path = daemon.path if isinstance(daemon, FakeDaemon) else daemon.socket
    return bridge("zenoh", "--connect", site.endpoint, "--site", "car", "--socket", path, *more)
