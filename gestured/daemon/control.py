"""The control socket: one JSON object a line in, one JSON object a line out, for the daemon's owner and group.

A request is `{"verb": NAME, ...}`, checked as a whole before anything happens; what a verb takes stands in one
table (`operations.verbs`). An answer is `{"ok": true, ...}` or `{"ok": false, "reason": "..."}`. Requests of one
connection are answered one after the other. The event socket knows none of this: it stays read-only.
"""

import asyncio
import json
import os
import socket
import struct
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gestured.core.errors import GesturedError
from gestured.daemon.log import Throttle, log

MAX_LINE = 4096  # bytes of a request
CONNECTIONS = 16
BACKLOG_BYTES = 8 << 20  # of a connection that packets are streamed to; what is above is lost, and counted
SO_PEERGROUPS = 59  # Linux 4.13; not in Python's socket module

Answer = dict[str, Any]


class Refusal(GesturedError):
    """A request that is not carried out; the text is the reason."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """What a request may say: a JSON type, in words for those who got it wrong, and whether it must be there."""

    kind: type | tuple[type, ...]
    words: str
    required: bool = False
    check: Callable[[Any], bool] = lambda value: True


@dataclass(frozen=True, slots=True)
class Verb:
    """What `run(connection, **parameters)` does; it gives the answer or raises Refusal."""

    run: Callable[..., Awaitable[Answer]]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    changes: bool = True  # and so is logged


def parse_request(line: bytes, verbs: Mapping[str, Verb]) -> tuple[str, dict[str, Any]]:
    """(verb, parameters) of one line; raises Refusal with the key, what was found and what was expected."""
    try:
        request = json.loads(line)
    except (ValueError, RecursionError):
        raise Refusal('expected one JSON object a line, such as {"verb":"status"}') from None
    if not isinstance(request, dict) or not isinstance(request.get("verb"), str):
        raise Refusal('verb: expected one JSON object with a "verb", such as {"verb":"status"}')
    name = request.pop("verb")
    if name not in verbs:
        raise Refusal(f"verb: unknown {_short(name)}, expected one of {', '.join(verbs)}")
    known = verbs[name].parameters
    for key, value in request.items():
        if key not in known:
            raise Refusal(f"{name}: unknown key {_short(key)}, expected {', '.join(known) or 'no key'}")
        parameter = known[key]
        wrong = isinstance(value, bool) and parameter.kind is not bool
        if wrong or not isinstance(value, parameter.kind) or not parameter.check(value):
            raise Refusal(f"{name}.{key}: expected {parameter.words}, found {_short(value)}")
    for key, parameter in known.items():
        if parameter.required and key not in request:
            raise Refusal(f"{name}.{key}: is missing, expected {parameter.words}")
    return name, request


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


class Connection:
    """One operator's connection."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self.lost = 0  # lines that found no room
        self._over = False

    def send(self, line: bytes) -> bool:
        """Send a line, or count it as lost where too much waits already; never blocks."""
        if self.closed:
            return False
        if self._writer.transport.get_write_buffer_size() > BACKLOG_BYTES:
            self.lost += 1
            return False
        self._writer.write(line)
        return True

    async def pour(self, lines: Iterable[bytes]) -> None:
        """Send them all, as fast as they are read."""
        try:
            for line in lines:
                self._writer.write(line)
                await self._writer.drain()
        except OSError:
            pass  # the reader went

    @property
    def closed(self) -> bool:
        """Whether the operator has gone, or wants no more."""
        return self._over or self._writer.is_closing()

    def end(self) -> None:
        """Send nothing more; what is on its way still goes."""
        self._over = True


class ControlServer:
    """Answers on a listening Unix socket. `start` before anything else."""

    def __init__(self, sock: socket.socket, verbs: Mapping[str, Verb]) -> None:
        self._sock, self._verbs = sock, verbs
        self._throttle = Throttle()
        self._open: set[asyncio.StreamWriter] = set()

    async def start(self) -> None:
        """Take connections from now on."""
        self._server = await asyncio.start_unix_server(self._serve, sock=self._sock, limit=MAX_LINE)

    def close(self) -> None:
        """Take no more, and hang up."""
        self._server.close()
        for writer in tuple(self._open):
            writer.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._open.add(writer)
        try:
            who = _peer(writer.get_extra_info("socket"))
            if not who.may:
                self._throttle.warn("control refused", "peer", uid=who.uid, pid=who.pid)
                writer.write(_refusal("only root, the daemon's user and its group may control it"))
            elif len(self._open) > CONNECTIONS:
                writer.write(_refusal(f"more than {CONNECTIONS} connections"))
            else:
                await self._answer_all(reader, writer, who)
            await writer.drain()
        except (OSError, asyncio.CancelledError):
            pass  # gone, or we end
        finally:
            self._open.discard(writer)
            writer.close()

    async def _answer_all(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, who: "Peer") -> None:
        connection = Connection(writer)
        while True:
            try:
                line = await reader.readline()
            except ValueError:  # what is longer cannot be told from what follows it
                writer.write(_refusal(f"a request has at most {MAX_LINE} bytes"))
                return
            if not line:
                connection.end()
                return
            if line.strip():
                # On its way before what the verb streams after it.
                writer.write(_line(await self._answer(connection, line, who)))
                await writer.drain()

    async def _answer(self, connection: Connection, line: bytes, who: "Peer") -> Answer:
        try:
            name, parameters = parse_request(line, self._verbs)
            verb = self._verbs[name]
            if verb.changes:
                log.info("control", verb=name, uid=who.uid, pid=who.pid, **parameters)
            return {"ok": True, **await verb.run(connection, **parameters)}
        except GesturedError as error:
            return {"ok": False, "reason": str(error)}
        except Exception:  # a bug in a verb is this answer's end, not the daemon's
            self._throttle.error("a bug in a verb", "control")
            return {"ok": False, "reason": "a bug; the daemon's log has the traceback"}


def _line(answer: Mapping[str, Any]) -> bytes:
    return json.dumps(answer, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def _refusal(reason: str) -> bytes:
    return _line({"ok": False, "reason": reason})


@dataclass(frozen=True, slots=True)
class Peer:
    """Who is at the other end."""

    pid: int
    uid: int
    may: bool


def _peer(sock: Any) -> Peer:
    """Root, our own user, or a member of our group; the kernel says who it is, whatever the peer claims."""
    pid, uid, gid = struct.unpack("iII", sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
    groups = {gid}
    try:
        raw = sock.getsockopt(socket.SOL_SOCKET, SO_PEERGROUPS, 1024)
        groups |= set(struct.unpack(f"{len(raw) // 4}I", raw))
    except OSError:
        pass  # an old kernel, or in more groups than fit: its first group counts
    return Peer(pid, uid, uid in (0, os.geteuid()) or os.getegid() in groups)
