"""What a running daemon can receive: packets for each second of CPU, and a thousand sensors on one core."""

import multiprocessing
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from benchmarks.process import Program
from benchmarks.timing import Row, cpu_s_of, delay_ms, interleaved, percentile, ratio
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.client.subscriber import Subscriber
from gestured.core.frames import Frame
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session

RATE_HZ = 15.0
SECONDS = 15.0
START_S = 5.0  # s in which many sensors are made and learned; packets lost then are given apart
SENSORS = 64  # that send together
ROOM = 256 << 10  # bytes that may wait in the kernel before the sender pauses


def touched(number: int, seconds: float) -> Take:
    """A session of one person on the nominal sensor."""
    return session(
        Participant(950 + number), SimulatedSensor.nominal(day=950 + number), generator(950, number), seconds, 0.2
    )


def idle(number: int, frames: int) -> NDArray[np.float64]:
    """(frames, 9, 9) counts of a sensor that nobody touches."""
    rng = np.random.default_rng([951, number])
    return rng.uniform(80, 160, (9, 9)) + rng.normal(0, 2, (frames, 9, 9))


def packets(turn: int, epoch: float, pressed: int) -> list[bytes]:
    """Packets of SENSORS sensors for SECONDS, of which `pressed` are touched; turn 0 began at `epoch` s."""
    count = round(SECONDS * RATE_HZ)
    values = [touched(n, SECONDS).frames[:count] if n < pressed else idle(n, count) for n in range(SENSORS)]
    forms = [Form(f"bench{n}") for n in range(SENSORS)]
    return [
        form.packet(Frame(0.0, frames[k]), turn * count + k, epoch + turn * SECONDS + k / RATE_HZ)
        for k in range(min(map(len, values)))
        for form, frames in zip(forms, values, strict=True)
    ]


def waiting(port: int) -> tuple[int, int]:
    """Bytes in the receive queue of a UDP port, and packets that found no room (/proc/net/udp)."""
    for line in Path("/proc/net/udp").read_text().splitlines()[1:]:
        parts = line.split()
        if int(parts[1].rsplit(":", 1)[1], 16) == port:
            return int(parts[4].split(":")[1], 16), int(parts[-1])
    raise RuntimeError(f"no UDP socket on port {port}")


def pour(sock: socket.socket, port: int, stream: list[bytes]) -> int:
    """Send packets as fast as the receiver takes them, all from `sock`, one source; returns how many were lost."""
    before = waiting(port)[1]
    for start in range(0, len(stream), 128):
        for packet in stream[start : start + 128]:
            sock.sendto(packet, ("127.0.0.1", port))
        while waiting(port)[0] > ROOM:
            time.sleep(0.0002)
    while waiting(port)[0]:
        time.sleep(0.0005)
    return waiting(port)[1] - before


def cpu_s_when_done(pid: int) -> float:
    """Seconds of CPU that a process has used, once its work on all packets is done."""
    before = cpu_s_of(pid)
    while True:
        time.sleep(0.05)
        now = cpu_s_of(pid)
        if now - before < 0.005:  # timers use less
            return now
        before = now


def datagrams(model: str, pressed: int, goal: float, repeats: int = 5) -> Row:
    """A row for datagrams a CPU second, front end and recognition on, against a protocol that does nothing.

    `pressed` of the sensors are touched.
    """
    lost = 0
    with (
        Engine(model, 9, 9, "--clock", "sensor") as engine,
        Program("empty") as empty,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock,
    ):
        epoch = time.time()
        # The streams are made beforehand, since a sensor that is silent for a second is learned anew.
        streams = [packets(turn, epoch, pressed) for turn in range(repeats + 1)]
        left = {engine.pid: iter(streams), empty.process.pid: iter(streams)}

        def one(pid: int, port: int) -> float:
            nonlocal lost
            stream = next(left[pid])
            start = cpu_s_of(pid)
            lost += pour(sock, port, stream)
            return (cpu_s_when_done(pid) - start) / len(stream)

        ours, theirs = interleaved(
            lambda: one(engine.pid, engine.listen[1]), lambda: one(empty.process.pid, empty.ready["port"]), repeats
        )
    found = ratio(theirs, ours)
    return Row(
        f"datagrams a CPU second, {SENSORS} sensors, {pressed or 'none'} touched; {lost} lost",
        f"{1 / np.median(ours):,.0f}",
        f"{1 / np.median(theirs):,.0f} (empty uvloop protocol)",
        str(found),
        f">= {goal}",
        found.median >= goal and lost == 0,
    )


