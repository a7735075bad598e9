"""Who asks on the control socket: a connection, and the account at its other end."""

import asyncio
import os
import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass

from gestured.client.peer import CREDENTIALS

BACKLOG_BYTES = 8 << 20  # bytes that wait for a connection with a stream at most; lines beyond are lost, and counted
SO_PEERGROUPS = 59  # Linux 4.13; not in Python's socket module


class Connection:
    """One operator's connection to the control socket."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self.lost = 0  # lines that found no room in the backlog
        self.streams = False  # whether it is sent a stream of lines, and need not ask for anything
        self.flush: Callable[[], None] = lambda: None  # has what waits for this connection sent
        self._over = False

    def send(self, text: bytes, *, lines: int = 1) -> bool:
        """Send a line, or several, or count them as lost where too much waits already; never blocks."""
        if self.closed:
            return False
        if self.unread > BACKLOG_BYTES:
            self.lost += lines
            return False
        self._writer.write(text)
        return True

    @property
    def unread(self) -> int:
        """Bytes that wait to be read, without those that the kernel keeps."""
        return 0 if self.closed else self._writer.transport.get_write_buffer_size()

    @property
    def closed(self) -> bool:
        """Whether the operator has gone, or wants no more."""
        return self._over or self._writer.is_closing()

    def end(self) -> None:
        """Send nothing more after what waits for this connection already."""
        self.flush()
        self._over = True


@dataclass(frozen=True, slots=True)
class Peer:
    """The process and account of an operator's program."""

    pid: int
    uid: int
    ours: bool  # whether it is root, or the daemon's own user
    may: bool  # whether it may control the daemon: root, our own user, or a member of our group


def peer_of(sock: socket.socket) -> Peer:
    """Who is at the other end of a connected Unix socket: the kernel says it, whatever the peer claims."""
    pid, uid, gid = CREDENTIALS.unpack(sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
    groups = {gid}
    try:
        raw = sock.getsockopt(socket.SOL_SOCKET, SO_PEERGROUPS, 1024)
        groups |= set(struct.unpack(f"{len(raw) // 4}I", raw))
    except OSError:
        pass  # an old kernel, or in more groups than fit: its first group counts
    ours = uid in (0, os.geteuid())
    return Peer(pid, uid, ours, ours or os.getegid() in groups)
