"""What an MQTT broker retains of one machine: whether its daemon is there, how each sensor is, and discovery.

By Home Assistant's MQTT discovery sensors and gestures appear there by themselves. For each sensor it has one device
with an `event` entity, and a device trigger for each gesture: event entities alone give no triggers in the editor of
automations (home-assistant/core#158789). A binary sensor says whether the sensor listens; where this bridge has a gate,
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

# What the event entity makes of a gesture's line: what it is, and some of what is known of it.
EVENT = (
    "{{ {'event_type': value_json.gesture, 'confidence': value_json.confidence, 'sequence': value_json.sequence,"
    " 'instance': value_json.instance} | tojson }}"
)

OPEN: dict[str, Any] = {"armed": None, "closed": [], "until": None}  # of a sensor of which a daemon says nothing else
LISTENS = "{{ 'ON' if not value_json.closed and value_json.armed != false else 'OFF' }}"


class Retained:
    """What a broker should retain, and what it does as far as is known."""

    def __init__(self, daemon: Daemon, host: str, prefix: str, gate: str | None = None, *, discovers: bool) -> None:
        """`prefix` is Home Assistant's discovery prefix; `discovers`: whether anything is published there.

        `gate` is the name of the gate that can be closed and opened from there, if any.
        """
        self._gate = gate
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
            wanted[topic_of(self._host, sensor, "gates")] = json.dumps(daemon.listening.get(sensor, OPEN))
            if self._discovers and daemon.gestures:
                found = self._discovery(sensor, daemon.gestures)
                wanted |= {topic: json.dumps(payload) for topic, payload in found}
        return wanted

    def _discovery(self, sensor: str, gestures: Sequence[str]) -> Iterator[tuple[str, dict[str, Any]]]:
        """(topic, payload) of all that Home Assistant learns of a sensor."""
        prefix, host, gate, version = self._prefix, self._host, self._gate, self._daemon.version
        base = f"gestured/{host}"
        node = f"gestured_{host}"
        common = {
            "device": {
                "identifiers": [f"{node}_{sensor}"],
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
            "unique_id": f"{node}_{sensor}_gesture",
            "state_topic": f"{base}/{sensor}/gesture",
            "event_types": list(gestures),
            "value_template": EVENT,
            "availability_topic": f"{base}/availability",
        }
        yield f"{prefix}/event/{node}/{sensor}/config", event | common
        gates = {"state_topic": f"{base}/{sensor}/gates", "availability_topic": f"{base}/availability"}
        listens = {
            "name": "Listens",
            "unique_id": f"{node}_{sensor}_listens",
            "value_template": LISTENS,
            "json_attributes_topic": f"{base}/{sensor}/gates",
        }
        yield f"{prefix}/binary_sensor/{node}/{sensor}/config", listens | gates | common
        if gate is not None:
            switch = {
                "name": f"Gate {gate}",
                "unique_id": f"{node}_{sensor}_gate_{gate}",
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
