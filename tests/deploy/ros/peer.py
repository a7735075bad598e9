"""A node on the other side, run by ROS 2's Python: commands on standard input, and on standard output what it hears.

{"listen": TOPIC, "latched": false}              each message of the topic: {"topic": TOPIC, "data": its JSON}
{"listen": TOPIC, ..., "message": "Gesture"}     the same of gestured_msgs: {"topic": TOPIC, "data": its fields}
{"image": TOPIC, "height": 9, ..., "data": hex}  publishes an image once somebody listens
{"call": SERVICE, "data": true}                  {"call": SERVICE, "success": true, "message": "..."}
{"invalid": [NAMES]}                             {"invalid": those that ROS does not take as topics}
"""

import importlib
import json
import sys
import threading
from typing import Any

import rclpy
import rclpy.exceptions
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.validate_topic_name import validate_topic_name
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import SetBool


def say(**line: object) -> None:
    print(json.dumps(line), flush=True)


class Peer(Node):  # type: ignore[misc]  # what rclpy brings has no types
    def __init__(self) -> None:
        super().__init__("peer")
        self._images: dict[str, Any] = {}
        self._commands: list[dict[str, Any]] = []
        self.ended = False
        self._woken = self.create_guard_condition(self._obey)
        self._again = self.create_timer(0.02, self._obey)  # for what has to wait for somebody else
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in sys.stdin:
            self._commands.append(json.loads(line))
            self._woken.trigger()
        self.ended = True
        self._woken.trigger()

    def _obey(self) -> None:
        while self._commands and self._done(self._commands[0]):
            self._commands.pop(0)

    def _done(self, command: dict[str, Any]) -> bool:
        """Whether a command could be obeyed; if not it is tried again."""
        match command:
            case {"listen": topic, "latched": latched}:
                durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
                name = command.get("message")
                kind = getattr(importlib.import_module("gestured_msgs.msg"), name) if name else String

                def hear(message: Any) -> None:
                    say(topic=topic, data=json.loads(message.data) if kind is String else plain(message))

                self.create_subscription(kind, topic, hear, QoSProfile(depth=100, durability=durability))
            case {"image": topic, **fields}:
                if topic not in self._images:
                    self._images[topic] = self.create_publisher(Image, topic, 10)
                if not self._images[topic].get_subscription_count():
                    return False
                image = Image(**{name: value for name, value in fields.items() if name not in ("data", "stamp")})
                image.data = bytes.fromhex(fields["data"])
                image.header.stamp.sec, image.header.stamp.nanosec = fields.get("stamp", (0, 0))
                self._images[topic].publish(image)
            case {"call": service, "data": data}:
                client = self.create_client(SetBool, service)
                if not client.service_is_ready():
                    self.destroy_client(client)
                    return False

                def answered(future: Any) -> None:
                    say(call=service, success=future.result().success, message=future.result().message)

                client.call_async(SetBool.Request(data=data)).add_done_callback(answered)
            case {"invalid": names}:
                say(invalid=[name for name in names if not taken(name)])
        return True


def plain(value: Any) -> Any:
    """A message as its fields."""
    if not hasattr(value, "get_fields_and_field_types"):
        return value
    return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}


def taken(name: str) -> bool:
    try:
        return bool(validate_topic_name(name))
    except rclpy.exceptions.InvalidTopicNameException:
        return False


rclpy.init()
peer = Peer()
say(ready=True)
while rclpy.ok() and not peer.ended:
    rclpy.spin_once(peer)
