"""Read by the interpreter at its start (PYTHONPATH).

A wall clock that the file named by $HOSTILE_CLOCK shifts; a look-up of the host `hangs` that makes the file named by
$HOSTILE_NAMES, and never ends.
"""

import os
import socket
import time
from pathlib import Path

if path := os.environ.get("HOSTILE_CLOCK"):
    real, real_ns = time.time, time.time_ns
    time.time = lambda: real() + float(Path(path).read_text() or 0)
    time.time_ns = lambda: real_ns() + round(1e9 * float(Path(path).read_text() or 0))

if asked := os.environ.get("HOSTILE_NAMES"):
    look_up = socket.getaddrinfo

    def getaddrinfo(host, *arguments, **options):
        if host == "hangs":
            Path(asked).touch()
            time.sleep(1e6)
        return look_up(host, *arguments, **options)

    socket.getaddrinfo = getaddrinfo
