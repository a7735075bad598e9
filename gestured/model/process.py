"""The trial of a model file that does not ship, in a process of its own, where whatever it does can do no harm.

A graph of some kilobytes can make onnxruntime run for hours, take all memory, or crash; and a run that does not return
cannot be ended from within a process. So `worker` opens and tests the file, in a child with bounds for memory and for
time.

The child reads its standard input to the end: one byte, which is the seconds that it may take, then the file. It
answers with one line of JSON.
"""

import json
import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import Any

OPEN_S = 8  # the longest time to open a model and to test it; half a second is usual, and a client waits for 20
MAX_ANSWER = 16 << 20  # the most bytes of an answer; a report holds some of the metadata, which are bounded
# The child imports from our own interpreter's folders, and nothing from the environment or the current folder.
START = "import sys; sys.path[:] = sys.argv[1:]; from gestured.model.worker import main; main()"
ENVIRONMENT_KEPT = ("LD_LIBRARY_PATH",)  # of the environment: some systems find the C++ library by it

_turn = threading.Lock()  # one file is tried at a time, since each child takes memory of the same service
_child: "Popen[bytes] | None" = None  # the child that was started last
_ending = False


def try_out(data: bytes) -> dict[str, Any]:
    """`Model.report` of a file that opens and passes its self-test. Raises ValueError, which says what is wrong."""
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
    """End the child and let no other work from now on, since the program ends. A signal handler may call this.

    A child that is being started meanwhile finds the end of its input, and ends by itself.
    """
    global _ending
    _ending = True
    if _child is not None:
        _child.kill()


def _end_of(child: "Popen[bytes]") -> str:
    """The reason why a child has ended without an answer."""
    child.kill()
    status = child.wait()
    if status == -signal.SIGALRM:
        return f"could not be opened within {OPEN_S} s"
    if status == -signal.SIGKILL:
        return "was ended from outside: the program ends, or the machine has no memory left"
    what = signal.Signals(-status).name if status < 0 else f"status {status}"
    return f"onnxruntime dies of it ({what})"


def _started() -> "Popen[bytes]":
    if getattr(sys, "frozen", False) or not sys.executable:  # what PyInstaller has frozen would start itself, endlessly
        said = "this program is frozen or embedded, and has no Python for that"
        raise ValueError(f"no process can be started to try it: {said}")
    root = Path(__file__).resolve().parents[2]
    folders = [str(root), *(folder for folder in sys.path if os.path.isabs(folder))]
    command = [sys.executable, "-I", "-S", "-c", START, *folders]
    kept = {name: os.environ[name] for name in ENVIRONMENT_KEPT if name in os.environ}
    env = kept | {"ORT_DISABLE_TELEMETRY": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:  # with a session of its own, since Ctrl-C is for this process alone
        return Popen(command, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, cwd="/", env=env, start_new_session=True)
    except OSError as error:
        raise ValueError(f"no process could be started to try it: {error.strerror or error}") from error
