"""The node `gestured`: a daemon's events as topics and, by parameters, frames from topics and gates as services."""

import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import SetBool

from gestured.bridge.counts import Counts
from gestured.bridge.daemon import GONE, NOTICE_S, OLD_S, Daemon, Line, follow
from gestured.bridge.gates import OFF, ON, Gate
from gestured.bridge.ros_names import token
from gestured.client.address import named
from gestured.client.sensor import Form, connected, sent_after_refusal
from gestured.client.subscriber import Subscriber
from gestured.core.address import Address, is_sensor
from gestured.core.errors import GesturedError, SettingsError
from gestured.core.frames import Frame

from .frames import values_of
from .messages import filled, own_messages

EVENTS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Best effort fits reliable publishers of frames, too; the depth keeps frames while this machine is busy.
FRAMES = QoSProfile(depth=64, reliability=ReliabilityPolicy.BEST_EFFORT)
WAITING = 1000  # the most lines of the daemon that wait for this node; then the oldest is lost
SENSORS = 1000  # the most sensors that have topics, since any sender of frames can invent names
WARNED_S = 10.0  # from one warning of a kind to the next
NONE = [""]  # stands for an empty list of texts, which as the value of a parameter would have no type


class Gestures(Node):  # type: ignore[misc]  # rclpy has no types
    """Mirrors one daemon. One thread spins, and alone calls ROS; another one reads the daemon's socket."""

    def __init__(self) -> None:
        """Raises GesturedError for parameters that cannot be used."""
        super().__init__("gestured")
        self.fault: GesturedError | None = None  # why the node has ended by itself
        self.ended = Future()  # done as soon as the node is to end
        path, gates = self._text("socket", "/run/gestured/events.sock"), self._text("gates")
        self._types = self._texts("types", ["gesture"])
        sensors, gestures = self._texts("sensors"), self._texts("gestures")
        self._counts = counts = _Counts(self.get_logger())
        gate = _sensor("gate", self._text("gate", "ros"))
        self._gate = Gate(Path(gates), gate, counts) if gates else None
        self._daemon = Daemon(sensors or None, gestures or None, counts)
        self._own = own_messages() if self.declare_parameter("messages", False).value else {}
        self._status = self._publisher("status", "~/status", LATEST)
        self._topics: dict[tuple[str, str], Any] = {}  # publishers by sensor and type of event
        self._with_topics: set[str] = set()  # sensors whose topics were made
        self._take_frames(self._texts("frames"), _address("to", self._text("to", "127.0.0.1:9000")))
        self._say_gone()
        self._lines: deque[Line] = deque(maxlen=WAITING)
        self._woken = self.create_guard_condition(self._take)
        self._subscriber = Subscriber(
            path,
            types=[*dict.fromkeys([*self._types, "status"])],
            sensors=sensors or None,
            gestures=gestures or None,
            timeout=NOTICE_S,
            say=counts.say,
        )
        self._thread = threading.Thread(target=self._hear, args=(counts,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the subscription and its thread."""
        self._subscriber.close()
        self._thread.join()

    def _text(self, name: str, default: str = "") -> str:
        return str(self.declare_parameter(name, default).value)

    def _texts(self, name: str, default: list[str] = NONE) -> list[str]:
        return [text for text in self.declare_parameter(name, default).value if text]

    def _hear(self, counts: Counts) -> None:
        try:
            for line in follow(self._subscriber, counts):
                self._lines.append(line)
                self._woken.trigger()
        except GesturedError as error:  # such as a refused subscription, for which waiting does not help
            self.fault = error
            self._woken.trigger()

    def _take(self) -> None:
        """Take the lines that the daemon has sent, and publish them."""
        while self._lines:
            line = self._lines.popleft()
            self._daemon.take(line)
            if "sensor" in line:
                age = self._daemon.age(line, time.time())
                if age > OLD_S:
                    words = f"a {line['type']} of {line['sensor']} is dropped: it is {age:.1f} s old"
                    self.get_logger().warning(words, throttle_duration_sec=WARNED_S)
                else:
                    self._publish(line)
            elif line["type"] == "status":
                self._send(self._status, line)
                if self._gate is not None and self._daemon.is_silent_by(self._gate.name):
                    self._gate.renew()
            elif line["type"] == GONE:
                self._say_gone()
            for sensor in self._daemon.states:  # before its first gesture, so that it has subscribers then
                self._make_topics(sensor)
        if self.fault is not None:
            self.get_logger().fatal(str(self.fault))
            self.ended.set_result(None)

    def _say_gone(self) -> None:
        """Publish the status "gone", which late subscribers get while no daemon is there."""
        self._send(self._status, {"type": "status", "state": GONE, "sensors": {}, "time": time.time()})

    def _publisher(self, kind: str, topic: str, qos: QoSProfile) -> Any:
        return self.create_publisher(self._own.get(kind, String), topic, qos)

    def _send(self, publisher: Any, event: Line) -> None:
        """Publish an event as its topic's message."""
        if publisher.msg_type is String:
            publisher.publish(String(data=self._daemon.payload(event).decode()))
            return
        told = {**event, "states": [*event.get("sensors", {}).values()], "instance": self._daemon.hello.get("instance")}
        try:
            publisher.publish(filled(publisher.msg_type(), told))
        except ValueError as error:
            self._counts.wrong(f"a {event['type']} of the daemon is passed over: {error}")

    def _make_topics(self, sensor: str) -> None:
        if sensor in self._with_topics or len(self._with_topics) >= SENSORS:
            return
        self._with_topics.add(sensor)
        for kind in self._types:
            if kind != "status":
                self._topics[sensor, kind] = self._publisher(kind, f"~/{token(sensor)}/{kind}", EVENTS)
        if self._gate is not None:
            self.create_service(SetBool, f"~/{token(sensor)}/listen", partial(self._listen, self._gate, sensor))

    def _publish(self, event: Line) -> None:
        sensor, kind = event["sensor"], event["type"]
        self._make_topics(sensor)
        if (sensor, kind) not in self._topics and sensor in self._with_topics:  # an answer to a provisional event
            self._topics[sensor, kind] = self._publisher(kind, f"~/{token(sensor)}/{kind}", EVENTS)
        if (sensor, kind) in self._topics:
            self._send(self._topics[sensor, kind], event)

    def _listen(self, gate: Gate, sensor: str, request: Any, response: Any) -> Any:
        """Open or close this node's gate of a sensor: the callback of a service."""
        try:
            closed = gate.obey(sensor, ON if request.data else OFF)
            response.success, response.message = True, f"closed: {', '.join(closed)}" if closed else "it listens"
        except GesturedError as error:
            response.message = str(error)
        return response

    def _take_frames(self, sensors: list[str], to: Address) -> None:
        """Subscribe to the frames of these sensors, and send them to the daemon."""
        if not sensors:
            return
        udp = connected(to)
        udp.setblocking(False)
        for sensor in sensors:
            topic = f"~/{token(_sensor('frames', sensor))}/frames"
            self.create_subscription(Image, topic, self._forwarder(sensor, udp, to), FRAMES)

    def _forwarder(self, sensor: str, udp: socket.socket, to: Address) -> Callable[[Any], None]:
        form, counter = Form(sensor, "float32"), 0
        warn = partial(self.get_logger().warning, throttle_duration_sec=WARNED_S)

        def forward(image: Any) -> None:
            nonlocal counter
            try:
                values = values_of(image)
            except ValueError as error:
                warn(f"an image for {sensor} is dropped: {error}")
                return
            counter += 1  # `form` wraps it, as the daemon expects
            stamp = image.header.stamp
            moment = stamp.sec + 1e-9 * stamp.nanosec or None
            try:
                heard = not sent_after_refusal(udp, form.packet(Frame(0.0, values), counter, moment))
            except OSError:  # the network is down, or its queue is full
                heard = False
            if not heard:
                warn(f"nobody takes frames at {to}: start gestured, or name the parameter `to`")

        return forward


class _Counts(Counts):
    """The counters of this bridge, which write to the log of ROS."""

    def __init__(self, logger: Any) -> None:
        super().__init__("ros2")
        self._logger = logger

    def say(self, words: str) -> None:
        self._logger.info(words)


def _sensor(parameter: str, name: str) -> str:
    if not is_sensor(name):
        raise SettingsError(f"parameter {parameter}: {name!r}: expected letters, digits, _ and -, at most 64")
    return name


def _address(parameter: str, text: str) -> Address:
    try:
        return named(text)
    except ValueError as error:
        raise SettingsError(f"parameter {parameter}: {text!r}: expected {error}") from None


def main() -> int:
    """Run the node until it is ended; returns the exit status, which is 1 if waiting does not help."""
    # A thread waits for signals, since rclpy's own handlers cause a traceback before the node spins.
    told, tells = socket.socketpair()
    tells.setblocking(False)
    signal.set_wakeup_fd(tells.fileno())
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = Gestures()
    except (GesturedError, InvalidParameterTypeException, OSError) as error:
        rclpy.logging.get_logger("gestured").fatal(str(error))
        rclpy.try_shutdown()
        return 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=_end_when_told, args=(node.ended, told), daemon=True).start()
    try:
        executor.spin_until_future_complete(node.ended)
    except ExternalShutdownException:  # rclpy was shut down from outside
        pass
    finally:
        node.close()
        rclpy.try_shutdown()
    return 0 if node.fault is None else 1


def _end_when_told(ended: Any, told: socket.socket) -> None:
    told.recv(1)
    ended.set_result(None)
