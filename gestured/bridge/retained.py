"""What an MQTT broker retains of one machine: whether its daemon is there, how each sensor is, and discovery."""

import json
from collections.abc import Iterator

from gestured.bridge import homeassistant
from gestured.bridge.broker import topic_of
from gestured.bridge.daemon import Daemon


class Retained:
    """What a broker should retain, and what it does as far as is known."""

    def __init__(self, daemon: Daemon, host: str, prefix: str, *, discovers: bool) -> None:
        """`prefix` is Home Assistant's discovery prefix; `discovers`: whether anything is published there."""
        self._daemon, self._host, self._prefix, self._discovers = daemon, host, prefix, discovers
        self._kept: dict[str, str | None] = {}  # topic -> what the broker retains of ours; None where that is not known

    def forget(self) -> None:
        """Another connection: the broker may have lost what it retained."""
        self._kept = dict.fromkeys(self._kept)

    def changes(self) -> Iterator[tuple[str, str]]:
        """(topic, payload) of what the broker has to learn, an empty payload where it has to forget.

        A pair counts as learned by the broker as soon as the generator is asked for the next pair.
        """
        wanted = self._wanted()
        for topic, payload in wanted.items():
            if self._kept.get(topic) != payload:
                yield topic, payload
                self._kept[topic] = payload
        for topic in self._kept.keys() - wanted.keys():  # a gesture that was forgotten, a sensor that was let go
            yield topic, ""
            del self._kept[topic]

    def _wanted(self) -> dict[str, str]:
        """Topic -> what the broker should retain now."""
        daemon = self._daemon
        wanted = {topic_of(self._host, "availability"): "online" if daemon.hello else "offline"}
        for sensor, state in daemon.states.items():
            wanted[topic_of(self._host, sensor, "state")] = state
            if self._discovers and daemon.gestures:
                found = homeassistant.discovery(self._prefix, self._host, daemon.version, sensor, daemon.gestures)
                wanted |= {topic: json.dumps(payload) for topic, payload in found}
        return wanted
