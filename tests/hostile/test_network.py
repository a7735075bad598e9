"""Sensors and a real daemon with bad networks between them, at the pace of real sensors; its clock is the arrival."""

import select
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from typing import Any

from tests.daemon.harness import Client, Frame, Sensor, counted
from tests.hostile.grammar import TYPES, violations
from tests.hostile.line import Impairment, Line, Proxy

STEP_S = 1 / 60  # faster than a real sensor, so that the test is
LINES: dict[str, Impairment] = {
    "lossy": Impairment(loss=0.2),
    "bursts": Impairment(loss=0.1, burst=5),
    "doubling": Impairment(duplicate=0.2, jitter_s=0.03),
    "late": Impairment(late=0.05),
    "slow": Impairment(delay_s=0.3),
    "cutting": Impairment(cut=0.2),
    "corrupting": Impairment(corrupt=0.05),
}


def swipe(sensor: Sensor, direction: str) -> list[Frame]:
    """A third of a second long, then nothing for a second."""
    way = [1 + 0.3 * i for i in range(21)]
    way.reverse() if direction == "left" else None
    return [sensor.hand.frame(4.0, p) for p in way] + [sensor.hand.frame() for _ in range(60)]


def play(client: Client, sensors: list[Sensor], scripts: Sequence[Iterable[Frame]]) -> list[dict[str, Any]]:
    """Send each sensor's frames side by side at their pace, which is kept by listening to what the daemon says."""
    lines, due = [], time.monotonic()
    for frames in zip(*scripts, strict=True):
        for sensor, frame in zip(sensors, frames, strict=True):
            sensor.count += 1
            sensor.sock.send(counted(f"/{sensor.name}/pressure", frame, sensor.count))
        due += STEP_S
        while select.select([client.sock], [], [], max(0.0, due - time.monotonic()))[0]:
            lines.append(client.line())
    return lines


def test_bad_networks_side_by_side(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0")
    client = daemon.client().subscribe(*TYPES)
    with ExitStack() as stack:
        sensors, proxies = [], []
        for name in LINES:
            proxies.append(stack.enter_context(Proxy(daemon.address, Impairment(), seed=1)))
            sensors.append(Sensor(daemon, name))
            sensors[-1].sock.connect(proxies[-1].address)
        idle = [[sensor.hand.frame() for _ in range(90)] for sensor in sensors]
        lines = play(client, sensors, idle)
        assert [line for line in lines if line["sensor"] in LINES] == []
        for proxy, impairment in zip(proxies, LINES.values(), strict=True):
            proxy.line = Line(impairment, 1)
        lines += play(client, sensors, [swipe(s, "left") + swipe(s, "left") for s in sensors])
        bad = {name: [line["gesture"] for line in lines if line["type"] == "gesture" and line["sensor"] == name]
               for name in LINES}  # fmt: skip
        for proxy in proxies:
            proxy.line = Line(Impairment(), 1)
        lines += play(client, sensors, [[*frames, *swipe(s, "right")] for frames, s in zip(idle, sensors, strict=True)])
    counts = {name: daemon.metric("gestured_frames_total", sensor=sensor, result=name) for name, sensor in
              (("lost", "lossy"), ("duplicate", "doubling"), ("late", "late"))}  # fmt: skip
    assert all(counts.values()), counts
    assert daemon.metric("gestured_internal_errors_total") == 0
    assert daemon.stop() == 0
    lines += client.rest()
    last = {line["sensor"]: line["gesture"] for line in lines if line["type"] == "gesture"}
    assert {name: last.get(name) for name in LINES} == dict.fromkeys(LINES, "swipe_right")
    assert all("swipe_right" not in gestures for gestures in bad.values())
    assert violations(lines) == []
