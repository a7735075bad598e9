"""An installed daemon in the container, as those around it see it."""

import json
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from types import SimpleNamespace
from typing import Any

from tests.daemon.harness import Client, Sensor, counted
from tests.systemd.container import DEADLINE_S, Container

FRAMES = 800  # 8 s: longer than the reloads take
RATE_HZ = 100.0


class Vehicle:
    """The daemon of a service, `gestured` or an instance such as `gestured@left`."""

    def __init__(self, box: Container, unit: str = "gestured", port: int = 9000, metrics: int = 9108) -> None:
        self.box, self.unit, self.port = box, unit, port
        self.events = f"/run/{unit.replace('@', '-')}/events.sock"
        self.control = self.events.replace(".sock", ".ctl")
        self._metrics = f"http://127.0.0.1:{metrics}/metrics"

    def client(self) -> Client:
        """A new subscriber of gestures; it waits until the daemon answers."""
        return Client(self.box.path(self.events), DEADLINE_S)

    def instance(self) -> str:
        """Which start of the daemon answers."""
        with closing(self.client()) as client:
            return str(client.hello["instance"])

    def sensor(self, name: str, host: str = "127.0.0.1") -> Sensor:
        """A sensor in the container's network, which sends to this address of it."""
        daemon: Any = SimpleNamespace(address=(host, self.port))
        found: Sensor = self.box.call(lambda: Sensor(daemon, name, counted))
        return found

    @contextmanager
    def swiped(self, sensor: str) -> Iterator[None]:
        """Meanwhile somebody swipes to the left on a simulated sensor, twice in ten seconds."""
        simulate = f"gesturectl simulate --to 127.0.0.1:{self.port} --sensor {sensor} --kinds swipe_left --seconds 10"
        sender = threading.Thread(target=self.box.run, args=simulate.split())
        sender.start()
        yield
        sender.join()

    def frames(self, sensor: str) -> int:
        """Frames of a sensor that this start of the daemon has seen, whatever became of them."""
        text = self.box.call(lambda: urllib.request.urlopen(self._metrics, timeout=20).read().decode())
        lines = [line for line in text.splitlines() if line.startswith("gestured_frames_total{")]
        return round(sum(float(line.split()[-1]) for line in lines if f'sensor="{sensor}"' in line))

    def status(self) -> dict[str, Any]:
        """What it says of itself."""
        said = self.box.run("gesturectl", "status", "--json", "--control", self.control, check=False).stdout
        return json.loads(said) if said else {}

    def log(self) -> str:
        """What the service has said."""
        return self.box.run("journalctl", "-u", self.unit, "-o", "cat").stdout


def steady(sensor: Sensor, count: int = FRAMES, stop: threading.Event | None = None) -> threading.Thread:
    """Send so many idle frames at a steady rate, in a thread, or until it is stopped."""
    ended = stop or threading.Event()

    def send() -> None:
        begin = time.monotonic()
        for i in range(count):
            if ended.wait(max(begin + i / RATE_HZ - time.monotonic(), 0)):
                return
            with suppress(ConnectionRefusedError):  # nobody listened to the frame before
                sensor.send([sensor.hand.frame()])

    thread = threading.Thread(target=send)
    thread.start()
    return thread
