"""The node `gestures`: each gesture as `std_msgs/String` under gestures/SENSOR. It has not been run (README.md)."""

import json
import threading
from typing import Any

import rclpy
from rclpy.node import Node
from std_msgs.msg import String

import gestured

KEPT = 10  # messages for a slow subscriber
SENSORS = 1000  # publishers at most: whoever can send frames can invent names


class Gestures(Node):  # type: ignore[misc]  # rclpy is in no package registry
    """Publishes what a daemon says; its parameter `socket` is the daemon's event socket."""

    def __init__(self) -> None:
        super().__init__("gestured")
        path = self.declare_parameter("socket", "/run/gestured/events.sock").value
        self._to: dict[str, Any] = {}
        self.subscriber = gestured.Subscriber(path, types=["gesture"])
        self._thread = threading.Thread(target=self._hear, daemon=True)
        self._thread.start()

    def _hear(self) -> None:
        try:
            for event in self.subscriber:
                if event["type"] == "gesture":
                    self._publish(event)
        except gestured.GesturedError as error:  # what waiting does not heal
            self.get_logger().fatal(str(error))
            rclpy.try_shutdown()

    def _publish(self, event: dict[str, Any]) -> None:
        sensor = event["sensor"]
        if sensor not in self._to and len(self._to) < SENSORS:
            topic = "gestures/" + "".join(c if c.isalnum() else "_" for c in sensor)  # ROS takes no hyphen
            self._to[sensor] = self.create_publisher(String, topic, KEPT)
        if sensor in self._to:
            self._to[sensor].publish(String(data=json.dumps(event)))


def main() -> None:
    """Run the node until it is ended."""
    rclpy.init()
    node = Gestures()
    try:
        rclpy.spin(node)
    finally:
        node.subscriber.close()
