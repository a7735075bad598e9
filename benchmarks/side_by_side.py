"""gestured beside an ordinary script: CPU time of a frame, and memory, at 15 Hz with cold caches."""

import socket

from benchmarks.latency import play
from benchmarks.process import Program, free_socket
from benchmarks.timing import Row, cpu_s_of, ratio, resident_kib
from benchmarks.traffic import touched
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.core.frames import Frame

ROUNDS = 3


def ordinary(model: str) -> list[Row]:
    """CPU for a frame, and resident memory, of the daemon and of programs/ordinary.py."""
    form = Form("bench", plain=True)
    stream = [form.packet(Frame(0.0, f), 0, 0.0) for f in touched(30, 15.0).frames]
    path = free_socket()
    ours: list[float] = []
    theirs: list[float] = []
    with Engine(model, 9, 9) as engine, Program("ordinary", path) as script, socket.socket(socket.AF_UNIX) as client:
        client.connect(path)
        for _ in range(ROUNDS):
            for pid, port, found in (
                (engine.pid, engine.listen[1], ours), (script.process.pid, script.ready["port"], theirs)
            ):  # fmt: skip
                start = cpu_s_of(pid)
                play(port, stream)
                found.append(1e6 * (cpu_s_of(pid) - start) / len(stream))
        kib = resident_kib(engine.pid), resident_kib(script.process.pid)
    cpu = ratio(ours, theirs)
    return [
        Row("CPU for one frame at 15 Hz, all its gestures included", f"{sorted(ours)[1]:.0f} us",
            f"{sorted(theirs)[1]:.0f} us (ordinary script)", str(cpu), "", None),
        Row("resident memory", f"{kib[0] / 1024:.0f} MiB", f"{kib[1] / 1024:.0f} MiB (ordinary script)",
            f"{kib[0] / kib[1]:.3g}", "", None),
    ]  # fmt: skip
