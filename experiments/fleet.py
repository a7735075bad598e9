"""Several instances on one machine, one of which is killed: what the others lose, and when its sensors are back.

`python -m experiments.fleet --instances 4 --sensors 1000 --rate 15` prints it as JSON. Each sensor is untouched, has a
port of its own, sends steadily, and counts its frames. The killed instance is started again, as by systemd.
"""

import argparse
import json
import os
import resource
import socket
import struct
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gestured.client.control import Control
from gestured.client.lines import Unreachable
from gestured.client.sensor import sent_after_refusal
from tests.daemon.harness import Daemon
from tests.encoding import message

FRAMES = 64  # different idle frames; they repeat
DESCRIPTORS = 4096
ASK_S = 0.1  # s between two requests for the status, each of which takes a daemon of 250 sensors some milliseconds
RESTART_S = 0.1  # as RestartSec= of the unit


@dataclass
class Instance:
    """A daemon, which can be started again, and its sensors."""

    folder: Path
    model: object
    names: list[str]
    listen: str = "127.0.0.1:0"
    daemon: Any = None
    sockets: list[socket.socket] = field(default_factory=list)
    sent: int = 0

    def start(self) -> None:
        """Start the daemon, on the port that it had before."""
        self.daemon = Daemon.start(
            self.folder, self.model, "--listen", self.listen, "--max-sensors", len(self.names) + 8, "--stale-s", 30
        )
        self.listen = self.daemon.ready["listen"]

    def connect(self) -> None:
        """Open a socket for each sensor, since each is to have a source of its own."""
        for _ in self.names:
            self.sockets.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            self.sockets[-1].connect(self.daemon.address)

    def status(self) -> dict[str, Any]:
        """The daemon's status; empty while it does not run."""
        try:
            with Control(self.daemon.socket.with_suffix(".ctl")) as control:
                return control.ask("status")
        except (Unreachable, OSError):
            return {}

    def ready(self) -> int:
        """How many of the sensors are heard and learned."""
        return sum(sensor["state"] == "ok" for sensor in self.status().get("sensors", {}).values())


class Senders:
    """A thread that sends a frame of every sensor at the rate; late frames are sent at once."""

    def __init__(self, instances: list[Instance], rate: float) -> None:
        random = np.random.default_rng(0)
        noise = [20 + random.integers(-1, 2, (9, 9)) for _ in range(FRAMES)]
        # A thousand packets are due at once, so what they have in common is made beforehand.
        self._heads = [[message(f"/{name}/pressure", "ib") for name in each.names] for each in instances]
        self._blobs = [struct.pack(">i81s3x", 81, values.astype(np.uint8).tobytes()) for values in noise]
        self._instances, self._period = instances, 1 / rate
        self._stop = threading.Event()
        self.late = 0
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        count, due = 0, time.monotonic()
        while not self._stop.is_set():
            rest = struct.pack(">i", count) + self._blobs[count % FRAMES]
            for instance, heads in zip(self._instances, self._heads, strict=True):
                for sock, head in zip(instance.sockets, heads, strict=True):
                    sent_after_refusal(sock, head + rest)
                instance.sent += len(heads)
            count += 1
            due += self._period
            pause = due - time.monotonic()
            self.late += pause < 0
            time.sleep(max(pause, 0.0))

    def stop(self) -> None:
        """Stop sending."""
        self._stop.set()
        self._thread.join()


def until(condition: Any, patience_s: float = 60.0) -> float:
    """Wait until a condition holds; returns the seconds. Raises TimeoutError after `patience_s`."""
    begin = time.monotonic()
    while not condition():
        if time.monotonic() > begin + patience_s:
            raise TimeoutError("it did not come")
        time.sleep(ASK_S)
    return time.monotonic() - begin


def lost_frames(instance: Instance) -> int:
    """Frames that an instance missed, by their counters, and packets that it or the kernel dropped."""
    status = instance.status()
    dropped = sum(status["input"]["dropped"].values()) + status["input"]["kernel_drops"]
    return sum(sensor.get("lost", 0) for sensor in status["sensors"].values()) + dropped


def trial(model: object, instances: int, sensors: int, rate: float, seconds: float) -> dict[str, Any]:
    """Run the instances, kill one and wait until its sensors are back; returns the figures, times in seconds."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(max(soft, DESCRIPTORS), hard), hard))
    with tempfile.TemporaryDirectory(prefix="fleet-") as name:
        each = sensors // instances
        fleet = []
        for n in range(instances):
            folder = Path(name, str(n))
            folder.mkdir()
            fleet.append(Instance(folder, model, [f"s{n}-{k}" for k in range(each)]))
            fleet[-1].start()
            fleet[-1].connect()
        senders = Senders(fleet, rate)
        try:
            until(lambda: all(one.ready() == each for one in fleet))
            before = [lost_frames(one) for one in fleet]
            used, sent, begun = [cpu_s(one.daemon.process.pid) for one in fleet], fleet[-1].sent, time.monotonic()
            time.sleep(seconds / 2)
            took = time.monotonic() - begun
            worked = [cpu_s(one.daemon.process.pid) - was for one, was in zip(fleet, used, strict=True)]
            frames = max(fleet[-1].sent - sent, 1)
            killed, others = fleet[0], fleet[1:]
            killed.daemon.process.kill()
            killed.daemon.process.wait()
            begin = time.monotonic()
            time.sleep(RESTART_S)
            killed.start()
            started, start_cpu = time.monotonic() - begin, cpu_s(killed.daemon.process.pid)
            until(lambda: killed.ready() == each)
            back, back_cpu = time.monotonic() - begin, cpu_s(killed.daemon.process.pid)
            time.sleep(seconds / 2)
        finally:
            senders.stop()
        until(lambda: all(one.status() for one in fleet))
        result = {
            "instances": instances, "sensors": each * instances, "rate_hz": rate, "cores": os.cpu_count(),
            "frames_sent": sum(one.sent for one in fleet), "rounds_late": senders.late,
            "others_lost": sum(lost_frames(one) - was for one, was in zip(others, before[1:], strict=True)),
            "frames_a_second": round(instances * frames / took), "cpu_us_a_frame": round(1e6 * max(worked) / frames, 1),
            "ready_after_s": round(started, 2), "ready_cpu_s": round(start_cpu, 2),
            "sensors_back_after_s": round(back, 2), "sensors_back_cpu_s": round(back_cpu, 2),
            "sensors_back": killed.ready(),
        }  # fmt: skip
        for one in fleet:
            one.daemon.stop()
            for sock in one.sockets:
                sock.close()
        return result


def cpu_s(pid: int) -> float:
    """Seconds of CPU that a process has used, threads that have ended among them, in steps of 10 ms (Linux)."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m experiments.fleet", description=__doc__.partition("\n")[0])
    parser.add_argument("--model", default="cnn_lstm", help="model of the instances (cnn_lstm)")
    parser.add_argument("--instances", type=int, default=4, help="daemons (4)")
    parser.add_argument("--sensors", type=int, default=1000, help="sensors of all (1000)")
    parser.add_argument("--rate", type=float, default=15.0, help="frames a second of each (15)")
    parser.add_argument("--seconds", type=float, default=20.0, help="how long in all, beside the start (20)")
    args = parser.parse_args()
    print(json.dumps(trial(args.model, args.instances, args.sensors, args.rate, args.seconds)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
