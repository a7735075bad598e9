"""What systemd passes to the daemon: sockets, and how often it wants to hear from it.

Does nothing where nobody asked.
"""

import os
import socket

FIRST_FD = 3  # sd_listen_fds(3)


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
