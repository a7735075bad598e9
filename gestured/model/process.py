"""A model file that is opened in a process of its own: whatever it does there, it costs the daemon nothing.

A graph of some kilobytes can ask onnxruntime for hours, for all memory, or for what crashes it; and a run that does
not return cannot be ended from within a process. So a file that nobody has vouched for is opened, tested, and as a
candidate also run, by `worker` in a child that has bounds for memory and for time.

The protocol: the parent writes messages: 8 bytes of length, a byte of seconds that the answer may take, the content.
The first content is the model file, each other a segment (`numpy.savez`). The child answers each with one line of JSON.
It ends when its standard input does.
"""

import io
import json
import os
import signal
import subprocess
import sys
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from gestured.core.classifier import Classifier, Scores
from gestured.core.errors import ModelError
from gestured.core.frames import Segment

OPEN_S = 8  # s to start, to open a model and to test it; half a second is usual, and an operator's client waits for 20
CHILD_RUN_S = 5  # s for a segment, after which the child ends; what can be ended otherwise is ended after model.RUN_S
MAX_ANSWER = 16 << 20  # bytes of a line; a report holds some of the metadata, which are bounded
# The folders of our own interpreter, wherever we were started, and nothing from the environment or the current folder.
START = "import sys; sys.path[:] = sys.argv[1:]; from gestured.model.worker import main; main()"
ENVIRONMENT_KEPT = ("LD_LIBRARY_PATH",)  # of the environment: some systems find the C++ library by it

_turn = threading.Lock()  # one file is opened at a time: each child may take memory of the same service
_birth = threading.Lock()  # between a child's start and its place among `_children`
_children: "weakref.WeakSet[subprocess.Popen[bytes]]" = weakref.WeakSet()  # one that nobody holds ends by itself
_ending = False


class ModelProcess(Classifier):
    """A model in a process of its own. One thread at a time may ask it."""

    def __init__(self, data: bytes, name: str) -> None:
        """Opens and tests the file's bytes. ValueError says what is wrong with them."""
        self.name = name
        with _turn:
            self._child = _start()
            try:
                self.report: dict[str, Any] = self._ask(data, OPEN_S)  # `Model.report`
            except BaseException:
                self.close()
                raise
        self.gestures: tuple[str, ...] = tuple(self.report["gestures"])

    def classify(self, segment: Segment) -> Scores:
        """Scores of one segment. ModelError where the model fails; `alive` says whether it can go on."""
        content = io.BytesIO()
        np.savez(
            content, frames=segment.frames, times=segment.times, first=segment.first, last=segment.last,
            noise=segment.noise,
        )  # fmt: skip
        try:
            answer = self._ask(content.getvalue(), CHILD_RUN_S)
        except ValueError as error:
            raise ModelError(f"{self.name}: {error}") from error
        return Scores(
            np.array(answer["scores"], np.float32), answer["unknown"], self.name, threshold=answer["threshold"]
        )

    @property
    def alive(self) -> bool:
        """Whether it can be asked."""
        return self._child.poll() is None

    def kill(self) -> None:
        """End it at once; any thread may. Who waits for an answer gets an error."""
        self._child.kill()

    def close(self) -> None:
        """End it, and let go of everything; for the thread that asks it."""
        self.kill()
        self._child.wait()
        for pipe in (self._child.stdin, self._child.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    pass  # what was to be flushed has nobody to read it

    def _ask(self, content: bytes, seconds: int) -> dict[str, Any]:
        pipes = self._child
        assert pipes.stdin is not None and pipes.stdout is not None
        line = b""
        try:
            pipes.stdin.write(len(content).to_bytes(8, "big") + bytes([seconds]))
            pipes.stdin.write(content)
            pipes.stdin.flush()
            line = pipes.stdout.readline(MAX_ANSWER)
        except (OSError, ValueError):  # it has ended, or was closed
            pass
        if not line.endswith(b"\n"):
            raise ValueError(self._end(seconds))
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise ValueError(answer["error"])
        return answer

    def _end(self, seconds: int) -> str:
        """What it died of."""
        self.kill()
        status = self._child.wait()
        if status == -signal.SIGALRM:
            return f"{'did not answer' if hasattr(self, 'report') else 'could not be opened'} within {seconds} s"
        if status == -signal.SIGKILL:
            return "was ended from outside: the program ends, or the machine has no memory left"
        what = signal.Signals(-status).name if status < 0 else f"status {status}"
        return f"onnxruntime dies of it ({what})"


def try_out(data: bytes) -> dict[str, Any]:
    """`Model.report` of a file that opens and passes its self-test. ValueError says what is wrong with it."""
    tried = ModelProcess(data, "")
    tried.close()
    return tried.report


def end_all() -> None:
    """End all children, and let no more begin: the program ends. A signal's handler may ask for it."""
    global _ending
    with _birth:
        _ending = True
        for child in tuple(_children):
            child.kill()


def _start() -> "subprocess.Popen[bytes]":
    """A child. It is born in a thread of its own, so that a handler that interrupts this one can wait for the birth."""
    if _ending:  # no thread can be started then
        raise ValueError("was not opened: the program ends")
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(_bear).result()


def _bear() -> "subprocess.Popen[bytes]":
    root = Path(__file__).resolve().parents[2]
    folders = [str(root), *(folder for folder in sys.path if os.path.isabs(folder))]
    with _birth:
        try:
            child = subprocess.Popen(
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
        _children.add(child)
        if _ending:
            child.kill()
        return child
