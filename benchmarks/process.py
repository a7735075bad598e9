"""Other programs to measure against, each a process of its own."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent


class Program:
    """A running program of `programs/`, which is ready once its first line, JSON, is printed. A context manager."""

    def __init__(self, name: str, *arguments: str) -> None:
        command = [sys.executable, "-m", f"benchmarks.programs.{name}", *arguments]
        self.process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE)
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"{name}.py did not start (exit status {self.process.wait()})")
        self.ready: dict[str, Any] = json.loads(line)

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


def free_socket() -> str:
    """A path for a Unix socket in a folder of its own."""
    return str(Path(tempfile.mkdtemp(prefix="gestured-bench-")) / "events.sock")
