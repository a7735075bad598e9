"""Latency from the decision of an answer, by the event's own time, to its arrival at a client, at 15 Hz."""

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from benchmarks.process import Program, free_socket
from benchmarks.timing import Row, delay_ms, percentile, ratio
from benchmarks.traffic import RATE_HZ, touched
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.core.frames import Frame

ANSWERS = ["gesture", "unknown"]
ROUNDS = 5
SECONDS = 30.0


@contextmanager
def _lines(path: str, hear: Callable[[bytes, float], None], ask: bytes = b"") -> Iterator[None]:
    """While the context lasts, call `hear` with each line of a socket and the time (monotonic s) at which it came."""

    def run() -> None:
        with sock.makefile("rb") as lines:
            for line in lines:
                hear(line, time.monotonic())

    with socket.socket(socket.AF_UNIX) as sock:
        sock.connect(path)
        sock.sendall(ask)
        thread = threading.Thread(target=run)
        thread.start()
        yield
        sock.shutdown(socket.SHUT_RDWR)
        thread.join()


def play(port: int, stream: list[bytes], rate_hz: float = RATE_HZ) -> list[float]:
    """Send packets at `rate_hz`; returns the time (monotonic s) at which each was sent."""
    sent = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", port))
        begin = time.monotonic() + 0.05
        for k, packet in enumerate(stream):
            time.sleep(max(begin + k / rate_hz - time.monotonic(), 0.0))
            sent.append(time.monotonic())
            sock.send(packet)
    time.sleep(1 / rate_hz)
    return sent


def _ours(engine: Engine, stream: list[bytes]) -> float:
    """The median time (ms) from the decision of an answer to its arrival."""
    delays: list[float] = []

    def hear(line: bytes, at: float) -> None:
        event = json.loads(line)
        if event["type"] in ANSWERS:
            delays.append(delay_ms(event, at))

    ask = json.dumps({"subscribe": {"types": ANSWERS}}).encode() + b"\n"
    with _lines(str(engine.socket), hear, ask):
        play(engine.listen[1], stream)
    return percentile(delays, 0.5)


def _theirs(program: Program, path: str, stream: list[bytes]) -> float:
    """The median time (ms) from a packet to its line, of a program that answers each packet."""
    heard: list[float] = []
    with _lines(path, lambda line, at: heard.append(at)):
        sent = play(program.ready["port"], stream)
    return percentile([1e3 * (at - max(t for t in sent if t <= at)) for at in heard], 0.5)


def latency(model: str) -> list[Row]:
    """The daemon's latency against that of an echo without any work, and against that of the ordinary script."""
    form = Form("bench", plain=True)
    ours, echoed, ordinary = [], [], []
    echo_at, script_at = free_socket(), free_socket()
    with Engine(model, 9, 9) as engine, Program("echo", echo_at) as echo, Program("ordinary", script_at) as script:
        for k in range(ROUNDS):
            stream = [form.packet(Frame(0.0, f), 0, 0.0) for f in touched(20 + k, SECONDS).frames]
            ours.append(_ours(engine, stream))
            echoed.append(_theirs(echo, echo_at, stream[:90]))
            ordinary.append(_theirs(script, script_at, stream[:90]))
    beside_echo, beside_script = ratio(ours, echoed), ratio(ours, ordinary)
    text = f"{percentile(ours, 0.5):.2f} ms"
    what = "answer decided to event received (p50), frames 67 ms apart"
    against = f"{percentile(echoed, 0.5):.2f} ms (UDP-to-Unix echo of a frame)"
    script_text = f"{percentile(ordinary, 0.5):.2f} ms (ordinary script, from a frame to its line)"
    return [
        Row(what, text, against, str(beside_echo), "<= 3.5", beside_echo.median <= 3.5),
        Row(what, text, script_text, str(beside_script), "<= 0.33", beside_script.median <= 1 / 3),
    ]
