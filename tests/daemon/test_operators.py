"""Operators who ask without end, do not read, or do nothing at all: the loop and the other operators go on."""

import asyncio
import json
import os
import re
import socket
import tempfile
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import uvloop

from gestured.client.control import Control
from gestured.client.lines import Refused
from gestured.daemon import control, log
from gestured.daemon.control import ControlServer
from gestured.daemon.request import Connection, Reply, ReplyStream, Verb
from tests.daemon.harness import Daemon, Sensor, lines_of

LINE = b"x" * 999 + b"\n"
LINES = 10_000


class Desk:
    """Verbs that remember at which turn of the loop they were called."""

    def __init__(self) -> None:
        self.turn = 0
        self.asked: list[int] = []
        self.made: list[int] = []  # the turn of each line of a stream
        self.verbs = {"ask": Verb(self.ask), "tap": Verb(self.tap), "stream": Verb(self.stream)}

    async def ask(self, connection: Connection) -> Reply:
        self.asked.append(self.turn)
        return {}

    async def tap(self, connection: Connection) -> Reply:
        connection.streams = True
        return {}

    async def stream(self, connection: Connection) -> ReplyStream:
        return {}, self.lines()

    def lines(self) -> Iterator[bytes]:
        for _ in range(LINES):
            self.made.append(self.turn)
            yield LINE

    def tick(self) -> None:
        self.turn += 1
        self.ticking = asyncio.get_running_loop().call_soon(self.tick)


@asynccontextmanager
async def open_desk(folder: Path) -> AsyncIterator[tuple[Desk, str]]:
    desk, path = Desk(), str(folder / "c")
    with socket.socket(socket.AF_UNIX) as sock:
        sock.bind(path)
        sock.listen()
        sock.setblocking(False)
        server = ControlServer(sock, desk.verbs)
        await server.start()
        desk.tick()
        yield desk, path
        desk.ticking.cancel()
        server.close()


async def answer(reader: asyncio.StreamReader) -> dict[str, Any]:
    return json.loads(await reader.readline())


async def test_between_two_requests_the_loop_turns_whoever_asks(tmp_path: Path) -> None:
    async with open_desk(tmp_path) as (desk, path):
        clients = [await asyncio.open_unix_connection(path) for _ in range(5)]
        for _, writer in clients:
            writer.write(b'{"verb":"ask"}\n' * 100 + b'{"verb":"?"}\n' * 100)
        for reader, writer in clients:
            assert [(await answer(reader))["ok"] for _ in range(200)] == [True] * 100 + [False] * 100
            writer.close()
        assert len(desk.asked) == 500 and len(set(desk.asked)) == 500


async def test_a_stream_is_made_as_it_is_read_in_small_pieces_and_one_at_a_time(tmp_path: Path) -> None:
    async with open_desk(tmp_path) as (desk, path):
        reader, writer = await asyncio.open_unix_connection(path)
        other, asking = await asyncio.open_unix_connection(path)
        writer.write(b'{"verb":"stream"}\n' * 2)
        made = -1
        while len(desk.made) != made:  # until nothing more is made, because nobody reads
            made = len(desk.made)
            for _ in range(20):
                asking.write(b'{"verb":"ask"}\n')
                await answer(other)
        assert 0 < made < LINES / 2
        asking.write(b'{"verb":"stream"}\n')
        assert "somebody else" in (await answer(other))["reason"]
        for _ in range(2):
            assert await answer(reader) == {"ok": True}
            assert await reader.readexactly(LINES * len(LINE)) == LINE * LINES
        assert len(desk.made) == 2 * LINES
        most = control.TURN_BYTES // len(LINE) + 1
        assert max(map(desk.made.count, set(desk.made[:LINES]))) <= most
        for each in (writer, asking):
            each.close()


