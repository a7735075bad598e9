"""The real daemon as a process, a sensor that is made of arithmetic, and clients.

Nothing here sleeps: everything waits for a message, with a deadline that only a failure reaches.
"""

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.client.control import Control
from gestured.core.address import Address
from tests import encoding

DEADLINE_S = 20.0
RATE_HZ = 15.0
ROWS = COLUMNS = 9
Frame = NDArray[np.float64]
Line = dict[str, Any]


class Client:
    """A subscriber of the event socket."""

    def __init__(self, path: Path, deadline_s: float = DEADLINE_S) -> None:
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(deadline_s)
        self.sock.connect(str(path))
        self._file = self.sock.makefile("rb")
        self.hello = self.line()

    def ask(self, request: object) -> "Client":
        """Send one line: bytes as they are, anything else as JSON."""
        self.sock.sendall(request if isinstance(request, bytes) else json.dumps(request).encode() + b"\n")
        return self

    def subscribe(self, *types: str, **filters: list[str]) -> "Client":
        """Subscribe, and wait until that holds (the answer to a wrong line behind it says so)."""
        self.ask({"subscribe": ({"types": list(types)} if types else {}) | filters}).ask(b"?\n")
        self.until(lambda line: line["type"] == "error")
        return self

    def line(self) -> Line:
        """The next line."""
        raw = self._file.readline()
        assert raw.endswith(b"\n"), f"the daemon closed the connection after {raw!r}"
        return json.loads(raw)

    def until(self, condition: Callable[[Line], bool]) -> list[Line]:
        """Lines up to the first that fulfils the condition."""
        lines = [self.line()]
        end = time.monotonic() + DEADLINE_S
        while not condition(lines[-1]):
            assert time.monotonic() < end, f"not among {lines[-5:]}"
            lines.append(self.line())
        return lines

    def events(self, kind: str, sensor: str, count: int = 1) -> list[Line]:
        """The next lines of that type and sensor."""
        found: list[Line] = []
        while len(found) < count:
            found.append(self.until(lambda line: (line["type"], line.get("sensor")) == (kind, sensor))[-1])
        return found

    def rest(self) -> list[Line]:
        """All lines until the daemon hangs up."""
        return [json.loads(raw) for raw in self._file]

    def close(self) -> None:
        """Hang up."""
        self._file.close()
        self.sock.close()


class Daemon:
    """`gestured` as a process. `start` waits for its ready line."""

    def __init__(
        self,
        folder: Path,
        *flags: object,
        env: dict[str, str] | None = None,
        python: Iterable[str] = (),
        stderr: int | None = None,
        pass_fds: Collection[int] = (),
    ) -> None:
        """`python` are flags of the interpreter; `stderr` is a descriptor, or by default a file in `folder`."""
        self.folder = folder
        self.stderr_path = folder / "stderr.txt"
        # The soak runs without tests/conftest.py, in its caller's environment.
        clean = {key: value for key, value in os.environ.items() if not key.startswith("GESTURED_")}
        with self.stderr_path.open("ab") as errors:
            self.process = subprocess.Popen(
                [sys.executable, *python, "-m", "tests.daemon.program", *map(str, flags)],
                stdout=subprocess.PIPE, stderr=errors if stderr is None else stderr,
                env=clean | (env or {}), text=True, pass_fds=pass_fds,
            )  # fmt: skip
        self.ready: Line = {}

    @classmethod
    def start(cls, folder: Path, model: object, *flags: object, **more: Any) -> "Daemon":
        """A daemon on a free port and a socket in `folder`, once it can serve."""
        flags = ("--model", model, *flags)
        if "--listen" not in flags:
            flags += ("--listen", "127.0.0.1:0")
        if "--socket" not in flags:
            flags += ("--socket", folder / "events.sock")
        daemon = cls(folder, *flags, **more)
        assert daemon.process.stdout is not None
        readable, _, _ = select.select([daemon.process.stdout], [], [], DEADLINE_S)
        line = daemon.process.stdout.readline() if readable else ""
        if not line:
            daemon.process.kill()
            raise AssertionError(f"not ready: {daemon.stderr()}")
        daemon.ready = json.loads(line)
        return daemon

    @property
    def address(self) -> Address:
        """Where it listens for OSC."""
        return Address.parse(self.ready["listen"])

    @property
    def socket(self) -> Path:
        """Its event socket."""
        return Path(self.ready["socket"])

    def stderr(self) -> str:
        """What it has said so far."""
        return self.stderr_path.read_text()

    def client(self) -> Client:
        """A new subscriber."""
        return Client(self.socket)

    def control(self) -> Control:
        """A connection to its control socket."""
        return Control(Path(self.ready["control"]), patience_s=DEADLINE_S)

    def ask(self, verb: str, **keys: object) -> dict[str, Any]:
        """The answer to one request of an operator."""
        with self.control() as control:
            return control.ask(verb, **keys)

    def get(self, path: str) -> tuple[int, str]:
        """Status and body of an HTTP request."""
        try:
            with urllib.request.urlopen(f"http://{self.ready['metrics']}{path}", timeout=DEADLINE_S) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def metric(self, name: str, **labels: str) -> float:
        """A sample's value, 0 where there is none, once all that was published before is counted.

        An event goes out before it is counted, and /metrics is answered beside the loop: a question to the loop first.
        """
        self.ask("status")
        return self.sample(name, **labels)

    def sample(self, name: str, **labels: str) -> float:
        """A sample's value as it is just now, 0 where there is none; the loop may hang."""
        for line in self.get("/metrics")[1].splitlines():
            match = re.fullmatch(r"(\w+)(?:\{(.*)\})? (\S+)", line)
            if match and match[1] == name and dict(re.findall(r'(\w+)="([^"]*)"', match[2] or "")) == labels:
                return float(match[3])
        return 0.0

    def frames(self) -> int:
        """Frames of all sensors that it has looked at."""
        samples = re.findall(r'^gestured_frames_total\{result="ok".*\} (\S+)$', self.get("/metrics")[1], re.MULTILINE)
        return round(sum(map(float, samples)))

    def signal(self, number: int) -> None:
        """Send a signal."""
        self.process.send_signal(number)

    def wait(self) -> int:
        """Its exit status, once it has ended by itself."""
        return self.process.wait(DEADLINE_S)

    def stop(self) -> int:
        """End it as an operator does."""
        if self.process.poll() is None:
            self.signal(signal.SIGTERM)
        try:
            return self.wait()
        finally:
            self.process.kill()
            assert self.process.stdout is not None
            self.process.stdout.close()

    def ends_well(self) -> None:
        """End it, which must leave no failure and no traceback."""
        assert self.stop() == 0, self.stderr()
        assert "Traceback" not in self.stderr()


