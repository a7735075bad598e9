"""systemd's two conversations: what it passes to us (sockets), and what we tell it (sd_notify).

Does nothing where nobody asked.
"""

import os
import socket

FIRST_FD = 3  # sd_listen_fds(3)


def notify(state: str) -> None:
    """Send `state` (such as "READY=1" or "STATUS=...") to $NOTIFY_SOCKET, if there is one; never raises."""
    if path := os.environ.get("NOTIFY_SOCKET"):
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out:
                out.connect("\0" + path[1:] if path.startswith("@") else path)
                out.send(state.encode())
        except OSError:
            pass  # the supervisor is gone or busy: that must not stop the daemon


def watchdog_period() -> float | None:
    """Seconds between two WATCHDOG=1, a third of what systemd allows; None where it does not watch."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    if not microseconds.isdigit() or os.environ.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    return int(microseconds) / 3e6


def passed_sockets() -> list[tuple[str, socket.socket]]:
    """(name, socket) of each socket that systemd holds for us; names as FileDescriptorName= gives them.

    Once: the variables are removed, so that no child takes them for its own.
    """
    mine = os.environ.pop("LISTEN_PID", "") == str(os.getpid())
    count, names = os.environ.pop("LISTEN_FDS", ""), os.environ.pop("LISTEN_FDNAMES", "").split(":")
    if not mine or not count.isdigit():
        return []
    fds = range(FIRST_FD, FIRST_FD + int(count))
    for fd in fds:
        os.set_inheritable(fd, False)
    return [(name, socket.socket(fileno=fd)) for fd, name in zip(fds, names + [""] * int(count), strict=False)]