async def test_who_asks_nothing_for_long_gives_his_place_to_others_but_a_tap_stays(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(control, "IDLE_S", 0.01)
    async with open_desk(tmp_path) as (_, path):
        tap, tapping = await asyncio.open_unix_connection(path)
        tapping.write(b'{"verb":"tap"}\n')
        await answer(tap)
        for sent in (b"", b'{"verb"'):
            idle, writer = await asyncio.open_unix_connection(path)
            writer.write(sent)
            assert "nothing was asked" in (await answer(idle))["reason"] and await idle.read() == b""
            writer.close()
        tapping.write(b'{"verb":"ask"}\n')
        assert await answer(tap) == {"ok": True}
        tapping.close()


async def test_who_does_not_read_an_answer_is_hung_up_on(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(control, "UNREAD_S", 0.01)
    async with open_desk(tmp_path) as (_, path):
        reader, writer = await asyncio.open_unix_connection(path, limit=1)  # it reads next to nothing by itself
        writer.write(b'{"verb":"stream"}\n')
        other, asking = await asyncio.open_unix_connection(path, limit=2000)
        said: dict[str, Any] = {"ok": False, "reason": "somebody else"}
        while not said["ok"]:
            assert "somebody else" in said["reason"]
            asking.write(b'{"verb":"stream"}\n')
            said = await answer(other)
        with pytest.raises(ConnectionResetError):
            while await reader.read(LINES):
                pass
            raise ConnectionResetError
        for each in (writer, asking):
            each.close()


def test_members_of_the_group_cannot_take_all_places(start) -> None:
    if os.getuid() != 0:
        pytest.skip("only root can be somebody else for a moment")
    with tempfile.TemporaryDirectory() as folder, ExitStack() as open_ones:
        os.chmod(folder, 0o755)
        path = Path(start("--control", f"{folder}/control").ready["control"])
        os.seteuid(65534)  # the group stays
        try:
            taken = [open_ones.enter_context(Control(path)) for _ in range(control.OPERATORS)]
            assert all(one.ask("status")["ok"] for one in taken)
            with Control(path) as member, pytest.raises(Refused, match="more than 16 connections"):
                member.ask("status")
        finally:
            os.seteuid(0)
        with Control(path) as root:
            assert root.ask("status")["ok"]


def test_one_tap_a_connection_and_what_is_repeated_is_logged_at_a_bounded_rate(start) -> None:
    daemon = start()
    with daemon.control() as operator:
        assert operator.ask("tap")["ok"]
        for _ in range(100):
            with pytest.raises(Refused, match="a tap already"):
                operator.ask("tap")
        assert operator.ask("status")["taps"] == 1
    daemon.stop()
    said = [line for line in lines_of(daemon.stderr()) if line["event"] == "control request"]
    assert len(said) == control.LOGGED and {line["verb"] for line in said} == {"tap"}


def test_a_bounded_rate_says_the_first_ones_and_counts_the_others(monkeypatch) -> None:
    clock, said = [0.0], []
    monkeypatch.setattr(log, "log", type("Log", (), {"info": staticmethod(lambda event, **more: said.append(more))}))
    throttle = log.Throttle(lambda: clock[0], burst=2)
    for now in (0.0, 1.0, 2.0, 9.0, 10.0, 11.0, 12.0):
        clock[0] = now
        throttle.info("event", "why")
    throttle.info("event", "why else")
    assert [line["count"] for line in said] == [1, 1, 3, 1, 1]


def peak_bytes(daemon: Daemon) -> int:
    """The most memory that it has had."""
    status = Path(f"/proc/{daemon.process.pid}/status").read_text()
    return int(re.findall(r"VmHWM:\s+(\d+) kB", status)[0]) << 10


def test_a_crowd_that_asks_for_the_flight_recorder_without_end_costs_no_event_and_little_memory(start) -> None:
    daemon = start("--clock", "sensor", "--flight-recorder", 16, "--metrics", "127.0.0.1:0")
    client = daemon.client()
    sensor = Sensor(daemon, "arm").begin()
    with daemon.control() as operator, ExitStack() as crowd:
        while operator.ask("status")["flight_recorder"]["held_bytes"] < 4 << 20:  # tiny packets: the most lines
            for _ in range(500):
                sensor.sock.send(b"x")
        before = peak_bytes(daemon)
        for _ in range(15):
            rude = crowd.enter_context(daemon.control())
            rude.socket.sendall(b'{"verb":"flight"}\n' * 200)
        for _ in range(3):
            sensor.begin().perform("left")
            client.events("gesture", "arm")
            assert operator.ask("status")["ok"] and daemon.get("/healthz")[0] == 200
        assert peak_bytes(daemon) - before < 24 << 20


async def test_who_comes_while_the_daemon_ends_is_asked_nothing(tmp_path: Path) -> None:
    """What a verb looks at may be closed already."""
    desk = Desk()
    with socket.socket(socket.AF_UNIX) as sock:
        sock.bind(str(tmp_path / "c"))
        sock.listen()
        server = ControlServer(sock, desk.verbs)
        await server.start()
        server.close()
        ours, theirs = socket.socketpair()
        with theirs:
            reader, writer = await asyncio.open_unix_connection(sock=ours)  # it was taken a moment before
            theirs.sendall(b'{"verb":"ask"}\n')
            theirs.shutdown(socket.SHUT_WR)
            await server._serve(reader, writer)
    assert desk.asked == []


@pytest.mark.parametrize("asked", [b'{"verb":"stream"}\n', b'{"verb":"?"}\n' * 50, b'{"verb":"ask"}\n' * 50])
def test_who_leaves_while_he_is_answered_is_no_bug(tmp_path: Path, asked: bytes) -> None:
    """The daemon's own loop refuses to write to whom it has hung up on."""

    async def main() -> list[Any]:
        wrong: list[Any] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, what: wrong.append(what))
        async with open_desk(tmp_path) as (_, path):
            other, asking = await asyncio.open_unix_connection(path)
            asking.write(b'{"verb":"ask"}\n' * 100)  # so that each of the others waits for his turns
            with ExitStack() as crowd:
                for _ in range(5):
                    rude = crowd.enter_context(socket.socket(socket.AF_UNIX))
                    rude.connect(path)
                    rude.sendall(asked)
                for _ in range(10):
                    await answer(other)
            for _ in range(90):
                await answer(other)
            asking.close()
        return wrong

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        assert runner.run(main()) == []


async def test_what_has_begun_when_the_daemon_ends_does_not_go_on(tmp_path: Path) -> None:
    """A reload would open anew what the end has closed."""
    done: list[str] = []
    begun, over = asyncio.Event(), asyncio.Event()

    async def reload(connection: Connection) -> Reply:
        begun.set()
        await over.wait()
        done.append("reloaded")
        return {}

    async with open_desk(tmp_path) as (desk, path):
        desk.verbs["reload"] = Verb(reload, slow=True)
        _, writer = await asyncio.open_unix_connection(path)
        writer.write(b'{"verb":"reload"}\n')
        await begun.wait()
    over.set()
    writer.close()
    await asyncio.gather(*asyncio.all_tasks() - {asyncio.current_task()}, return_exceptions=True)
    assert done == []
