"""Start time and memory of the daemon, against those of its imports and model alone."""

import time

import numpy as np

from benchmarks.process import Program
from benchmarks.timing import Row, interleaved, ratio, resident_kib
from benchmarks.traffic import idle
from gestured.client.engine import Engine
from gestured.client.sensor import Form, Sensor
from gestured.client.subscriber import Subscriber
from gestured.core.frames import Frame
from gestured.model.opening import open_model
from gestured.model.shipped import shipped

REPEATS = 7
MORE = 200  # further sensors


def start_and_memory(model: str) -> list[Row]:
    """Rows for the seconds from exec to ready, and for resident memory once one sensor has been heard."""
    path = str(shipped().get(model, model))
    open_model(path)  # a warm-up, which brings the files into the page cache
    memory: dict[str, list[float]] = {"ours": [], "bare": []}

    def ours() -> float:
        begin = time.monotonic()
        with Engine(model, 9, 9, "--clock", "sensor") as engine:
            took = time.monotonic() - begin
            memory["ours"].append(_heard(engine, ["first"]))
        return took

    def bare() -> float:
        begin = time.monotonic()
        with Program("bare", path) as program:
            took = time.monotonic() - begin
            memory["bare"].append(resident_kib(program.process.pid))
        return took

    a, b = interleaved(ours, bare, REPEATS)
    seconds, kib = ratio(a, b), ratio(memory["ours"], memory["bare"])
    what = "numpy, onnxruntime, the model opened"
    return [
        Row("start to ready", f"{np.median(a):.2f} s", f"{np.median(b):.2f} s ({what})", str(seconds), "<= 1.5",
            seconds.median <= 1.5),
        Row("resident memory, one sensor", f"{np.median(memory['ours']) / 1024:.1f} MiB",
            f"{np.median(memory['bare']) / 1024:.1f} MiB ({what})", str(kib), "<= 1.3", kib.median <= 1.3),
    ]  # fmt: skip


def imports() -> Row:
    """A row of the MiB that each import adds, one after the other."""
    with Program("imports") as program:
        added = ", ".join(f"{name} {mib}" for name, mib in program.ready.items())
    return Row("resident memory of each import, in this order (MiB)", added, "", "", "", None)


def further_sensors(model: str) -> Row:
    """KiB for each further sensor of 9 x 9 at 15 Hz, after three seconds of frames from all of them."""
    with Engine(model, 9, 9, "--max-sensors", str(MORE + 1), "--clock", "sensor") as engine:
        first = _heard(engine, ["first"])
        all_of_them = _heard(engine, [f"more{n}" for n in range(MORE)])
    each = (all_of_them - first) / MORE
    return Row(
        "resident memory of each further sensor", f"{each:.1f} KiB", "", "", "<= 64 KiB", each <= 64
    )  # fmt: skip


def _heard(engine: Engine, names: list[str]) -> int:
    """Send three seconds of frames from each sensor; returns the daemon's resident KiB once it lists all of them."""
    epoch = time.time()
    for k in range(45):
        for n, name in enumerate(names):
            sensor = Sensor(engine.listen, Form(name))
            sensor.socket.send(sensor.form.packet(Frame(0.0, idle(n, 45)[k]), k, epoch + k / 15))
            sensor.close()
    with Subscriber(engine.socket, types=["status"]) as statuses:
        while len(next(statuses)["sensors"]) < len(names):
            pass
    return resident_kib(engine.pid)
