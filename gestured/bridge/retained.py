"""What an MQTT broker retains of one machine: whether its daemon is there, how each sensor is, and discovery."""

import json
from collections.abc import Iterator

from gestured.bridge import homeassistant
from gestured.bridge.broker import topic_of
from gestured.bridge.daemon import Daemon

MOST_FOUND = 100_000  # topics of earlier bridges that are remembered; whoever may write at the broker can invent some


class Retained:
    """What a broker should retain, and what it does as far as is known."""

    def __init__(self, daemon: Daemon, host: str, prefix: str, *, discovers: bool) -> None:
        """`prefix` is Home Assistant's discovery prefix; `discovers`: whether anything is published there."""
        self._daemon, self._host, self._prefix, self._discovers = daemon, host, prefix, discovers
        self._kept: dict[str, str] = {}  # topic -> what the broker retains of this connection's
        self._found: dict[str, str | None] = {}  # topic of discovery that was there before us -> its gesture

    def forget(self) -> None:
        """Another connection: nothing is known of what the broker retains."""
        self._kept.clear()
        self._found.clear()

    @property
    def filters(self) -> list[str]:
        """Where earlier bridges of this machine may have left discovery."""
        return homeassistant.mine(self._prefix, self._host)

    def find(self, topic: str, payload: bytes) -> bool:
        """The broker has this at one of `filters`; returns whether it may have to be cleared."""
        if not payload or len(self._found) >= MOST_FOUND:
            return False
        self._found[topic] = homeassistant.gesture_of(payload)
        return True

    def changes(self) -> Iterator[tuple[str, str]]:
        """(topic, payload) of what the broker has to learn, an empty payload where it has to forget.

        What was given counts as learned when the next is asked for.
        """
        wanted = self._wanted()
        for topic, payload in wanted.items():
            if self._kept.get(topic) != payload:
                yield topic, payload
                self._kept[topic] = payload
        for topic in self._obsolete(wanted):
            yield topic, ""
            self._kept.pop(topic, None)
            self._found.pop(topic, None)

    def _wanted(self) -> dict[str, str]:
        """Topic -> what the broker should retain now."""
        daemon = self._daemon
        wanted = {topic_of(self._host, "availability"): "online" if daemon.hello else "offline"}
        for sensor, state in daemon.states.items():
            wanted[topic_of(self._host, sensor, "state")] = state
            if self._discovers and daemon.gestures:
                version = daemon.hello.get("version", "")
                found = homeassistant.discovery(self._prefix, self._host, version, sensor, daemon.gestures)
                wanted |= {topic: json.dumps(payload) for topic, payload in found}
        return wanted

    def _obsolete(self, wanted: dict[str, str]) -> list[str]:
        """Topics of what is gone: gestures that were forgotten, also while no bridge ran. Sensors may come back."""
        known = self._daemon.gestures
        gone = [topic for topic in self._kept if topic not in wanted]
        for topic, gesture in self._found.items():
            forgotten = known is not None and gesture is not None and gesture not in known
            if topic not in wanted and topic not in gone and (forgotten or not self._discovers):
                gone.append(topic)
        return gone
