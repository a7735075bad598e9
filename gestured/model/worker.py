"""The program of `process`'s child: it opens and tests a model within bounds, and answers with a line of JSON."""

import json
import resource
import signal
import sys
from typing import Any

BASE_BYTES = 192 << 20  # memory for Python, numpy, onnxruntime (some 80 MiB) and a small model
BYTES_PER_BYTE = 4  # memory for each byte of the file: as read, as parsed, and as onnxruntime's weights
START_S = 8  # the longest time until the model's bytes are here


def main() -> None:
    """Try the model on standard input, which begins with one byte: the seconds that this may take.

    Only a process of its own may call this, since the kernel kills the process when the time is over.
    """
    # The alarm's default action ends the process, whatever a thread of onnxruntime does.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    signal.alarm(START_S)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    seconds, data = sys.stdin.buffer.read(1), sys.stdin.buffer.read()
    if data:
        signal.alarm(seconds[0])
        print(json.dumps(_tried(data)), flush=True)


def _tried(data: bytes) -> dict[str, Any]:
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = BASE_BYTES + BYTES_PER_BYTE * len(data)
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    try:
        from gestured.model.model import Model

        return Model(data, "").report()
    except ValueError as error:
        return {"error": str(error)}
    except MemoryError:
        return {"error": f"needs more than {limit >> 20} MiB of memory"}
