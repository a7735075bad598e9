"""An engine: a real daemon as a child process, with free ports, and a socket in a temporary folder."""

import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired
from typing import Any

import gestured
from gestured.core.address import Address
from gestured.core.errors import GesturedError

STOP_S = 5.0  # s that the daemon may take to end
# A program that is killed cannot end its children, so Linux is told to end them: PR_SET_PDEATHSIG, SIGTERM.
DIE = "import ctypes; ctypes.CDLL(None).prctl(1, 15); " if sys.platform == "linux" else ""


def child_of_ours(module: str) -> list[str]:
    """The beginning of a command that runs a module of gestured in a child process, which ends when we do."""
    root = Path(gestured.__file__).parent.parent
    safe = [] if root.samefile(".") else ["-P"]  # a folder named gestured in the current one is not the package
    run = f"{DIE}import runpy; runpy.run_module('{module}', run_name='__main__', alter_sys=True)"
    return [sys.executable, *safe, "-c", run]


class Engine:
    """`gestured` as a child process; a context manager. Raises GesturedError if it does not start."""

    def __init__(self, model: str, rows: int, columns: int, *more: str) -> None:
        """Start the daemon with a grid of rows x columns; `more` are further flags of its command line."""
        try:
            self._folder = tempfile.TemporaryDirectory(prefix="gestured-demo-")
            self._process = self._start(Path(self._folder.name), model, f"{rows}x{columns}", more)
        except OSError as error:
            raise GesturedError(f"the daemon did not start: {error.strerror}") from error
        try:
            self.ready = self._wait()
        except BaseException:
            self.close()
            raise

    def _start(self, folder: Path, model: str, grid: str, more: Sequence[str]) -> "Popen[bytes]":
        command = [*child_of_ours("gestured.daemon"), "--model", model, "--listen", "127.0.0.1:0"]
        command += ["--socket", str(folder / "events.sock"), "--grid", grid]
        command += ["--own-gestures", str(folder / "own-gestures.json"), *more]  # the user's would change answers
        environment = {name: value for name, value in os.environ.items() if not name.startswith("GESTURED_")}
        self._log = folder / "log"
        with self._log.open("wb") as log:
            # A session of its own: Ctrl-C is for us, and we end it in our own time.
            return Popen(command, stdin=DEVNULL, stdout=PIPE, stderr=log, env=environment, start_new_session=True)

    def _wait(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            status = self._process.wait(STOP_S)
            said = self._log.read_text("utf-8", "replace").strip().splitlines()
            reason = said[-1] if said else "it said nothing"
            raise GesturedError(f"the daemon did not start (exit status {status}): {reason}")
        ready: dict[str, Any] = json.loads(line)
        return ready

    @property
    def listen(self) -> Address:
        """The UDP address at which the daemon takes frames."""
        return Address.parse(self.ready["listen"])

    @property
    def socket(self) -> Path:
        """The daemon's event socket."""
        return Path(self.ready["socket"])

    @property
    def pid(self) -> int:
        """The process number of the daemon."""
        return self._process.pid

    def close(self) -> None:
        """End the daemon as an operator would; a second call does nothing."""
        self._process.terminate()
        try:
            self._process.wait(STOP_S)
        except TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout:
            self._process.stdout.close()
        self._folder.cleanup()

    def __enter__(self) -> "Engine":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
