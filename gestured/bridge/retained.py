"""The messages that an MQTT broker retains of one machine: availability, states of sensors, and discovery.

With Home Assistant's MQTT discovery, sensors and gestures appear there by themselves. Each sensor is a device with an
`event` entity and a device trigger for each gesture, since event entities alone give no triggers in the editor of
automations (home-assistant/core#158789). A binary sensor shows whether the sensor listens. If this bridge has a gate,
a switch closes and opens it. The keys are those of home-assistant.io/integrations/event.mqtt, device_trigger.mqtt,
binary_sensor.mqtt and switch.mqtt.
"""

import json
from collections.abc import Iterator, Sequence
from typing import Any

from gestured.bridge.broker import topic_of
from gestured.bridge.daemon import Daemon
from gestured.bridge.gates import OFF, ON
from gestured.bridge.options import plain

# The template by which the event entity reads a gesture's line: its type and some attributes.
EVENT = (
    "{{ {'event_type': value_json.gesture, 'confidence': value_json.confidence, 'sequence': value_json.sequence,"
    " 'instance': value_json.instance} | tojson }}"
)

OPEN: dict[str, Any] = {"armed": None, "closed": [], "until": None}  # a sensor of which the daemon tells nothing
LISTENS = "{{ 'ON' if not value_json.closed and value_json.armed != false else 'OFF' }}"


class Retained:
    """What a broker should retain, and what it is known to retain."""

    def __init__(self, daemon: Daemon, host: str, prefix: str, gate: str | None = None, *, discovers: bool) -> None:
        """`prefix` is Home Assistant's discovery prefix; `discovers`: whether anything is published there.

        `gate` is the name of the gate that the broker's clients can close and open, if any.
        """
        self._gate = gate
        self._daemon, self._host, self._prefix, self._discovers = daemon, host, prefix, discovers
        self._kept: dict[str, str | None] = {}  # by topic: the retained payload; None if it is not known

    def forget(self, *topics: str) -> None:
        """Forget what is retained at these topics (none: at all), so that it is published again."""
        self._kept |= dict.fromkeys(topics or self._kept)

    def changes(self) -> Iterator[tuple[str, str]]:
        """(topic, payload) of each message to publish; an empty payload makes the broker forget a topic.

        Each counts as retained by the broker at once, so the generator may be replaced by a new one at any time.
        """
        wanted = self._wanted()
        for topic, payload in wanted.items():
            if self._kept.get(topic) != payload:
                self._kept[topic] = payload
                yield topic, payload
        for topic in self._kept.keys() - wanted.keys():  # of forgotten gestures and sensors
            del self._kept[topic]
            yield topic, ""

    def _wanted(self) -> dict[str, str]:
        """By topic: the payload that the broker should retain now."""
        daemon = self._daemon
        wanted = {topic_of(self._host, "availability"): "online" if daemon.hello else "offline"}
        for sensor, state in daemon.states.items():
            wanted[topic_of(self._host, sensor, "state")] = state
            gates = daemon.listening.get(sensor, OPEN)
            until = gates.get("until")  # rounded, since the daemon computes it for each status from two clocks
            told = json.dumps({**gates, "until": until and round(until, 1)})
            wanted[topic_of(self._host, sensor, "gates")] = told
            if self._discovers and daemon.gestures:
                found = self._discovery(sensor, daemon.gestures)
                wanted |= {topic: json.dumps(payload) for topic, payload in found}
        return wanted

    def _discovery(self, sensor: str, gestures: Sequence[str]) -> Iterator[tuple[str, dict[str, Any]]]:
        """(topic, payload) of each discovery message of a sensor."""
        prefix, host, gate, version = self._prefix, self._host, self._gate, self._daemon.version
        base = f"gestured/{host}"
        node = f"gestured_{host}"
        # Names of machines and sensors may contain "_", so two pairs joined by it could be one id; none contains "/".
        # Sensors of a machine without "_" in its name keep the ids that they have always had.
        ours = f"{node}{'/' if '_' in host else '_'}{sensor}"
        common = {
            "device": {
                "identifiers": [ours],
                "name": f"{sensor} on {host}",
                "manufacturer": "gestured",
                "model": "tactile sensor",
                "sw_version": version,
            },
            "origin": {"name": "gestured", "sw_version": version},
            "qos": 1,
        }
        event = {
            "name": "Gesture",
            "unique_id": f"{ours}_gesture",
            "state_topic": f"{base}/{sensor}/gesture",
            "event_types": list(gestures),
            "value_template": EVENT,
            "availability_topic": f"{base}/availability",
        }
        yield f"{prefix}/event/{node}/{sensor}/config", event | common
        gates = {"state_topic": f"{base}/{sensor}/gates", "availability_topic": f"{base}/availability"}
        listens = {
            "name": "Listens",
            "unique_id": f"{ours}_listens",
            "value_template": LISTENS,
            "json_attributes_topic": f"{base}/{sensor}/gates",
        }
        yield f"{prefix}/binary_sensor/{node}/{sensor}/config", listens | gates | common
        if gate is not None:
            switch = {
                "name": f"Gate {gate}",
                "unique_id": f"{ours}_gate_{gate}",
                "command_topic": f"{base}/{sensor}/gate/set",
                "payload_on": ON,
                "payload_off": OFF,
                "value_template": f"{{{{ 'OFF' if '{gate}' in value_json.closed else 'ON' }}}}",
            }
            yield f"{prefix}/switch/{node}/{sensor}/config", switch | gates | common
        for gesture in gestures:
            trigger = {
                "automation_type": "trigger",
                "topic": f"{base}/{sensor}/gesture",
                "type": "gesture",
                "subtype": gesture,
                "payload": gesture,
                "value_template": "{{ value_json.gesture }}",
            }
            yield f"{prefix}/device_automation/{node}/{sensor}-{plain(gesture)}/config", trigger | common
