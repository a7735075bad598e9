"""Whatever arrives on the UDP port is dropped and counted by reason; the next good frame is taken."""

import math
import struct

import pytest

from tests import encoding
from tests.daemon import harness
from tests.daemon.harness import Daemon, Hand, Sensor

NAN = Hand().frame().ravel()
NAN[40] = math.nan
nested = encoding.message("/bad/pressure", "f", (1.0,))
for _ in range(40):
    nested = encoding.bundle([nested])
RUBBISH = {  # what else a packet may be, and by which reason it is refused, tests/core/test_wire.py and test_osc.py say
    "text": (b"GET / HTTP/1.1\r\n\r\n", "not_osc"),
    "not finite": (encoding.message("/bad/pressure", "f" * 81, (NAN,)), "not_finite"),
    "a finger that is nowhere": (encoding.message("/bad/trajectory", "iff", (1, math.nan, 2.0)), "not_finite"),
    "unknown address": (encoding.message("/bad/humidity", "f", (1.0,)), "address"),
    "negative bundle element": (b"#bundle\0" + bytes(7) + b"\1" + struct.pack(">i", -4) + bytes(4), "bundle"),
    "deep nesting": (nested, "bundle"),
    "a whole datagram of zeros": (bytes(60_000), "not_osc"),
}


@pytest.mark.parametrize("name", RUBBISH)
def test_rubbish_is_counted_and_nobody_else_notices(shared: Daemon, name: str) -> None:
    packet, reason = RUBBISH[name]
    client = shared.client()
    before = shared.metric("gestured_dropped_total", reason=reason)
    sensor = Sensor(shared, "beside_" + "".join(c for c in name if c.isalnum())).begin()
    sensor.sock.send(packet)
    for frame in sensor.hand.swipe("left"):
        sensor.send([frame]).sock.send(packet)
    sensor.send(sensor.hand.idle(1.0))
    assert client.events("gesture", sensor.name)[0]["gesture"] == "swipe_left"
    assert shared.metric("gestured_dropped_total", reason=reason) == before + 8


def test_what_is_dropped_is_logged_at_a_bounded_rate(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0")
    sensor = Sensor(daemon, "noisy")
    for _ in range(100):
        sensor.sock.send(b"rubbish!")
    client = daemon.client().subscribe("status")
    while daemon.metric("gestured_dropped_total", reason="not_osc") < 100:
        client.line()
    daemon.stop()
    lines = [line for line in harness.lines_of(daemon.stderr()) if line.get("reason") == "not_osc"]
    assert len(lines) == 1 and lines[0]["source"] == "127.0.0.1" and lines[0]["level"] == "warning"
