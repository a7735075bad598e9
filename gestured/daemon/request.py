"""Requests of the control socket: who asks, what each verb takes, and how it is answered, all as JSON lines."""

import asyncio
import os
import socket
import struct
from collections.abc import Awaitable, Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from inspect import signature
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from gestured.client.peer import CREDENTIALS
from gestured.core.errors import GesturedError
from gestured.core.messages import json_object, quoted
from gestured.daemon.values import expected

MAX_REQUEST_BYTES = 4096  # bytes of a request
BACKLOG_BYTES = 8 << 20  # the most bytes that wait for a connection with a stream; further lines are lost, and counted
SO_PEERGROUPS = 59  # Linux 4.13; not in Python's socket module

Reply = dict[str, Any]
# An answer, and the lines that follow it, which are made as they are read.
ReplyStream = tuple[Reply, Iterator[bytes]]


@dataclass(frozen=True, slots=True)
class Peer:
    """The process and account of an operator's program."""

    pid: int
    uid: int
    ours: bool  # whether it is root, or the daemon's own user
    may: bool  # whether it may control the daemon: root, our own user, or a member of our group


def peer_of(sock: socket.socket) -> Peer:
    """The peer at the other end of a connected Unix socket, as the kernel knows it."""
    pid, uid, gid = CREDENTIALS.unpack(sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
    groups = {gid}
    try:
        raw = sock.getsockopt(socket.SOL_SOCKET, SO_PEERGROUPS, 1024)
        groups |= set(struct.unpack(f"{len(raw) // 4}I", raw))
    except OSError:
        pass  # an old kernel, or a peer in more groups than fit: only its first group counts
    ours = uid in (0, os.geteuid())
    return Peer(pid, uid, ours, ours or os.getegid() in groups)


class Connection:
    """One operator's connection to the control socket."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self.lost = 0  # lines that found no room in the backlog
        self.streams = False  # whether it is sent a stream of lines, and need not ask for anything
        self.flush: Callable[[], None] = lambda: None  # sends what waits elsewhere for this connection
        self._over = False

    def send(self, text: bytes, *, lines: int = 1) -> bool:
        """Send a line, or several, or count them as lost if too much waits already; never blocks."""
        if self.closed:
            return False
        if self.unread > BACKLOG_BYTES:
            self.lost += lines
            return False
        self._writer.write(text)
        return True

    @property
    def unread(self) -> int:
        """Bytes that wait to be sent, without those that the kernel has taken."""
        return 0 if self.closed else self._writer.transport.get_write_buffer_size()

    @property
    def closed(self) -> bool:
        """Whether the operator has gone, or wants no more."""
        return self._over or self._writer.is_closing()

    def end(self) -> None:
        """Send what already waits for this connection, and nothing after it."""
        self.flush()
        self._over = True


class Refusal(GesturedError):
    """A request that is not carried out; the text is the reason."""


@dataclass(frozen=True, slots=True)
class Verb:
    """One verb: `run(connection, **keys)` answers or raises Refusal; its signature says which keys it takes."""

    run: Callable[..., Awaitable[Reply | ReplyStream]]
    changes: bool = True  # whether it changes anything, so that it is logged
    slow: bool = False  # whether it waits for another thread; quick verbs do not wait for slow ones


@cache
def _keys_of(run: Callable[..., object]) -> type[BaseModel]:
    """A model of the keys that a verb takes. It is made when the verb is first asked for, since that takes a while."""
    found = [one for one in signature(run).parameters.values() if one.name != "connection"]
    keys: dict[str, Any] = {
        one.name: (one.annotation, ... if one.default is one.empty else one.default) for one in found
    }
    return create_model("Keys", __config__=ConfigDict(extra="forbid", strict=True, allow_inf_nan=False), **keys)


def parse_request(line: bytes, verbs: Mapping[str, Verb]) -> tuple[str, dict[str, Any]]:
    """(verb, keys) of one line; raises Refusal with the key, what was found and what was expected."""
    request = json_object(line)
    if request is None or not isinstance(request.get("verb"), str):
        raise Refusal('expected one JSON object a line with a "verb", such as {"verb":"status"}')
    name = request.pop("verb")
    if name not in verbs:
        raise Refusal(f"verb: unknown {quoted(name)}, expected one of {', '.join(verbs)}")
    keys = _keys_of(verbs[name].run)
    try:
        found = keys.model_validate(request)
    except ValidationError as error:
        problem = error.errors(include_url=False, include_context=False)[-1]  # pydantic puts unknown keys at the end
        if problem["type"] == "extra_forbidden":
            known = ", ".join(keys.model_fields) or "no key"
            raise Refusal(f"{name}: unknown key {quoted(problem['loc'][0])}, expected {known}") from error
        place = ".".join(map(str, (name, *problem["loc"])))
        if problem["type"] == "missing":
            raise Refusal(f"{place}: is missing") from error
        raise Refusal(f"{place}: {expected(problem)}, found {quoted(problem['input'])}") from error
    return name, {key: getattr(found, key) for key in found.model_fields_set}
