"""Someone at a terminal of 80 x 24 in front of one of our programs."""

import os
import pty
import select
import subprocess
import sys
import termios
import time

PATIENCE_S = 60.0


class Terminal:
    """A program at a terminal, `python -m` with these words."""

    def __init__(self, *words: object, **environment: str) -> None:
        self._ours, self._theirs = pty.openpty()
        self._before = termios.tcgetattr(self._theirs)
        self.said, self._read = "", 0
        usual = {"PYTHONUNBUFFERED": "1", "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", *map(str, words)],
            stdin=self._theirs, stdout=self._theirs, stderr=self._theirs, env=os.environ | usual | environment,
        )  # fmt: skip

    def sees(self, *texts: str) -> str:
        """Wait until one of the texts is shown after what was seen before; gives it."""
        end = time.monotonic() + PATIENCE_S
        while True:
            found = {self.said.find(text, self._read): text for text in texts}
            found.pop(-1, None)
            if found:
                first = min(found)
                self._read = first + len(found[first])
                return found[first]
            assert time.monotonic() < end, f"{texts} not in: {self.said[self._read :]}"
            if select.select([self._ours], [], [], 1.0)[0]:
                self.said += os.read(self._ours, 65536).decode(errors="replace")

    def types(self, text: str) -> None:
        """Press keys."""
        os.write(self._ours, text.encode())

    def ends(self) -> int:
        """The exit status; the terminal must be as it was."""
        status = self.process.wait(PATIENCE_S)
        assert termios.tcgetattr(self._theirs) == self._before
        return status

    def close(self) -> None:
        """End it, however far it is."""
        self.process.kill()
        self.process.wait()
        for descriptor in (self._ours, self._theirs):
            os.close(descriptor)
