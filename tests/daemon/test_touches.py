"""Touch events of a real daemon: who follows which finger, and what a slow client gets of it."""

import json
import signal
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gestured.core.events import Touch
from gestured.core.messages import Subscription
from gestured.daemon.client import BACKLOG_BYTES
from tests.daemon.harness import Client, Daemon, Sensor
from tests.daemon.test_clients import connect, heard, listener, serve, turn  # noqa: F401 - a fixture among them

FOLLOWS = Subscription(types=frozenset(("touch",)))
MOVE = Touch("arm", 1, 0, "move", 10.0, 0.5, 0.5, 0.001, 0.0, 100.0, 4, "volume")


def phases(lines: list[dict[str, Any]]) -> list[str]:
    """What is told of fingers, moves in a row as one; the answers among it."""
    words = [line.get("phase", line["type"]) for line in lines]
    return [word for k, word in enumerate(words) if (word, words[k - 1] if k else "") != ("move", "move")]


def upto(client: Client, kind: str) -> list[dict[str, Any]]:
    return client.until(lambda line: line.get("phase", line["type"]) == kind)


def test_it_is_off_unless_the_configuration_has_it(shared: Daemon) -> None:
    client = shared.client().ask({"subscribe": {"types": ["touch"]}})
    expected = 'subscribe.types: "touch" is off, expected `touch = true` in the configuration'
    assert client.line() == {"type": "error", "reason": expected}


def test_a_finger_is_followed_from_where_a_client_asks_to_where_it_no_longer_does(start) -> None:
    daemon = start("--clock", "sensor", "--touch", "true", "--stale-s", "20")
    first = daemon.client().subscribe("touch", "gesture", "release")
    other = daemon.client().subscribe("touch", sensors=["leg"])
    sensor = Sensor(daemon, "arm").begin()
    swipe = sensor.hand.swipe("left")
    sensor.send(swipe[:3])
    assert phases(upto(first, "move")) == ["down", "move"]
    late = daemon.client().ask({"subscribe": {"types": ["touch"]}})
    down = late.line()
    assert (down["phase"], down["touch"], down["dx"]) == ("down", 0, 0.0) and "reason" not in down
    leaves = daemon.client().ask({"subscribe": {"types": ["touch"]}})
    assert leaves.line() == down
    leaves.ask({"subscribe": {"types": ["gesture"]}})
    assert leaves.line()["phase"] == "up"
    sensor.send(swipe[3:], sensor.hand.idle(1.0))
    lines = upto(first, "release")
    assert phases(lines) == ["move", "up", "gesture", "release"] and phases(upto(late, "up")) == ["move", "up"]
    assert lines[-2]["where"]["end"]["x"] == pytest.approx(lines[-3]["x"], abs=0.02)
    assert phases(upto(leaves, "gesture")) == ["gesture"]
    other.ask(b"?\n")
    assert other.line()["type"] == "error"  # nothing was told of another sensor


def test_a_reload_that_switches_them_off_ends_the_fingers_first(start, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text("touch = true\nstale_s = 20\n")
    daemon = start("--clock", "sensor", "--config", config)
    client = daemon.client().subscribe("touch", "cancelled", "release")
    sensor = Sensor(daemon, "arm").begin()
    sensor.send([sensor.hand.frame(4.0) for _ in range(5)])
    upto(client, "move")
    config.write_text("touch = false\nstale_s = 20\n")
    daemon.signal(signal.SIGHUP)
    assert phases(upto(client, "up")) in (["up"], ["move", "up"])
    sensor.send(sensor.hand.idle(1.0), sensor.hand.swipe("left"), sensor.hand.idle(1.0))
    assert phases(upto(client, "release")) == ["release"]


async def test_moves_that_wait_for_a_slow_client_are_one_and_displace_nothing(listener) -> None:  # noqa: F811
    server = serve(listener)
    with connect(listener) as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        await turn()
        (client,) = server._clients
        server.subscribe(client, FOLLOWS)
        server.publish(replace(MOVE, phase="down", dx=0.0), 0.0)
        while client.blocked_since is None:
            client.send(b'{"type":"status"}\n')
        lines = client.backlog
        for k in range(10_000):
            server.publish(replace(MOVE, t=10.0 + k, x=round(0.5 + 0.00001 * k, 5)), 0.0)
        assert client.backlog == lines < BACKLOG_BYTES  # nothing more waits
        server.publish(replace(MOVE, touch=1, phase="down", dx=0.0), 0.0)
        server.publish(replace(MOVE, phase="up", x=0.6, dx=0.0), 0.0)
        found = [json.loads(line) for line in (await heard(sock, b'"up"')).splitlines()]
        told = [one for one in found if one["type"] == "touch"]
        assert [(one["touch"], one["phase"]) for one in told] == [(0, "down"), (1, "down"), (0, "up")]
        assert told[-1]["dx"] == 10.0 and not any(one["type"] == "lost" for one in found)  # all that it moved
        await server.close(0)


async def test_a_client_that_goes_is_followed_no_more(listener) -> None:  # noqa: F811
    server = serve(listener)
    with connect(listener) as sock:
        await turn()
        (client,) = server._clients
        server.subscribe(client, FOLLOWS)
        server.publish(replace(MOVE, phase="down"), 0.0)
        server.remove(client)
        server.publish(MOVE, 0.0)
        server.publish(replace(MOVE, phase="up"), 0.0)
        assert sock.recv(1 << 16).count(b"\n") == 1
        await server.close(0)
