"""Which process holds a port, as far as Linux tells us."""

import errno
import os
import socket
from pathlib import Path

from gestured.core.address import Address

TABLES: dict[int, tuple[str, str]] = {socket.SOCK_DGRAM: ("udp", "udp6"), socket.SOCK_STREAM: ("tcp", "tcp6")}
LISTENS = "0A"  # the state TCP_LISTEN
PROC = Path("/proc")


def bind_failure(error: OSError, address: Address, kind: int) -> str:
    """Why an address cannot be bound, and by whom it is taken where that can be known."""
    reason = error.strerror or str(error)
    taken = holder(address.port, kind) if error.errno == errno.EADDRINUSE else None
    return f"{reason} by {taken}" if taken else reason


def holder(port: int, kind: int) -> str | None:
    """`NAME (pid N)` of a process that has this port of TCP or UDP; None where we may not know."""
    inodes = {f"socket:[{inode}]" for table in TABLES[kind] for inode in _inodes(table, port, kind)}
    for folder in PROC.glob("[0-9]*") if inodes else ():
        try:
            if any(os.readlink(link) in inodes for link in (folder / "fd").iterdir()):
                return f"{(folder / 'comm').read_text().strip()} (pid {folder.name})"
        except OSError:
            continue  # the process is another user's, or has just ended
    return None


def _inodes(table: str, port: int, kind: int) -> list[str]:
    """The inodes of the sockets that are bound to a port."""
    try:
        rows = (PROC / "net" / table).read_text().splitlines()[1:]
    except OSError:
        return []
    found = []
    for row in rows:
        _, local, _, state, *rest = row.split()
        if int(local.rpartition(":")[2], 16) == port and (kind == socket.SOCK_DGRAM or state == LISTENS):
            found.append(rest[5])
    return found
