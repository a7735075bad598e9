"""What the study ran on."""

import os
import platform
import time
from pathlib import Path

import numpy
import onnxruntime
import sklearn
import torch


def machine() -> dict[str, object]:
    """Processor, memory, versions and today's date; `minutes` is filled in at the end."""
    return {
        "cpu": _cpu(), "cores": os.cpu_count(), "memory_gib": round(_memory() / 2**30, 1),
        "python": platform.python_version(), "system": f"{platform.system()} {platform.release()}",
        "numpy": numpy.__version__, "torch": torch.__version__, "sklearn": sklearn.__version__,
        "onnxruntime": onnxruntime.__version__, "date": time.strftime("%Y-%m-%d"), "minutes": 0.0,
    }  # fmt: skip


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _memory() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
