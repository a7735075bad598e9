"""A bound on memory for what opens any bytes as a model in this process, as `model.worker` has one in its own."""

import re
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MORE_BYTES = 256 << 20


@contextmanager
def little_memory() -> Iterator[None]:
    """Inside, the process may take `MORE_BYTES` more than it has."""
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    (used,) = re.findall(r"VmData:\s+(\d+) kB", Path("/proc/self/status").read_text())
    resource.setrlimit(resource.RLIMIT_DATA, (int(used) * 1024 + MORE_BYTES, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
