"""Clients that do not read, vanish, or are too many: the others notice nothing."""

import asyncio
import json
import resource
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from gestured.core.errors import ProtocolError
from gestured.core.messages import Subscription
from gestured.daemon import client as one_client
from gestured.daemon import clients
from gestured.daemon.clients import EventServer
from gestured.daemon.control import OPERATORS, OPERATORS_KEPT
from gestured.daemon.http import HTTP_CONNECTIONS
from gestured.daemon.metrics import Metrics
from gestured.daemon.start import FEWEST_DESCRIPTORS
from tests.daemon.harness import Daemon, Sensor


def test_a_slow_client_is_told_what_it_lost_and_others_get_everything(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0")
    slow = daemon.client()
    slow.sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    quick = daemon.client()
    done = 0
    with daemon.control() as operator:
        while (output := operator.ask("status")["output"])["lines_lost"] == 0:
            for _ in range(10):
                operator.ask("emit", gesture="one_tap", sensor="arm")
            done += 10
            assert [e["sequence"] for e in quick.events("gesture", "arm", 10)] == list(range(done - 9, done + 1))
    assert output["backlog_bytes"] <= one_client.BACKLOG_BYTES + 5000  # the line that is being sent, and the other's
    lines = slow.until(lambda line: line.get("sequence") == done)
    lost = [line for line in lines if line["type"] == "lost"]
    sequences = [line["sequence"] for line in lines if line["type"] == "gesture"]
    assert len(lost) >= 1 and sum(line["count"] for line in lost) + len(sequences) == done
    assert daemon.metric("gestured_client_lines_lost_total") == done - len(sequences)
    # The gap is where the lines were lost, and nowhere else.
    at = lines.index(lost[0])
    assert lines[at + 1]["sequence"] - lines[at - 1]["sequence"] == lost[0]["count"] + 1
    assert [line["sequence"] for line in lines[:at]] == list(range(1, at + 1))


def test_clients_that_vanish_in_mid_line_are_forgotten(shared: Daemon) -> None:
    for _ in range(20):
        client = shared.client()
        client.sock.sendall(b'{"subscribe":')
        client.close()
    client = shared.client()
    Sensor(shared, "vanish").begin().perform("left")
    assert client.events("gesture", "vanish")
    client.subscribe("status")
    while shared.metric("gestured_clients") > 1:
        client.line()


def test_a_client_that_only_closes_its_writing_side_still_gets_events(shared: Daemon) -> None:
    client = shared.client().subscribe("gesture", sensors=["half"])
    client.sock.shutdown(socket.SHUT_WR)
    Sensor(shared, "half").begin().perform("left")
    assert client.line()["gesture"] == "swipe_left"


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX) as sock:
        sock.bind(str(tmp_path / "s"))
        sock.listen(64)
        sock.setblocking(False)
        yield sock


def connect(listener: socket.socket) -> socket.socket:
    client = socket.socket(socket.AF_UNIX)
    client.connect(listener.getsockname())
    client.setblocking(False)
    return client


def serve(listener: socket.socket, metrics: Metrics | None = None, hello: bytes = b"") -> EventServer:
    """The event stream of a daemon without gestures."""
    return EventServer(listener, lambda: hello, metrics or Metrics(), known=dict, changed=lambda: None)


async def turn() -> None:
    """Let the loop look at its sockets."""
    for _ in range(5):
        await asyncio.sleep(0)


async def heard(sock: socket.socket, last: bytes) -> bytes:
    """All that a client is sent, up to what holds these bytes."""
    received = b""
    while last not in received:
        try:
            received += sock.recv(1 << 16)
        except BlockingIOError:
            await turn()
    return received


async def test_a_client_that_reads_nothing_for_long_is_cut_off(listener, monkeypatch) -> None:
    metrics = Metrics()
    server = serve(listener, metrics, hello=b"hello\n")
    with connect(listener), connect(listener) as idle:
        await turn()
        stalled = min(server._clients, key=lambda client: client.sock.fileno())  # who came first
        while stalled.blocked_since is None:
            stalled.send(b"x" * 1000 + b"\n")
        server.tick()
        assert server.count == 2
        monkeypatch.setattr(clients, "STALLED_S", -1.0)
        server.tick()
        assert server.count == 1 and metrics.evicted.values == {("stalled",): 1}
        assert idle.recv(100) == b"hello\n"
        await server.close(0.1)
        assert server.count == 0 and idle.recv(100) == b""


