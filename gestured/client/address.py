"""The addresses of a daemon: where its Unix sockets are if no setting names them, and why one cannot be bound."""

import errno
import os
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gestured.core.address import Address
from gestured.core.errors import SettingsError

SYSTEM = Path("/run/gestured/events.sock")  # of the installed service, and of root
SOCKET_PATH_BYTES = 107  # sun_path on Linux, without its final NUL
SOCKET_PATH = f"the path of a Unix socket, at most {SOCKET_PATH_BYTES} bytes long"
UNIX_SOCKETS = Path("/proc/net/unix")
NUMERIC = socket.NI_NUMERICHOST | socket.NI_NUMERICSERV  # for getnameinfo: a link-local host comes with its interface
LISTENS = "00010000"  # the flags of a listening socket in UNIX_SOCKETS


def named(text: str) -> Address:
    """HOST:PORT, of a host that can be looked up. ValueError, which says what was expected, for anything else.

    A name that cannot be encoded for a look-up, such as `a..b`, would raise UnicodeError only when it is used.
    """
    address = Address.parse(text)
    try:
        if b"\0" not in address.host.encode("idna"):
            return address
    except UnicodeError:
        pass
    raise ValueError("HOST:PORT with a host's name, each part of which has 1 to 63 characters, or its address")


def default_socket(environ: Mapping[str, str]) -> Path:
    """The event socket of a daemon without that setting: in the folder of systemd, of the session, or of root.

    Raises SettingsError if there is no such folder.
    """
    if directory := environ.get("RUNTIME_DIRECTORY"):
        return Path(directory.split(":")[0]) / "events.sock"
    if directory := environ.get("XDG_RUNTIME_DIR"):
        return Path(directory) / "gestured" / "events.sock"
    if os.geteuid() == 0:
        return SYSTEM
    raise SettingsError(
        "socket: there is no default here, since neither RUNTIME_DIRECTORY nor XDG_RUNTIME_DIR is set; "
        "name a path with --socket, or in GESTURED_SOCKET for the daemon and its clients alike"
    )


def control_beside(socket: Path) -> Path:
    """The control socket of a daemon without that setting: beside its event socket."""
    return socket.with_suffix(".ctl")


def find_socket(environ: Mapping[str, str]) -> Path:
    """The event socket of a client that names none. Raises SettingsError if there is none.

    It is the first of these: the socket that the daemon's variable or configuration names; that of a daemon in the
    session; that of the installed service; the one that a daemon would make. `client.peer` checks who serves it.
    """
    if path := setting(environ, "socket"):
        if not Path(path).name:  # a control socket beside it needs a name
            raise SettingsError(f"GESTURED_SOCKET: expected {SOCKET_PATH}, found {path!r}")
        return Path(path)
    # Unlike Path.exists, os.path.exists raises no error if we may not look.
    installed = SYSTEM.parent.is_dir() and not environ.get("RUNTIME_DIRECTORY")
    if installed and not (environ.get("XDG_RUNTIME_DIR") and os.path.exists(default_socket(environ))):
        return SYSTEM
    return default_socket(environ)


def find_control(environ: Mapping[str, str]) -> Path:
    """The control socket of a client that names none, by the rules of `find_socket`."""
    if path := setting(environ, "control"):
        return Path(path)
    return control_beside(find_socket(environ))


def running() -> list[Path]:
    """The control sockets of all daemons of this machine, by the kernel's table of Unix sockets."""
    try:
        rows = [row.split(maxsplit=7) for row in UNIX_SOCKETS.read_text("utf-8", "replace").splitlines()]
    except OSError:
        return []
    listening = {Path(row[7]) for row in rows if len(row) == 8 and row[3] == LISTENS}
    return sorted(path for path in listening if path.suffix == ".ctl" and path.with_suffix(".sock") in listening)


def look_up(address: tuple[str, int], kind: int) -> tuple[int, Any]:
    """(family, socket address) of a host and port; blocks while a name is looked up. Raises OSError.

    A name that is this machine by both families, as `localhost` may be, is 127.0.0.1, where most programs listen.
    """
    found = socket.getaddrinfo(*address, type=kind)
    family, _, _, _, where = next((one for one in found if one[4][0] == "127.0.0.1"), found[0])
    return family, where


def bind_failure(error: OSError, address: Address, kind: int) -> str:
    """Why an address of this kind of socket cannot be bound; if it is taken, also the command that shows by whom."""
    reason = error.strerror or str(error)
    flags = "-ulpn" if kind == socket.SOCK_DGRAM else "-tlpn"
    taken = error.errno == errno.EADDRINUSE
    return f"{reason}: sudo ss {flags} 'sport = :{address.port}' shows by whom" if taken else reason


def setting(environ: Mapping[str, str], key: str) -> str | None:
    """A setting of the daemon, from its variable or from the file of GESTURED_CONFIG; None if neither has it."""
    if value := environ.get(f"GESTURED_{key.upper()}"):
        return value
    if not (path := environ.get("GESTURED_CONFIG")):
        return None
    import tomllib  # this import takes longer than all others here

    try:
        with open(path, "rb") as file:
            value = tomllib.loads(file.read().decode("utf-8-sig")).get(key)
    except (OSError, ValueError):  # the daemon itself reports what is wrong with the file
        return None
    return value if isinstance(value, str) else None
