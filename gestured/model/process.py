"""A model file that nobody has vouched for is tried in a process of its own: whatever it does there costs us nothing.

A graph of some kilobytes can ask onnxruntime for hours, for all memory, or for what crashes it; and a run that does
not return cannot be ended from within a process. So the file is opened and tested by `worker`, in a child that has
bounds for memory and for time.

The child reads its standard input to the end: one byte, which is the seconds that it may take, then the file. It
answers with one line of JSON.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

OPEN_S = 8  # s to start, to open a model and to test it; half a second is usual, and an operator's client waits for 20
MAX_ANSWER = 16 << 20  # bytes of a line; a report holds some of the metadata, which are bounded
# The folders of our own interpreter, wherever we were started, and nothing from the environment or the current folder.
START = "import sys; sys.path[:] = sys.argv[1:]; from gestured.model.worker import main; main()"
ENVIRONMENT_KEPT = ("LD_LIBRARY_PATH",)  # of the environment: some systems find the C++ library by it

_turn = threading.Lock()  # one file is opened at a time: each child may take memory of the same service
_child: "subprocess.Popen[bytes] | None" = None  # the one that was started last
_ending = False


def try_out(data: bytes) -> dict[str, Any]:
    """`Model.report` of a file that opens and passes its self-test. ValueError says what is wrong with it."""
    global _child
    with _turn, _started() as child:  # leaving this block waits for the child's end
        _child = child
        assert child.stdin is not None and child.stdout is not None
        try:
            if _ending:
                raise ValueError("was not opened: the program ends")
            with suppress(OSError):  # the child has ended already
                child.stdin.write(bytes([OPEN_S]))
                child.stdin.write(data)
            with suppress(OSError):
                child.stdin.close()
            line = child.stdout.readline(MAX_ANSWER)
            if not line.endswith(b"\n"):
                raise ValueError(_end_of(child))
        finally:
            child.kill()
    answer: dict[str, Any] = json.loads(line)
    if "error" in answer:
        raise ValueError(answer["error"])
    return answer


def end_all() -> None:
    """End the child, and let none do any work from now on: the program ends. A signal's handler may ask for it.

    A child that is being started meanwhile finds the end of its input, and ends by itself.
    """
    global _ending
    _ending = True
    if _child is not None:
        _child.kill()


def _end_of(child: "subprocess.Popen[bytes]") -> str:
    """Why a child has ended without an answer."""
    child.kill()
    status = child.wait()
    if status == -signal.SIGALRM:
        return f"could not be opened within {OPEN_S} s"
    if status == -signal.SIGKILL:
        return "was ended from outside: the program ends, or the machine has no memory left"
    what = signal.Signals(-status).name if status < 0 else f"status {status}"
    return f"onnxruntime dies of it ({what})"


def _started() -> "subprocess.Popen[bytes]":
    """A child that waits for its input."""
    root = Path(__file__).resolve().parents[2]
    folders = [str(root), *(folder for folder in sys.path if os.path.isabs(folder))]
    try:
        return subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", START, *folders],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env={name: os.environ[name] for name in ENVIRONMENT_KEPT if name in os.environ}
            | {"ORT_DISABLE_TELEMETRY": "1", "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,  # Ctrl-C is for us
        )
    except OSError as error:
        raise ValueError(f"no process could be started to try it: {error.strerror or error}") from error
