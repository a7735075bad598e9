"""What is published on the buses in the container: a router of Zenoh, and a subscriber there and at the MQTT broker.

`python -m tests.systemd.bus` prints "ready", and then a line of JSON for each message: `[bus, key, text]`.
"""

import json
import queue

import paho.mqtt.client as mqtt
import zenoh
from paho.mqtt.enums import CallbackAPIVersion

from tests.bridge.zenoh_site import opened

ROUTER = "tcp/127.0.0.1:7447"


def main() -> None:
    """Print until it is killed."""
    found: queue.Queue[tuple[str, str, str]] = queue.Queue()

    def event(sample: zenoh.Sample) -> None:
        found.put(("zenoh", str(sample.key_expr), sample.payload.to_string()))

    def token(sample: zenoh.Sample) -> None:
        there = sample.kind == zenoh.SampleKind.PUT
        found.put(("zenoh", str(sample.key_expr), "online" if there else "offline"))

    client = mqtt.Client(CallbackAPIVersion.VERSION2, protocol=mqtt.MQTTv5)
    client.on_connect = lambda client, *_: client.subscribe("gestured/#", qos=1)
    client.on_subscribe = lambda *_: print("ready", flush=True)
    client.on_message = lambda _, __, message: found.put(("mqtt", message.topic, message.payload.decode()))
    with opened("router", listen=ROUTER), opened("client", connect=ROUTER) as session:
        events = session.declare_subscriber("gestured/*/*/gesture", event)
        tokens = session.liveliness().declare_subscriber("gestured/*/alive", token)
        client.connect("127.0.0.1", 1883)
        client.loop_start()
        with events, tokens:
            while True:
                print(json.dumps(found.get()), flush=True)


if __name__ == "__main__":
    main()
