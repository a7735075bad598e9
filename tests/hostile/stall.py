"""What a stall of the daemon costs.

Simulated hands swipe and tap on many sensors, in real time, without frame counters. The daemon's process is stopped for
a while, and continued. As long as the kernel's buffer holds the packets, every gesture should be recognised as if
nothing had happened; if it overflows, gestures may be missed, but none may be made up.
"""

import select
import signal
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from gestured.record.judge import Performed, Tally
from tests.daemon.harness import Client, Daemon, Frame, Hand, Sensor, floats
from tests.hostile.grammar import TYPES, violations

QUIET_S = 2.0  # before the first gesture
PERIOD_S = 1.6  # from one gesture to the next
SWIPE_S, TAP_S = 0.45, 0.14
KINDS = ("swipe_left", "one_tap", "swipe_right")


@dataclass
class Result:
    """What became of the gestures."""

    verdicts: Counter[str] = field(default_factory=Counter)
    unknown: int = 0
    kernel_drops: int = 0
    held_back: int = 0  # packets dropped as a flood
    late_s: float = 0.0  # the most by which sensors sent late, which is not the daemon's fault
    violations: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        said = ", ".join(f"{count} {verdict}" for verdict, count in sorted(self.verdicts.items()))
        drops = f"{self.kernel_drops} packets found no room, {self.held_back} held back"
        return f"{said}, {self.unknown} unknown; {drops}; sensors late by {self.late_s:.2f} s"


class Script:
    """What one hand does on one sensor, by the time since the start in s."""

    def __init__(self, number: int, seconds: float) -> None:
        self._hand = Hand(number)
        self._first = QUIET_S + PERIOD_S * (number * 0.381 % 1.0)  # so that the hands are out of phase
        self.gestures = [
            (start, start + (TAP_S if kind == "one_tap" else SWIPE_S), kind)
            for n in range(int((seconds - self._first - PERIOD_S) / PERIOD_S))
            if (start := self._first + n * PERIOD_S, kind := KINDS[(n + number) % len(KINDS)])
        ]

    def frame(self, t: float) -> Frame:
        """The frame that the sensor shows at `t` s."""
        n = int((t - self._first) / PERIOD_S)
        if t >= self._first and n < len(self.gestures):
            start, end, kind = self.gestures[n]
            if start <= t <= end:
                way = (t - start) / (end - start)
                return self._hand.frame(4.0, {"swipe_left": 7 - 6 * way, "swipe_right": 1 + 6 * way}.get(kind, 4.0))
        return self._hand.frame()


def play(  # noqa: PLR0913 - each is a quantity of its own
    daemon: Daemon, sensors: int, rate_hz: float, stall_s: float, seconds: float, rubbish: int = 0
) -> Result:
    """Play `seconds` on so many `sensors`; the daemon is stopped for `stall_s` in the middle.

    Meanwhile another program sends it so many packets of `rubbish`.
    """
    client = daemon.client().subscribe(*TYPES, "status")
    scripts = [Script(n, seconds) for n in range(sensors)]
    streams = [Sensor(daemon, f"s{n}") for n in range(sensors)]
    tallies, result, lines = [Tally() for _ in scripts], Result(), []
    stop, go = seconds / 2, seconds / 2 + stall_s
    stopped = False
    start, began = time.monotonic(), time.time()
    for frame in range(round(seconds * rate_hz)):
        for n, (script, stream) in enumerate(zip(scripts, streams, strict=True)):
            due = start + (frame + n / sensors) / rate_hz
            while (wait := due - time.monotonic()) > 0 or (not stopped and select.select([client.sock], [], [], 0)[0]):
                if not stopped and select.select([client.sock], [], [], max(0.0, wait))[0]:
                    lines.append(client.line())
                elif stopped:
                    time.sleep(wait)
            now = time.monotonic() - start
            result.late_s = max(result.late_s, start + now - due)
            if stopped != (stop <= now < go):
                stopped = not stopped
                daemon.signal(signal.SIGSTOP if stopped else signal.SIGCONT)
                if stopped and rubbish:
                    stranger = Sensor(daemon, "stranger")
                    for _ in range(rubbish):
                        stranger.sock.send(b"x" * 340)
            stream.sock.send(floats(f"/{stream.name}/pressure", script.frame(now), frame))
    lines += listen(client)
    for n, (script, tally) in enumerate(zip(scripts, tallies, strict=True)):
        for onset, offset, kind in script.gestures:
            tally.begin(Performed(kind, kind, began + onset, began + offset))
        for line in lines:
            if line["type"] in ("gesture", "unknown") and line["sensor"] == f"s{n}":
                tally.hear(line, line["decided"])
                result.unknown += line["type"] == "unknown"
        tally.settle(began + 2 * seconds)
        result.verdicts.update(tally.counts)
    result.kernel_drops = round(daemon.metric("gestured_kernel_drops_total"))
    result.held_back = round(daemon.metric("gestured_dropped_total", reason="flood"))
    result.violations = violations(lines)
    return result


def listen(client: Client) -> list[dict[str, Any]]:
    """The lines still to come, until all sensors are stale."""
    return client.until(lambda line: line["type"] == "status" and all(s == "stale" for s in line["sensors"].values()))
