"""The control socket: one JSON object a line in, one JSON object a line out, for the daemon's owner and group.

The bridges' socket for gates has the same protocol, with verbs of its own, for whoever may open its file.

A request is `{"verb": NAME, ...}`, checked as a whole before anything changes; the signature of a verb's function says
what it takes (`request.Verb`). An answer is `{"ok": true, ...}` or `{"ok": false, "reason": "..."}`. Requests of one
connection are answered one after the other, and those of all connections in turns, between which the loop serves
frames. The event socket has no verbs, and nobody can change anything through it.
"""

import asyncio
import socket
import sys
import time
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

from gestured.core.errors import GesturedError
from gestured.core.messages import json_line
from gestured.daemon.log import Throttle
from gestured.daemon.request import MAX_REQUEST_BYTES, Connection, Peer, Refusal, Reply, Verb, parse_request, peer_of

OPERATORS = 16  # connections at a time
OPERATORS_KEPT = 4  # connections beyond OPERATORS for root and our own user: no member of the group can lock them out
IDLE_S = 60.0  # a connection without a request and without a stream is closed after so long
UNREAD_S = 10.0  # a connection is cut off if an answer is not read for so long
LOGGED = 8  # log lines of one verb and user in log.PERIOD_S; further ones are counted
TURN_BYTES = 16 << 10  # bytes of a stream that are made in one turn: less than a millisecond's work
TURN_PAUSE_S = 0.1  # the longest pause after a turn
# From Python 3.13 on, a server that closes removes its socket's path. Here whoever made the path does that.
STAYS: dict[str, Any] = {"cleanup_socket": False} if sys.version_info >= (3, 13) else {}


class ControlServer:
    """Answers requests on a listening Unix socket; call `start` before anything else."""

    def __init__(self, sock: socket.socket, verbs: Mapping[str, Verb], *, guarded: bool = True) -> None:
        """`guarded`: whether the peer's account is checked, besides the permissions of the socket's file."""
        self._sock, self._verbs, self._guarded = sock, verbs, guarded
        self._throttle, self._journal = Throttle(), Throttle(burst=LOGGED)
        self._open: dict[asyncio.StreamWriter, asyncio.Task[None] | None] = {}  # connections, each with its task
        self._served = 0  # connections that hold one of the places
        self._ended = False
        self._streaming = False  # whether a stream is being sent: one at a time, since each keeps its lines in memory
        self._quick, self._slow = asyncio.Lock(), asyncio.Lock()

    async def start(self) -> None:
        """Accept connections from now on."""
        self._server = await asyncio.start_unix_server(self._serve, sock=self._sock, limit=MAX_REQUEST_BYTES, **STAYS)

    def close(self) -> None:
        """Hang up and cancel all requests, so that what verbs read or change may be closed from now on."""
        self._ended = True
        self._server.close()
        for writer, task in tuple(self._open.items()):
            writer.close()
            if task is not None:
                task.cancel()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._open[writer] = asyncio.current_task()
        try:
            who = peer_of(writer.get_extra_info("socket"))
            places = OPERATORS + (OPERATORS_KEPT if who.ours else 0)
            if self._guarded and not who.may:
                self._throttle.warn("control refused", "peer", uid=who.uid, pid=who.pid)
                _write(writer, _refusal("only root, the daemon's user and its group may control it"))
            elif self._served >= places:
                self._throttle.warn("control refused", "places", uid=who.uid, pid=who.pid, limit=places)
                _write(writer, _refusal(f"more than {places} connections"))
            else:
                self._served += 1
                try:
                    await self._answer_all(reader, writer, who)
                finally:
                    self._served -= 1
            if not writer.is_closing():  # uvloop sets no limits on a closed transport
                writer.transport.set_write_buffer_limits(0)
                await _drain(writer)
        except (OSError, asyncio.CancelledError):
            pass  # the operator has gone, or the daemon ends
        finally:
            del self._open[writer]
            writer.close()

    async def _answer_all(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, who: Peer) -> None:
        connection = Connection(writer)
        while True:
            try:
                async with asyncio.timeout(None if connection.streams else IDLE_S):
                    line = await reader.readline()
            except TimeoutError:
                _write(writer, _refusal(f"nothing was asked for {IDLE_S:g} s; connect again"))
                return
            except ValueError:  # the rest of a line that is too long cannot be told from the next line
                _write(writer, _refusal(f"a request has at most {MAX_REQUEST_BYTES} bytes"))
                return
            if not line:
                connection.end()
                return
            if line.strip():
                await self._answer(connection, writer, line, who)
                await _drain(writer)

    async def _answer(self, connection: Connection, writer: asyncio.StreamWriter, line: bytes, who: Peer) -> None:
        async with self._turn(self._quick):
            try:
                name, parameters = parse_request(line, self._verbs)
            except Refusal as refusal:
                _write(writer, _refusal(str(refusal)))
                return
            verb = self._verbs[name]
            if verb.changes:
                user = {"verb": name, "uid": who.uid, "pid": who.pid}
                self._journal.info("control request", f"{name}, of uid {who.uid}", **user, **parameters)
        async with self._turn(self._slow if verb.slow else self._quick):
            if connection.closed or self._ended:  # the operator left while the request waited for its turn
                return
            answer, lines = await self._run(connection, verb, parameters)
            _write(writer, json_line(answer))  # before the lines that the verb streams
        if lines is not None:
            self._streaming = True
            try:
                await self._stream(connection, writer, lines)
            finally:
                self._streaming = False

    async def _run(
        self, connection: Connection, verb: Verb, parameters: Mapping[str, Any]
    ) -> tuple[Reply, Iterator[bytes] | None]:
        try:
            found = await verb.run(connection, **parameters)
            answer, lines = found if isinstance(found, tuple) else (found, None)
            if lines is not None and self._streaming:
                raise Refusal("the recording is being sent to somebody else; ask again when that is over")
            return {"ok": True, **answer}, lines
        except GesturedError as error:
            return {"ok": False, "reason": str(error)}, None
        except Exception:  # a bug in a verb costs this answer alone
            self._throttle.error("a bug in a verb", "control")
            return {"ok": False, "reason": "a bug; the daemon's log has the traceback"}, None

    async def _stream(self, connection: Connection, writer: asyncio.StreamWriter, lines: Iterator[bytes]) -> None:
        while not connection.closed:
            async with self._turn(self._quick):
                size = 0
                for line in lines:
                    _write(writer, line)
                    size += len(line)
                    if size >= TURN_BYTES:
                        break
            if size < TURN_BYTES:
                return
            await _drain(writer)

    @asynccontextmanager
    async def _turn(self, lock: asyncio.Lock) -> AsyncIterator[None]:
        """A turn of one operator, and a pause of the same length, so that half of the loop's time is left to frames."""
        async with lock:
            began = time.perf_counter()
            yield
            await asyncio.sleep(min(time.perf_counter() - began, TURN_PAUSE_S))


def _write(writer: asyncio.StreamWriter, line: bytes) -> None:
    """Write to a connection unless it is closed, for which uvloop would raise RuntimeError."""
    if not writer.is_closing():
        writer.write(line)


async def _drain(writer: asyncio.StreamWriter) -> None:
    """Wait until the kernel has all that was written. Raises TimeoutError if nobody reads for UNREAD_S."""
    try:
        async with asyncio.timeout(UNREAD_S):
            await writer.drain()
    except TimeoutError:
        writer.transport.abort()
        raise


def _refusal(reason: str) -> bytes:
    return json_line({"ok": False, "reason": reason})
