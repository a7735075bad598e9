"""Whether a real daemon grows or slows down over a long time: `python -m experiments.soak [--compressed]`.

Without a flag: ten minutes in real time, 20 sensors at 15 Hz. `--compressed`: 24 hours of one sensor by its own clock,
as fast as possible. Simulated people touch the sensors all the time; between two readings a client connects and leaves,
metrics are scraped, and the daemon reloads. Latency is from the arrival of the frame that decided to the event's
arrival at a client (compressed: the daemon's CPU time a frame, since this program fills the queue in which frames
wait). "Waiting" is the time in which the daemon could have run while others had the processor. "Slope" is the
least-squares line through the readings after the first fifth of the time.
"""

import argparse
import json
import signal
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from experiments.damage import FIRST, take
from experiments.fleet import cpu_s
from gestured.client.sensor import Form
from gestured.core.frames import Frame
from tests.daemon.harness import Daemon, Sensor
from tests.hostile.grammar import TYPES, violations

TAKE_S = 600.0
CHUNK = 2000  # frames sent and not yet taken: fewer than the socket's buffer holds
READINGS = 30


@dataclass
class Reading:
    """The daemon's figures at one moment."""

    hours: float  # of the sensor's time
    resident: float  # MiB
    descriptors: int
    threads: int
    cpu_s: float
    waited_s: float  # for the processor, while others had it
    frames: int
    latencies_ms: list[float] = field(default_factory=list)  # of the events since the reading before


class Watch:
    """Reads a daemon's /proc, and its events in a thread."""

    def __init__(self, daemon: Daemon) -> None:
        self.daemon, self.readings = daemon, [Reading(0, 0, 0, 0, 0, 0, 0)]
        self.lines: list[dict[str, Any]] = []
        self._latencies: list[float] = []
        self._client = daemon.client().subscribe(*TYPES)
        self._client.sock.settimeout(None)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        for raw in self._client._file:
            line, now = json.loads(raw), time.time()
            self.lines.append({key: line[key] for key in ("type", "sensor", "id", "sequence") if key in line})
            if line["type"] == "gesture":
                self._latencies.append(1000 * (now - line["decided"]))

    def read(self, hours: float) -> None:
        """Take a reading while another client is connected, then let the daemon reload."""
        proc = Path(f"/proc/{self.daemon.process.pid}")
        visitor = self.daemon.client()
        frames = self.daemon.frames()
        visitor.close()
        status = dict(line.split(":", 1) for line in (proc / "status").read_text().splitlines())
        waited = int((proc / "schedstat").read_text().split()[1]) / 1e9
        latencies, self._latencies = self._latencies, []
        self.readings.append(
            Reading(
                hours,
                int(status["VmRSS"].split()[0]) / 1024,
                len(list((proc / "fd").iterdir())),
                int(status["Threads"]),
                cpu_s(self.daemon.process.pid),
                waited,
                frames,
                latencies,
            )  # fmt: skip
        )
        self.daemon.signal(signal.SIGHUP)

    def end(self) -> None:
        """Wait for the last events of a daemon that has ended."""
        self._thread.join(20)