def _many(number: int) -> Iterator[list[bytes]]:
    """The packets of each sensor; one in ten is touched, by one of five people, from some moment of the session on."""
    sessions = [touched(n, 30.0).frames for n in range(5)]
    for n in range(number):
        form = Form(f"s{n}", plain=True)
        values = np.roll(sessions[n // 10 % 5], 22 * (n // 50), axis=0) if n % 10 == 0 else idle(n, 30)
        yield [form.packet(Frame(0.0, f), 0, 0.0) for f in values]


def _send(port: int, number: int, seconds: float, pipe: Connection) -> None:
    """Send as `number` sensors at 15 Hz, evenly spread; `pipe` gets the times (monotonic s) of begin and end."""
    streams = list(_many(number))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", port))
        begin = time.monotonic() + 0.2
        pipe.send(begin)
        for k in range(int(seconds * RATE_HZ)):
            for n in range(number):
                due = begin + (k + n / number) / RATE_HZ
                while (wait := due - time.monotonic()) > 0:
                    time.sleep(min(wait, 0.0005))
                sock.send(streams[n][k % len(streams[n])])
    pipe.send(time.monotonic())


@contextmanager
def _one_core(pid: int) -> Iterator[None]:
    """Give a process the first core, and this process and its children the others, if there are any."""
    mine = os.sched_getaffinity(0)
    first, *others = sorted(mine)
    os.sched_setaffinity(pid, {first})
    os.sched_setaffinity(0, others or mine)
    try:
        yield
    finally:
        os.sched_setaffinity(0, mine)


@dataclass(frozen=True)
class Served:
    """What became of the packets of many sensors."""

    late_ms: list[float]  # from each decision to its event, once all have settled
    lost: int
    lost_at_start: int  # of these, in the first START_S
    cpu: float  # share of the core


def serve(model: str, number: int, seconds: float) -> Served:
    """Have a daemon on one core serve so many sensors at 15 Hz, a tenth of them touched."""
    with Engine(model, 9, 9, "--max-sensors", str(number)) as engine, _one_core(engine.pid):
        subscriber = Subscriber(engine.socket, types=["gesture", "unknown"])
        heard: list[tuple[float, float]] = []  # monotonic s, and ms since the answer was decided

        def listen() -> None:
            for event in subscriber:
                if event["type"] in ("gesture", "unknown"):
                    heard.append((at := time.monotonic(), delay_ms(event, at)))

        reader = threading.Thread(target=listen)
        reader.start()
        port = engine.listen[1]
        before = waiting(port)[1]
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        sender = context.Process(target=_send, args=(port, number, seconds, theirs))
        sender.start()
        theirs.close()  # so that `recv` fails if the sender dies
        settled = ours.recv() + START_S
        time.sleep(settled - time.monotonic())
        at_start, cpu = waiting(port)[1] - before, cpu_s_of(engine.pid)
        ours.recv()
        cpu = (cpu_s_of(engine.pid) - cpu) / (time.monotonic() - settled)
        sender.join()
        lost = waiting(port)[1] - before
        subscriber.close()
        reader.join()
    return Served([delay for at, delay in heard if at >= settled], lost, at_start, cpu)


def sensors(model: str, number: int, seconds: float = 25.0, repeats: int = 3) -> Row:
    """Sensors at 15 Hz on one core: packets lost, and the time from a decision to its event; medians of the runs."""
    runs = [serve(model, number, seconds) for _ in range(repeats)]
    half, most = ([percentile(run.late_ms, share) for run in runs] for share in (0.5, 0.99))
    lost, at_start = ([getattr(run, name) for run in runs] for name in ("lost", "lost_at_start"))
    return Row(
        f"{number} sensors at 15 Hz on one core, one in ten touched, {repeats} runs of {len(runs[0].late_ms)} events",
        f"p50 {_spread(half, 2)} ms, p99 {_spread(most, 2)} ms, {_spread(lost, 0)} packets lost, "
        f"{_spread(at_start, 0)} of them in the first {START_S:g} s",
        f"{_spread([run.cpu for run in runs], 2)} of the core",
        "",
        "p99 < 5 ms, 0 lost" if number == 1000 else "",
        median(most) < 5 and max(lost) == 0 if number == 1000 else None,
    )


def _spread(found: list[float], digits: int) -> str:
    """The median of measurements, the least and the most."""
    return "{:,.{d}f} ({:,.{d}f} to {:,.{d}f})".format(median(found), min(found), max(found), d=digits)
