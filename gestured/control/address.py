"""Where the daemon is: the rule for its socket."""

import os
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
