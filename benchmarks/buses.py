"""Bridges: how much later an event arrives over a bus than at the Unix socket, and what one Zenoh router carries."""

import json
import queue
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.timing import Row, cpu_s_of, percentile, ratio
from gestured.client.control import Control
from gestured.client.engine import Engine
from gestured.client.subscriber import Subscriber

EVENTS = 200  # that each bus carries
PAUSE_S = 0.02  # s between two events, so that neither delays the other
NAMES = 10_000  # sensors whose events one router carries
PATIENCE_S = 20.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def process(*command: str) -> Iterator["subprocess.Popen[str]"]:
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as started:
        try:
            yield started
        finally:
            started.terminate()


@contextmanager
def bridge(*flags: str) -> Iterator[None]:
    """Run a bridge; the context is entered once it is connected to both sides."""
    with process(sys.executable, "-m", "gestured.bridge", *flags) as started:
        assert started.stdout is not None and started.stdout.readline()
        yield


def session(mode: str, key: str, endpoint: str) -> Any:
    import zenoh

    config = zenoh.Config()
    settings = {"mode": mode, key: [endpoint], "scouting/multicast/enabled": False, "scouting/gossip/enabled": False}
    if mode == "client":
        settings["listen/endpoints"] = []
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    return zenoh.open(config)


@contextmanager
def over_socket(path: Path) -> Iterator["queue.Queue[float]"]:
    """A queue of the times (monotonic s) at which gestures arrive at the Unix socket."""
    heard: queue.Queue[float] = queue.Queue()

    def hear() -> None:
        for event in subscriber:
            if event["type"] == "gesture":
                heard.put(time.monotonic())

    with Subscriber(path) as subscriber:
        thread = threading.Thread(target=hear)
        thread.start()
        yield heard
        subscriber.close()
        thread.join()


@contextmanager
def over_mqtt(path: Path) -> Iterator["queue.Queue[float]"]:
    import paho.mqtt.client as mqtt
    from paho.mqtt.enums import CallbackAPIVersion

    program = shutil.which("mosquitto", path="/usr/sbin:/usr/bin")
    if program is None:
        raise ImportError("mosquitto is not installed")
    heard: queue.Queue[float] = queue.Queue()
    port = free_port()
    with process(program, "-p", str(port)), ExitStack() as stack:
        client = mqtt.Client(CallbackAPIVersion.VERSION2, protocol=mqtt.MQTTv5)
        client.on_message = lambda *_: heard.put(time.monotonic())
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                client.connect("127.0.0.1", port)
                break
            except OSError:
                assert time.monotonic() < end
                time.sleep(0.05)
        client.subscribe("gestured/+/+/gesture", qos=1)
        client.loop_start()
        stack.callback(client.loop_stop)
        stack.enter_context(bridge("mqtt", "--broker", f"127.0.0.1:{port}", "--socket", str(path)))
        yield heard


@contextmanager
def over_zenoh(path: Path) -> Iterator["queue.Queue[float]"]:
    heard: queue.Queue[float] = queue.Queue()
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with session("router", "listen/endpoints", endpoint), session("client", "connect/endpoints", endpoint) as client:
        hears = client.declare_subscriber("gestured/*/*/gesture", lambda _: heard.put(time.monotonic()))
        with bridge("zenoh", "--connect", endpoint, "--socket", str(path)):
            yield heard
        hears.undeclare()


def delays(model: str) -> dict[str, list[float]]:
    """By bus, milliseconds from an operator's `emit` to its event; each `emit` reaches all buses."""
    found: dict[str, list[float]] = {"Unix socket": [], "MQTT": [], "Zenoh": []}
    with Engine(model, 9, 9) as engine, ExitStack() as stack:
        buses = {
            "Unix socket": stack.enter_context(over_socket(engine.socket)),
            "MQTT": stack.enter_context(over_mqtt(engine.socket)),
            "Zenoh": stack.enter_context(over_zenoh(engine.socket)),
        }
        control = stack.enter_context(Control(engine.socket.with_suffix(".ctl")))
        for _ in range(EVENTS):
            begin = time.monotonic()
            control.ask("emit", gesture="swipe_left", sensor="bench")
            for name, heard in buses.items():
                found[name].append(1e3 * (heard.get(timeout=PATIENCE_S) - begin))
            time.sleep(PAUSE_S)
    return found


def latency(model: str) -> list[Row]:
    """A row for each bus: its delay beside that of the Unix socket, event by event."""
    found = delays(model)
    base = found.pop("Unix socket")
    rows = []
    for name, values in found.items():
        ours = f"{median(values):.2f} ms (99 %: {percentile(values, 0.99):.2f})"
        against = f"Unix socket {median(base):.2f} ms (99 %: {percentile(base, 0.99):.2f})"
        rows.append(Row(f"an event over {name}, from emit", ours, against, str(ratio(values, base)), "", None))
    return rows


def router() -> Row:
    """Send one event of each of NAMES sensors through a router in a process of its own."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    code = f"from benchmarks.buses import session; s = session('router', 'listen/endpoints', {endpoint!r})"
    code += "; print(1, flush=True); input()"
    command = [sys.executable, "-c", code]
    payload = json.dumps({"type": "gesture", "scores": {str(n): 0.1 for n in range(10)}}).encode() + bytes(300)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as started:
        try:
            assert started.stdout is not None and started.stdout.readline()
            with session("client", "connect/endpoints", endpoint) as sender:
                with session("client", "connect/endpoints", endpoint) as receiver:
                    came: list[str] = []
                    hears = receiver.declare_subscriber("gestured/**", lambda sample: came.append(str(sample.key_expr)))
                    while not came:  # until the router knows of the subscriber, it has nobody to send to
                        sender.put("gestured/first", b"")
                        time.sleep(0.01)
                    time.sleep(0.1)  # for the last of these
                    came.clear()
                    used, begin = cpu_s_of(started.pid), time.monotonic()
                    for n in range(NAMES):
                        sender.put(f"gestured/site{n % 100}/s{n}/gesture", payload)
                        if n % 100 == 99:
                            time.sleep(0.005)  # at most 20,000 a second, so that no queue overflows
                    end = time.monotonic() + PATIENCE_S
                    while len(came) < NAMES and time.monotonic() < end:
                        time.sleep(0.01)
                    took, work = time.monotonic() - begin, cpu_s_of(started.pid) - used
                    hears.undeclare()
        finally:
            started.kill()
    ours = f"{len(set(came))} of {NAMES} names there after {took:.2f} s"
    return Row("a router of Zenoh, an event of each name", ours, f"its processor time: {work:.2f} s", "", "", None)


def buses(model: str) -> list[Row]:
    """The rows of `latency`, and that of `router`."""
    return [*latency(model), router()]
