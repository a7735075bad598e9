"""The peer of a client: which account serves a Unix socket, and whether the client trusts it.

A client shows what a daemon says, and opens files that the daemon names. So a client asks nothing of a stranger: a path
says where a daemon should be, but not who is there.
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

    The kernel says which account made the socket listen, whatever is at `path` now. An error names the option `flag`.
    """
    credentials = connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
    _, uid, _ = CREDENTIALS.unpack(credentials)
    if uid not in (0, os.geteuid(), _given_to(path.absolute().parent)):
        raise Stranger(
            f"{path} is served by uid {uid}{_name(uid)}, who is neither root nor you, nor has root made its folder for "
            f"that account; nothing was asked of it; name your daemon's {flag}, or ask as that account"
        )


def _given_to(folder: Path) -> int | None:
    """The account that owns a folder which only root can have put there; None if anybody else could have.

    So each folder above it must belong to root, and nobody else may write into it. Links are not followed.
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
