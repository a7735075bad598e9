"""The counters of a bridge, its log, and its metrics for Prometheus."""

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from gestured.bridge.options import BridgeError
from gestured.client.notify import notify
from gestured.client.say import say, say_json
from gestured.core.address import Address
from gestured.core.errors import GesturedError

HELP = {
    "events": "Events of the daemon, by what became of them",
    "frames": "Frames on their way to the daemon, by what became of them",
    "commands": "Commands of the other side, by what became of them",
    "bytes": "Bytes from a serial line that belong to no frame",
    "connected": "Whether the other side is there",
    "reconnects": "How often the other side was found again",
}
ASK_S = 5.0  # the longest wait for more of a request for metrics, since a connection costs a thread and a descriptor


class Counts:
    """The numbers of one bridge, by name and label. `connected` is a gauge, the others are counters."""

    def __init__(self, bridge: str) -> None:
        self.bridge = bridge
        self.values: Counter[tuple[str, str]] = Counter()
        self._words: dict[str, str] = {}  # by side, such as "broker": its state in words, for systemd's status line
        self._ready = False
        self._metrics: str | None = None  # HOST:PORT of /metrics, if they are served

    def add(self, name: str, label: str, count: int = 1) -> None:
        """Add `count` to the number of that name and label."""
        self.values[name, label] += count

    def say(self, words: str) -> None:
        """Write a line to the log."""
        say(f"gestured-bridge {self.bridge}: {words}", to=sys.stderr)

    def wrong(self, words: str, name: str = "events", label: str = "wrong") -> None:
        """Count a line that no daemon sends, or a command that is ignored, and log the first."""
        if (name, label) not in self.values:
            self.say(words)
        self.add(name, label)

    def connected(self, side: str, is_there: bool, words: str) -> None:
        """Take note of whether a side is there now, and log `words` if that has changed."""
        key = ("connected", side)
        if key in self.values and self.values[key] == is_there:
            return
        if is_there and key in self.values:
            self.add("reconnects", side)
        self.values[key] = is_there
        self.say(words)
        self._words[side] = words
        here = all(self.values["connected", each] for each in self._words)
        # gesturectl doctor reads the first word of STATUS. READY=1 means started, even if a side is not there.
        notify(f"READY=1\nSTATUS={'connected' if here else 'waiting'}: {'; '.join(self._words.values())}")

    def ready(self, **where: object) -> None:
        """Print once that the bridge works, as a line of JSON on standard output."""
        if not self._ready:
            self._ready = True
            with suppress(GesturedError, BrokenPipeError):  # events go on, though nobody reads this or the disk is full
                say_json({"type": "ready", "bridge": self.bridge, **where, "metrics": self._metrics})

    def serve(self, address: Address | None) -> None:
        """Answer /metrics in a thread of its own, if an address is given. Raises BridgeError."""
        if address is None:
            return
        import prometheus_client
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        counts = self

        class Collector:
            def collect(self) -> Iterator[Any]:
                found: dict[str, Any] = {}
                for (name, label), value in list(counts.values.items()):
                    kind = GaugeMetricFamily if name == "connected" else CounterMetricFamily
                    key = "to" if name in ("connected", "reconnects") else "result"
                    if name not in found:
                        found[name] = kind(f"gestured_bridge_{name}", HELP[name], labels=["bridge", key])
                    found[name].add_metric([counts.bridge, label], value)
                yield from found.values()

        registry = prometheus_client.CollectorRegistry()
        registry.register(Collector())
        try:
            server, _ = prometheus_client.start_http_server(address.port, address.host, registry)
        except OSError as error:
            raise BridgeError(f"--metrics {address}: {error.strerror}: choose another address") from None
        server.RequestHandlerClass.timeout = ASK_S  # type: ignore[attr-defined]
        server.handle_error = lambda *_: None  # type: ignore[method-assign] # a slow client is no bug
        self._metrics = str(Address(address.host, server.server_port))
