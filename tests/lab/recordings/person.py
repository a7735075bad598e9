"""Someone at a terminal in front of `gestured-lab collect`."""

import os
import pty
import select
import subprocess
import sys
import termios
import time

PATIENCE_S = 60.0
KEYS = "r repeat  d discard"
GOOD = "Enter keep  " + KEYS


class Person:
    """Someone at a terminal in front of `gestured-lab collect` with these arguments."""

    def __init__(self, *arguments: str) -> None:
        self.master, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        self.seen, self.read = "", 0
        command = [sys.executable, "-m", "gestured.lab.cli", "collect", *arguments]
        self.process = subprocess.Popen(
            command,
            stdin=self.terminal,
            stdout=self.terminal,
            stderr=self.terminal,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )

    def sees(self, *texts: str) -> str:
        """Wait until one of the texts is shown; gives it."""
        end = time.monotonic() + PATIENCE_S
        while True:
            found = {self.seen.find(text, self.read): text for text in texts}
            found.pop(-1, None)
            if found:
                first = min(found)
                self.read = first + len(found[first])
                return found[first]
            assert time.monotonic() < end, f"{texts} not in: {self.seen[self.read :]}"
            if select.select([self.master], [], [], 1.0)[0]:
                self.seen += os.read(self.master, 65536).decode()

    def types(self, text: str) -> None:
        os.write(self.master, text.encode())

    def keeps_one(self) -> None:
        """Repeats until a take is good, as a person does."""
        while self.sees(GOOD, "  " + KEYS) != GOOD:
            self.types("r")
        self.types("\n")
        self.sees("kept, ")

    def ends(self) -> int:
        """The exit status; the terminal must be as it was."""
        status = self.process.wait(PATIENCE_S)
        assert termios.tcgetattr(self.terminal) == self.before
        return status

    def leave(self) -> None:
        self.process.kill()
        self.process.wait()
        for fd in (self.master, self.terminal):
            os.close(fd)
