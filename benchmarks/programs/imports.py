"""What each of the daemon's packages adds to resident memory when it is imported in this order."""

import importlib
import json
import os

os.environ["ORT_DISABLE_TELEMETRY"] = "1"
PACKAGES = ("numpy", "onnxruntime", "asyncio", "uvloop", "pydantic", "structlog", "gestured.daemon.settings")


def resident_mib() -> float:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


found = {"python": round(resident_mib(), 1)}
for name in (*PACKAGES, "gestured.daemon.service"):
    before = resident_mib()
    importlib.import_module(name)
    found[name] = round(resident_mib() - before, 1)
print(json.dumps(found), flush=True)
