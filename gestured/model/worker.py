"""The child of `process`: opens a model and runs it, within bounds, and answers in lines of JSON."""

import io
import json
import resource
import signal
import sys
from typing import Any

BASE_BYTES = 192 << 20  # memory for Python, numpy, onnxruntime (some 80 MiB) and a small model
BYTES_PER_BYTE = 4  # memory for each byte of the file: as read, as parsed, and its weights as onnxruntime has them
START_S = 8  # seconds that starting may take, until the model's bytes are here
REQUEST_HEADER_BYTES = 9  # a length, and the seconds that the answer may take


def main() -> None:
    """Serve standard input until it ends. Whoever calls this is a program of its own, and may be killed."""
    # The kernel ends us, whatever a thread of onnxruntime does: the alarm's own action is death.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    signal.alarm(START_S)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    data = _message()
    if data is None:
        return
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = BASE_BYTES + BYTES_PER_BYTE * len(data)
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    try:
        from gestured.model.model import Model

        model = Model(data, "")
    except ValueError as error:
        return _answer({"error": str(error)})
    except MemoryError:
        return _answer({"error": f"needs more than {limit >> 20} MiB of memory"})
    del data
    _answer(model.report())
    while (content := _message()) is not None:
        _answer(_scores(model, content))


def _scores(model: Any, content: bytes) -> dict[str, Any]:
    import numpy as np

    from gestured.core.errors import ModelError
    from gestured.core.frames import Segment

    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as held:
            numbers = int(held["first"]), int(held["last"]), float(held["noise"])
            scores = model.classify(Segment(held["frames"], held["times"], *numbers))
    except ModelError as error:
        return {"error": str(error).removeprefix(": ")}
    except MemoryError:
        return {"error": "needs too much memory"}
    return {"scores": scores.values.tolist(), "unknown": scores.unknown, "threshold": scores.threshold}


def _message() -> bytes | None:
    header = sys.stdin.buffer.read(REQUEST_HEADER_BYTES)
    if len(header) < REQUEST_HEADER_BYTES:
        return None
    signal.alarm(header[8])
    size = int.from_bytes(header[:8], "big")
    content = sys.stdin.buffer.read(size)
    return content if len(content) == size else None


def _answer(what: dict[str, Any]) -> None:
    signal.alarm(0)
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()