def compressed(watch: Watch, hours: float) -> None:
    """One sensor by its own clock, as fast as the daemon takes its frames."""
    sensor, form = Sensor(watch.daemon, "s0"), Form("s0")
    takes = [take(FIRST + n, TAKE_S) for n in range(4)]
    start, count, taken = 1.7e9, 0, 0
    steps = round(hours * 3600 / TAKE_S)
    for n in range(steps):
        healthy = takes[n % len(takes)]
        for values, t in zip(healthy.frames, healthy.sensor_times, strict=True):
            sensor.sock.send(form.packet(Frame(t, values), count % 2**31, start + float(t)))
            count += 1
            while count - taken >= CHUNK:
                taken = watch.daemon.frames()
        start += TAKE_S + 1
        if (n + 1) % max(1, steps // READINGS) == 0:
            watch.read((n + 1) * TAKE_S / 3600)


def real_time(watch: Watch, hours: float, sensors: int) -> None:
    """Sensors side by side, at 15 frames a second each."""
    takes = [take(FIRST + n, hours * 3600) for n in range(sensors)]
    ports = [Sensor(watch.daemon, f"s{n}") for n in range(sensors)]
    todo = sorted((float(t), n, i) for n, one in enumerate(takes) for i, t in enumerate(one.sensor_times))
    begin, read = time.monotonic(), 0
    for t, n, i in todo:
        while (wait := begin + t - time.monotonic()) > 0:
            time.sleep(wait)  # the sensors' pace
        frame = Frame(t, takes[n].frames[i])
        ports[n].sock.send(Form(f"s{n}").packet(frame, int(takes[n].counter[i]), time.time()))
        if t > (read + 1) * hours * 3600 / READINGS:
            read += 1
            watch.read(t / 3600)


def report(watch: Watch, is_compressed: bool) -> int:
    """Print and judge the readings; returns 1 if descriptors or threads grew, or if an onset has no end."""
    readings = watch.readings
    print("hours  MiB     fds  threads  frames     us CPU/frame  us waiting/frame  p50 ms  p99 ms")
    for before, now in zip(readings, readings[1:], strict=False):
        frames = max(1, now.frames - before.frames)
        cost, waited = 1e6 * (now.cpu_s - before.cpu_s) / frames, 1e6 * (now.waited_s - before.waited_s) / frames
        p50, p99 = np.quantile(now.latencies_ms or [np.nan], [0.5, 0.99])
        shown = "     -       -" if is_compressed else f"{p50:6.2f}  {p99:6.2f}"
        print(
            f"{now.hours:5.2f}  {now.resident:6.2f}  {now.descriptors:3d}  {now.threads:7d}  {now.frames:9d}"
            f"  {cost:12.1f}  {waited:16.1f}  {shown}"
        )
    steady = readings[1 + len(readings) // 5 :]
    slope = float(np.polyfit([r.hours for r in steady], [r.resident for r in steady], 1)[0])
    first, last = steady[: len(steady) // 3], steady[-(len(steady) // 3) :]
    span = steady[-1].hours - steady[0].hours
    grown = 1024 * slope * span
    print(f"memory: {1024 * slope:+.1f} KiB an hour, {grown:+.0f} KiB over these {span:.2f} h")
    descriptors = [r.descriptors for r in steady]
    threads = [r.threads for r in steady]
    print(f"descriptors: {min(descriptors)} to {max(descriptors)}; threads: {min(threads)} to {max(threads)}")
    if is_compressed:
        name, unit = "CPU time a frame", "us"
        early, late = (1e6 * (g[-1].cpu_s - g[0].cpu_s) / max(1, g[-1].frames - g[0].frames) for g in (first, last))
    else:
        name, unit = "latency (median)", "ms"
        early, late = (float(np.median([ms for r in group for ms in r.latencies_ms])) for group in (first, last))
    print(f"{name}: {early:.2f} {unit} in the first third, {late:.2f} {unit} in the last")
    wrong = violations(watch.lines)
    gestures = sum(line["type"] == "gesture" for line in watch.lines)
    print(f"events: {len(watch.lines)}, of these {gestures} gestures; onsets without an end: {len(wrong)}")
    return int(bool(wrong) or max(descriptors) > min(descriptors) + 2 or max(threads) > min(threads) + 1)


def main() -> int:
    """Run a daemon and report on it; returns 1 if it failed, logged an error, grew or left an onset open."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--compressed", action="store_true", help="one sensor, as fast as it goes")
    parser.add_argument("--hours", type=float, help="of the sensor's time (default: 24 compressed, else 1/6)")
    parser.add_argument("--sensors", type=int, default=20, help="in real time (default: 20)")
    parser.add_argument("--model", default="cnn_lstm", help="a shipped model's name, or a path (%(default)s)")
    args = parser.parse_args()
    hours = args.hours or (24.0 if args.compressed else 1 / 6)
    with tempfile.TemporaryDirectory(prefix="gestured-soak-") as folder:
        clock = "sensor" if args.compressed else "arrival"
        daemon = Daemon.start(Path(folder), args.model, "--clock", clock, "--metrics", "127.0.0.1:0")
        watch = Watch(daemon)
        began = time.monotonic()
        try:
            if args.compressed:
                compressed(watch, hours)
            else:
                real_time(watch, hours, args.sensors)
        finally:
            status = daemon.stop()
        watch.end()
        print(f"{hours:g} h of {1 if args.compressed else args.sensors} sensor(s) in {time.monotonic() - began:.0f} s")
        log = [line for line in daemon.stderr().splitlines() if '"level": "error"' in line or "Traceback" in line]
        print(f"exit status {status}; errors in the log: {len(log)}", *log[:3], sep="\n")
    return report(watch, args.compressed) or int(bool(status or log))


if __name__ == "__main__":
    sys.exit(main())
