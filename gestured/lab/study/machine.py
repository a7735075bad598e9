"""What the study ran on."""

import os
import platform
import re
import time
from importlib.metadata import version
from pathlib import Path


def machine() -> dict[str, object]:
    """Processor, memory, versions and today's date; `minutes` is filled in at the end."""
    info = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", info.read_text()) if info.exists() else None
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "cpu": model[1] if model else platform.processor() or platform.machine(), "cores": os.cpu_count(),
        "memory_gib": round(memory / 2**30, 1), "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(), "date": time.strftime("%Y-%m-%d"), "minutes": 0.0,
        **{name: version(name) for name in ("numpy", "torch", "scikit-learn", "onnxruntime")},
    }  # fmt: skip
