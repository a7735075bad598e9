"""What a few sensors cost on a small machine: processor time, and how often the daemon is woken."""

import dataclasses
import socket
import time
from pathlib import Path

from benchmarks.timing import Row, cpu_s_of
from benchmarks.traffic import idle
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.core.frames import Frame
from gestured.simulator import Participant, SimulatedSensor, generator, session

SECONDS = 10.0
SETTLE_S = 3.0  # before the measurement, in which the sensors are learned


def small(model: str) -> list[Row]:
    """A row for each number of sensors and rate: idle, and with a person at each of them."""
    return [_row(model, sensors, rate_hz) for sensors in (1, 4, 16) for rate_hz in (15.0, 100.0)]


def _row(model: str, sensors: int, rate_hz: float) -> Row:
    idle_ms, idle_woken = _cost(model, sensors, rate_hz, pressed=False)
    ms, woken = _cost(model, sensors, rate_hz, pressed=True)
    return Row(
        f"{sensors} sensor{'s' * (sensors > 1)} at {rate_hz:g} Hz: processor time and wakeups a second",
        f"touched: {ms:.1f} ms, {woken:.0f}", f"idle: {idle_ms:.1f} ms, {idle_woken:.0f}", "", "", None,
    )  # fmt: skip


def _cost(model: str, sensors: int, rate_hz: float, *, pressed: bool) -> tuple[float, float]:
    """(ms of processor time, voluntary context switches) a second of a daemon with so many `sensors`."""
    count = round((SETTLE_S + SECONDS) * rate_hz)
    nominal = dataclasses.replace(SimulatedSensor.nominal(day=950), rate_hz=rate_hz)
    frames = [
        session(Participant(950 + n), nominal, generator(952, n), count / rate_hz, 0.2).frames
        if pressed
        else idle(n, count)
        for n in range(sensors)
    ]
    forms = [Form(f"s{n}", plain=True) for n in range(sensors)]
    with Engine(model, 9, 9) as engine, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", engine.listen[1]))
        begin, before = time.monotonic(), (0.0, 0)
        for k in range(count):
            if k == round(SETTLE_S * rate_hz):
                before = cpu_s_of(engine.pid), _woken(engine.pid)
            for n, form in enumerate(forms):
                packet = form.packet(Frame(0.0, frames[n][k % len(frames[n])]), 0, 0.0)
                time.sleep(max(begin + (k + n / sensors) / rate_hz - time.monotonic(), 0.0))
                sock.send(packet)
        return 1e3 * (cpu_s_of(engine.pid) - before[0]) / SECONDS, (_woken(engine.pid) - before[1]) / SECONDS


def _woken(pid: int) -> int:
    """The voluntary context switches of all threads of a process so far (Linux)."""
    texts = [status.read_text() for status in Path(f"/proc/{pid}/task").glob("*/status")]
    return sum(int(text.split("\nvoluntary_ctxt_switches:")[1].split()[0]) for text in texts)
