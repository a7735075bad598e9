"""Read by the interpreter at its start (PYTHONPATH): a wall clock that the file named by $HOSTILE_CLOCK shifts."""

import os
import time
from pathlib import Path

if path := os.environ.get("HOSTILE_CLOCK"):
    real = time.time
    time.time = lambda: real() + float(Path(path).read_text() or 0)
