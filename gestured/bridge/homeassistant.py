"""Home Assistant's MQTT discovery: what is published so that sensors and gestures appear there by themselves.

For each sensor one device with an `event` entity, and a device trigger for each gesture: event entities alone give no
triggers in the editor of automations (home-assistant/core#158789). The keys are those of
home-assistant.io/integrations/event.mqtt and home-assistant.io/integrations/device_trigger.mqtt.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from gestured.bridge.options import plain

# What the event entity makes of a gesture's line: what it is, and some of what is known of it.
EVENT = (
    "{{ {'event_type': value_json.gesture, 'confidence': value_json.confidence, 'sequence': value_json.sequence,"
    " 'instance': value_json.instance} | tojson }}"
)


def discovery(
    prefix: str, host: str, version: str, sensor: str, gestures: Sequence[str]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """(topic, payload) of all that a sensor has; `prefix` is Home Assistant's discovery prefix."""
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
