"""The messages of a service to systemd (sd_notify). Without $NOTIFY_SOCKET nothing is sent."""

import os
import socket
from contextlib import suppress


def notify(state: str) -> None:
    """Send `state` (such as "READY=1" or "STATUS=...") to $NOTIFY_SOCKET, if there is one; never raises."""
    if path := os.environ.get("NOTIFY_SOCKET"):
        with suppress(OSError):  # the supervisor is gone or busy: that must not stop the daemon
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out:
                out.connect("\0" + path[1:] if path.startswith("@") else path)
                out.send(state.encode())