@contextmanager
def running(folder: Path, model: object, *flags: object, **more: Any) -> Iterator[Daemon]:
    """A daemon with the sensor's clock, which ends well."""
    daemon = Daemon.start(folder, model, "--clock", "sensor", *flags, **more)
    yield daemon
    daemon.ends_well()


class Hand:
    """A hand on a sensor: whole counts between 0 and 255, so that every form of a frame can hold them."""

    def __init__(self, seed: int = 0) -> None:
        self._random = np.random.default_rng(seed)

    def frame(self, row: float | None = None, column: float = 4.0) -> Frame:
        """One frame, with a finger at (row, column) unless row is None."""
        values: Frame = 20.0 + self._random.integers(-1, 2, (ROWS, COLUMNS)).astype(float)
        if row is not None:
            y, x = np.mgrid[:ROWS, :COLUMNS]
            values += np.rint(180 * np.exp(-((y - row) ** 2 + (x - column) ** 2) / 2))
        return values

    def idle(self, seconds: float) -> list[Frame]:
        """Nobody touches it."""
        return [self.frame() for _ in range(round(seconds * RATE_HZ))]

    def tap(self) -> list[Frame]:
        """Two frames long."""
        return [self.frame(4.0), self.frame(4.0)]

    def swipe(self, direction: str) -> list[Frame]:
        """Seven frames along an axis."""
        way = [1.0 + i for i in range(7)]
        if direction in ("up", "left"):
            way.reverse()
        across = direction in ("left", "right")
        return [self.frame(4.0, p) if across else self.frame(p, 4.0) for p in way]


class Sensor:
    """Sends frames in bundles with time tags, so that with `--clock sensor` they may go at any speed."""

    def __init__(self, daemon: Daemon, name: str, encode: "Encode | None" = None, seed: int = 0) -> None:
        self.name, self.hand = name, Hand(seed)
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.connect(daemon.address)
        self.t = 1_700_000_000.0
        self.count = 0
        self._encode = encode or floats

    def packet(self, frame: Frame) -> bytes:
        """The next frame as a packet."""
        self.t += 1 / RATE_HZ
        self.count += 1
        return encoding.bundle([self._encode(f"/{self.name}/pressure", frame, self.count)], self.t)

    def send(self, *parts: list[Frame]) -> "Sensor":
        """Send the frames of all parts, as closely together as can be: the daemon decides by the time between them."""
        for packet in [self.packet(frame) for part in parts for frame in part]:
            self.sock.send(packet)
        return self

    def begin(self) -> "Sensor":
        """Two quiet seconds: the sensor is learned."""
        return self.send(self.hand.idle(2.0))

    def perform(self, *directions: str) -> "Sensor":
        """Swipes ("left" ...) and taps ("tap"), a quiet second after each."""
        for direction in directions:
            self.send(self.hand.tap() if direction == "tap" else self.hand.swipe(direction), self.hand.idle(1.0))
        return self


Encode = Callable[[str, Frame, int], bytes]


def floats(address: str, frame: Frame, count: int) -> bytes:
    """R*C of `f`."""
    return encoding.message(address, "f" * frame.size, (frame.ravel(),))


def ints(address: str, frame: Frame, count: int) -> bytes:
    """R*C of `i`."""
    return encoding.message(address, "i" * frame.size, (frame.ravel(),))


def counted(address: str, frame: Frame, count: int) -> bytes:
    """A frame counter, and R*C of `f`."""
    return encoding.message(address, "i" + "f" * frame.size, (count, frame.ravel()))


def blob(dtype: str) -> Encode:
    """One blob of big-endian values."""

    def encode(address: str, frame: Frame, count: int) -> bytes:
        return encoding.message(address, "b", (frame.astype(dtype).tobytes(),))

    return encode


def lines_of(text: str) -> Iterator[Line]:
    """The JSON lines of a log."""
    return (json.loads(line) for line in text.splitlines() if line.startswith("{"))