async def test_more_clients_than_there_is_room_for_are_told_so(listener, monkeypatch) -> None:
    monkeypatch.setattr(clients, "CLIENTS", 2)
    metrics = Metrics()
    server = serve(listener, metrics, hello=b"hello\n")
    with connect(listener) as a, connect(listener) as b, connect(listener) as c:
        await turn()
        assert (a.recv(99), b.recv(99)) == (b"hello\n", b"hello\n")
        assert json.loads(c.recv(99))["type"] == "error" and c.recv(99) == b""
        assert server.count == 2 and metrics.evicted.values == {("too_many",): 1}
        await server.close(0)


def test_clients_leave_descriptors_for_operators_metrics_and_a_reload(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0")
    limit = resource.prlimit(daemon.process.pid, resource.RLIMIT_NOFILE)
    resource.prlimit(daemon.process.pid, resource.RLIMIT_NOFILE, (FEWEST_DESCRIPTORS, limit[1]))
    with ExitStack() as held:
        told = [held.enter_context(closing(daemon.client())).hello for _ in range(FEWEST_DESCRIPTORS)]
        host, port = daemon.ready["metrics"].rsplit(":", 1)
        for _ in range(HTTP_CONNECTIONS):
            held.enter_context(socket.create_connection((host, int(port)))).sendall(b"GET /")
        operators = [held.enter_context(daemon.control()) for _ in range(OPERATORS + OPERATORS_KEPT)]
        assert all(operator.ask("reload")["ok"] for operator in operators)
        assert daemon.get("/healthz")[0] == 200
    assert [line["type"] for line in told] == sorted((line["type"] for line in told), reverse=True)
    assert told[0]["type"] == "hello" and told[-1]["type"] == "error"


async def test_rubbish_is_answered_a_little_at_a_time(listener, monkeypatch) -> None:
    turn_of: list[int] = []  # in which turn of the loop each line was looked at
    now = 0

    def parse(line: bytes, known: object) -> Subscription:
        turn_of.append(now)
        raise ProtocolError("subscription", "rubbish")

    monkeypatch.setattr(one_client, "parse_subscription", parse)
    server = serve(listener)
    socks = [connect(listener) for _ in range(40)]
    for sock in socks:
        sock.send(b"x\n" * 500)
    for seconds in range(1, 4):
        looked_at = -1
        while len(turn_of) != looked_at:  # until all have had their share of this second
            looked_at = len(turn_of)
            for _ in range(10):
                now += 1
                await asyncio.sleep(0)
        assert 40 < len(turn_of) <= 40 * one_client.TURNS * seconds
        server.tick()
    assert max(map(turn_of.count, set(turn_of))) <= clients.LINES
    for sock in socks:
        sock.close()
    await server.close(0)


async def test_a_request_may_name_as_many_sensors_as_there_are_by_default(listener) -> None:
    server = serve(listener)
    names = [f"{n:064}" for n in range(64)]  # the longest
    with connect(listener) as client:
        client.send(json.dumps({"subscribe": {"sensors": names}}).encode() + b"\n")
        for _ in range(10):
            await turn()
        with pytest.raises(BlockingIOError):
            client.recv(1 << 16)
        assert [each.subscription.sensors for each in server._clients] == [frozenset(names)]
    await server.close(0)


async def test_each_bad_line_is_answered_and_the_connection_goes_on(listener) -> None:
    server = serve(listener)
    bad = [b"?", b"", b" \r", b"[" * 4000, b"?" * 20_000] * 30  # some are too long for one read, or for any request
    with connect(listener) as rude:
        for line in bad:
            rude.send(line + b"\n")
            for _ in range(25):  # more reads than the longest line takes
                await turn()
                server.tick()
            assert json.loads(rude.recv(1 << 16))["type"] == "error"
        assert server.count == 1
    await server.close(0)
