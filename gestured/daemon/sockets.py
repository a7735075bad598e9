"""The daemon's sockets. All are made before the daemon is ready; if one cannot be had, it exits with status 4."""

import errno
import fcntl
import os
import socket
import stat
import sys
from contextlib import suppress
from pathlib import Path

from gestured.client.address import NUMERIC, SOCKET_PATH_BYTES, bind_failure, look_up
from gestured.core.address import Address
from gestured.core.errors import GesturedError

RECEIVE_BYTES = 4 << 20  # twenty times the usual default, for what sensors send while the loop stands still
BACKLOG = 1024  # connections that wait to be accepted: a thousand clients may come back at once after a restart
AGAIN_S = 1.0  # the pause before another attempt to accept a connection for which there was no descriptor
SO_RCVBUFFORCE = 33  # Linux; these three are not in Python's socket module
SO_TIMESTAMPNS = 35
SO_MEMINFO = 55  # it gives nine numbers, the last of which counts dropped packets


class AddressError(GesturedError):
    """An address or a socket that cannot be bound."""


def _bind(key: str, address: Address, kind: int) -> socket.socket:
    try:
        family, where = look_up(address, kind)
        sock = socket.socket(family, kind | socket.SOCK_NONBLOCK)
    except OSError as error:
        raise AddressError(f"{key}: cannot use {address}: {error.strerror}") from error
    try:
        if kind == socket.SOCK_STREAM:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(where)
    except OSError as error:
        sock.close()
        raise AddressError(f"{key}: cannot bind {address}: {bind_failure(error, address, kind)}") from error
    return sock


def bind_udp(address: Address) -> socket.socket:
    """A non-blocking UDP socket with a receive buffer as large as the kernel grants. Raises AddressError."""
    sock = _bind("listen", address, socket.SOCK_DGRAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BYTES)  # beyond the limit, for CAP_NET_ADMIN
    except OSError:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
    stamp_arrivals(sock)
    return sock


def stamp_arrivals(sock: socket.socket) -> None:
    """Have the kernel stamp each datagram from now on with its arrival."""
    sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)


def kernel_drops(sock: socket.socket) -> int:
    """How many datagrams the kernel has dropped because the socket's buffer was full."""
    return int.from_bytes(sock.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 36)[32:], sys.byteorder)


def reason_of(error: OSError) -> str:
    """The name of an error, such as EMFILE."""
    return errno.errorcode.get(error.errno or 0, str(error))


def bind_tcp(address: Address) -> socket.socket:
    """A listening, non-blocking TCP socket. Raises AddressError."""
    sock = _bind("metrics", address, socket.SOCK_STREAM)
    sock.listen(BACKLOG)
    return sock


def name_of(sock: socket.socket) -> str:
    """HOST:PORT that an IP socket is bound to, a link-local host with its interface; or the path of a Unix socket."""
    where = sock.getsockname()
    if sock.family == socket.AF_UNIX:
        return str(where)
    host, port = socket.getnameinfo(where, NUMERIC)  # of an interface that was unplugged, it gives the number
    return str(Address(host, int(port)))


class Listener:
    """A listening Unix stream socket that somebody else made, whose path is not ours to remove."""

    def __init__(self, sock: socket.socket) -> None:
        self.sock = sock
        self.path = Path(os.fsdecode(sock.getsockname()))


class UnixListener(Listener):
    """A listening Unix stream socket at `path` that no other daemon is using.

    A lock file beside it is held as long as we live, so two daemons that start at once cannot both win. What
    is already at the path is probed: a socket that answers is another program's, one that refuses is stale
    and replaced, anything else is not ours to remove.
    """

    def __init__(self, path: Path, key: str = "socket") -> None:
        """`key` is the setting that an error names. Raises AddressError."""
        self.path, self._key = path, key
        self._lock_path = path.with_name(path.name + ".lock")
        try:
            self._lock = self._take_lock()
        except OSError as error:
            raise AddressError(f"{self._key}: cannot make {self._lock_path}: {error.strerror}") from error
        try:
            self._clear()
            self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
            before = os.umask(0o117)  # the mode is 0660 from the start
            try:
                whole = path.absolute()  # `status --all` finds it in the kernel's table
                self.sock.bind(str(whole if len(os.fsencode(whole)) <= SOCKET_PATH_BYTES else path))
            finally:
                os.umask(before)
            self.sock.listen(BACKLOG)
            self._made = path.stat()
        except OSError as error:
            self._release_lock()
            raise AddressError(f"{self._key}: cannot bind {path}: {error.strerror}") from error
        except AddressError:
            self._release_lock()
            raise

    def close(self) -> None:
        """Remove the socket and the lock unless another daemon's stand there by now, and stop listening."""
        _remove(self.path, self._made)  # not after closing, when another file may get its inode number
        self.sock.close()
        self._release_lock()

    def _take_lock(self) -> int:
        while True:
            lock = os.open(self._lock_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o660)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.path.samestat(os.fstat(lock), os.stat(self._lock_path)):
                    return lock
            except BlockingIOError:
                os.close(lock)
                raise AddressError(f"{self._key}: another gestured is using {self.path}") from None
            except FileNotFoundError:
                pass  # its owner removed it between our open and our flock: try again
            os.close(lock)

    def _release_lock(self) -> None:
        _remove(self._lock_path, os.fstat(self._lock))
        os.close(self._lock)

    def _clear(self) -> None:
        try:
            mode = self.path.lstat().st_mode
        except FileNotFoundError:
            return
        if not stat.S_ISSOCK(mode):
            raise AddressError(f"{self._key}: {self.path} exists and is not a socket")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
            found = probe.connect_ex(str(self.path))
        if found != errno.ECONNREFUSED:
            raise AddressError(f"{self._key}: another program is using {self.path}")
        self.path.unlink()


def _remove(path: Path, ours: os.stat_result) -> None:
    """Remove a file if it is still the one that we made."""
    with suppress(OSError):  # the file is gone already
        if os.path.samestat(path.lstat(), ours):
            path.unlink()


def make_default_directory(directory: Path) -> None:
    """Make the folder of the default socket, for its owner alone. Raises AddressError."""
    try:
        directory.mkdir(0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise AddressError(
            f"socket: cannot make {directory}: {error.strerror}; choose another with --socket"
        ) from error
