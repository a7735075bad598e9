"""Where the daemon is: the rule for its socket, and HOST:PORT."""

import argparse
import os
import re
from collections.abc import Mapping
from pathlib import Path


def default_socket(environ: Mapping[str, str]) -> Path:
    """Where a daemon with the same environment keeps its event socket."""
    if path := environ.get("GESTURED_SOCKET"):
        return Path(path)
    if directory := environ.get("RUNTIME_DIRECTORY"):
        return Path(directory.split(":")[0]) / "events.sock"
    if directory := environ.get("XDG_RUNTIME_DIR"):
        return Path(directory) / "gestured" / "events.sock"
    return Path(f"/tmp/gestured-{os.getuid()}/events.sock")


def host_port(text: str) -> tuple[str, int]:
    """HOST:PORT or [HOST]:PORT as (host, port); for argparse."""
    match = re.fullmatch(r"(?:\[([^\[\]\s]+)\]|([^\[\]:/\s]+)):(\d{1,5})", text)
    if match is None or not 0 < int(match[3]) < 65536:
        raise argparse.ArgumentTypeError(f"{text!r}: expected HOST:PORT, such as 127.0.0.1:9000")
    return match[1] or match[2], int(match[3])
