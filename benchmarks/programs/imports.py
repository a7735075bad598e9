"""What each of the daemon's packages adds to resident memory when it is imported in this order.

uvloop and pydantic load half of themselves only for the first loop and the first model: these are steps of their own.
"""

import json
import os
from importlib import import_module

os.environ["ORT_DISABLE_TELEMETRY"] = "1"
import_module("gestured.daemon")  # its settings for numpy and pydantic apply here too


def loop() -> object:
    import uvloop

    return uvloop.new_event_loop()


def model() -> object:
    from pydantic import BaseModel

    return type("Model", (BaseModel,), {"__annotations__": {"value": int}})


STEPS = ("numpy", "onnxruntime", "asyncio", "uvloop", loop, "pydantic", model, "structlog")
OURS = ("gestured.daemon.settings", "gestured.daemon.cli", "gestured.daemon.start")


def resident_mib() -> float:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


found = {"python": round(resident_mib(), 1)}
kept = []
for step in (*STEPS, *OURS):
    before = resident_mib()
    kept.append(import_module(step) if isinstance(step, str) else step())
    name = step if isinstance(step, str) else f"a {step.__name__} of it"
    found[name] = round(resident_mib() - before, 1)
print(json.dumps(found), flush=True)
