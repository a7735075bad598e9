"""All sockets of one daemon: those that systemd passed, known by their names, and those that the daemon binds."""

import os
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from gestured.client.address import control_beside, default_socket
from gestured.daemon import sockets
from gestured.daemon.log import log
from gestured.daemon.settings import Settings
from gestured.daemon.sockets import AddressError, Listener, UnixListener

FIRST_FD = 3  # sd_listen_fds(3)
INTERNET = (socket.AF_INET, socket.AF_INET6)
# FileDescriptorName= -> families and type of such a socket, and the line of a systemd unit that makes it
SOCKET_NAMES = {
    "osc": (INTERNET, socket.SOCK_DGRAM, "ListenDatagram=HOST:PORT"),
    "events": ((socket.AF_UNIX,), socket.SOCK_STREAM, "ListenStream=/PATH"),
    "control": ((socket.AF_UNIX,), socket.SOCK_STREAM, "ListenStream=/PATH"),
    "gates": ((socket.AF_UNIX,), socket.SOCK_STREAM, "ListenStream=/PATH"),
    "metrics": (INTERNET, socket.SOCK_STREAM, "ListenStream=HOST:PORT"),
}


@dataclass(slots=True)
class Bound:
    """All sockets of a daemon, open until `close`."""

    udp: socket.socket
    since: float  # s, monotonic: packets that waited in a socket from systemd count as arrived at this time
    events: Listener
    control: Listener
    gates: Listener | None
    http: socket.socket | None
    close: Callable[[], None]  # closes all sockets, and removes the paths that we made for them

    def addresses(self) -> dict[str, str | None]:
        """The daemon's addresses by setting; their paths are valid in any folder."""
        return {
            "listen": sockets.name_of(self.udp),
            "socket": _from_anywhere(self.events.path),
            "control": _from_anywhere(self.control.path),
            "gates": _from_anywhere(self.gates.path) if self.gates else None,
            "metrics": sockets.name_of(self.http) if self.http else None,
        }


def _from_anywhere(path: Path) -> str:
    """A path that is valid in any folder. A relative one is resolved: with its ".." it might exceed 107 bytes."""
    return str(path if path.is_absolute() else path.parent.resolve() / path.name)


def bind_all(settings: Settings) -> Bound:
    """Take the sockets that systemd passed and bind the others, all or none. Raises AddressError or SettingsError."""
    given = _passed()
    with ExitStack() as opened:
        for sock in given.values():
            opened.callback(sock.close)
        if (udp := given.get("osc")) is None:
            udp = sockets.bind_udp(settings.listen)
            opened.callback(udp.close)
        else:
            sockets.stamp_arrivals(udp)
        since = time.monotonic()
        if (http := given.get("metrics")) is None and settings.metrics is not None:
            http = sockets.bind_tcp(settings.metrics)
            opened.callback(http.close)
        path = settings.socket
        if path is None and "events" not in given:
            path = default_socket(os.environ)
            sockets.make_default_directory(path.parent)
        events = _listener(given, "events", path, opened, key="socket")
        path = path or events.path
        beside = settings.control or control_beside(path)
        for name, one, others in (("control", beside, (path,)), ("gates", settings.gates, (path, beside))):
            if one in others and name not in given:
                raise AddressError(f"{name}: {one} is another socket of this daemon, choose another path with --{name}")
        control = _listener(given, "control", beside, opened)
        asked = "gates" in given or settings.gates is not None
        gates = _listener(given, "gates", settings.gates, opened) if asked else None
        close = opened.pop_all().close
    for name, sock in given.items():
        address, key = sockets.name_of(sock), {"osc": "listen", "events": "socket"}.get(name, name)
        log.info("socket from systemd", name=name, address=address)
        if key in settings.model_fields_set and (value := str(getattr(settings, key))) != address:
            log.warning("not used, since systemd opened the socket", key=key, value=value, address=address)
    return Bound(udp, since, events, control, gates, http, close)


def _listener(
    given: Mapping[str, socket.socket], name: str, path: Path | None, opened: ExitStack, *, key: str = ""
) -> Listener:
    """The socket that systemd passed as `name`, else a new one at `path`; `key` is the setting that an error names."""
    if name in given:
        return Listener(given[name])
    assert path is not None
    made = UnixListener(path, key or name)
    opened.callback(made.close)
    return made


def _passed() -> dict[str, socket.socket]:
    """The sockets that systemd holds for us, by their FileDescriptorName=. Raises AddressError for one of no use.

    It can be called once: it removes systemd's variables, so that no child process takes the sockets for its own.
    """
    mine = os.environ.pop("LISTEN_PID", "") == str(os.getpid())
    count, names = os.environ.pop("LISTEN_FDS", ""), os.environ.pop("LISTEN_FDNAMES", "").split(":")
    if not mine or not count.isdigit():
        return {}
    found: dict[str, socket.socket] = {}
    for n, name in zip(range(int(count)), names + [""] * int(count), strict=False):
        try:
            os.set_inheritable(FIRST_FD + n, False)
            sock = socket.socket(fileno=FIRST_FD + n)
        except OSError as error:
            raise AddressError(f"systemd passed {name!r}, which is no socket: {error.strerror}") from error
        if name not in SOCKET_NAMES:
            raise AddressError(
                f"systemd passed a socket named {name!r}, expected FileDescriptorName= one of {', '.join(SOCKET_NAMES)}"
            )
        families, kind, words = SOCKET_NAMES[name]
        if sock.family not in families or sock.type != kind or name in found:
            raise AddressError(
                f"systemd's socket {name!r}: expected one, of {words}, found {sock.family.name} {sock.type.name}"
            )
        if kind == socket.SOCK_STREAM and not sock.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
            raise AddressError(f"systemd's socket {name!r}: expected it listening (Accept=no), found a connection")
        sock.setblocking(False)
        found[name] = sock
    return found
