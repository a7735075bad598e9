"""Which account serves a Unix socket, and whether a client trusts it.

A client shows what a daemon says, and opens files that it names. So it asks nothing of a stranger: a path says where a
daemon should be, not who is there.
"""

import os
import pwd
import socket
import stat
import struct
from pathlib import Path

from gestured.core.errors import GesturedError

CREDENTIALS = struct.Struct("iII")  # pid, uid, gid: struct ucred of Linux


class Stranger(GesturedError):
    """The socket is served by an account that this client does not trust."""


def check_peer(connected: socket.socket, path: Path, flag: str) -> None:
    """Raises Stranger unless `path` is served by root, by ourselves, or by the account that root gave its folder to.

    The kernel says who made the socket listen, whatever stands at the path by now. An error names the option `flag`.
    """
    credentials = connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
    _, uid, _ = CREDENTIALS.unpack(credentials)
    if uid not in (0, os.geteuid(), _given_to(path.absolute().parent)):
        raise Stranger(
            f"{path} is served by uid {uid}{_name(uid)}, who is neither root nor you, nor has root made its folder for "
            f"that account; nothing was asked of it; name your daemon's {flag}, or ask as that account"
        )


def _given_to(folder: Path) -> int | None:
    """The account that owns a folder which only root can have put there; None where anybody else could have.

    So each folder above it must be root's, and nobody else's to write into. Links are not followed.
    """
    try:
        found = folder.lstat()
        above = [parent.lstat() for parent in folder.parents]
    except OSError:
        return None
    folders = all(stat.S_ISDIR(one.st_mode) for one in (found, *above))
    roots = all(one.st_uid == 0 and not one.st_mode & (stat.S_IWGRP | stat.S_IWOTH) for one in above)
    return found.st_uid if folders and roots else None


def _name(uid: int) -> str:
    try:
        return f" ({pwd.getpwuid(uid).pw_name})"
    except KeyError:
        return ""
