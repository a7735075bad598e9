"""From the last frame to the event at a client, beyond the segmenter's own waiting; frames come 67 ms apart."""

import socket
import threading
import time
from contextlib import closing

from benchmarks.process import Program, free_socket
from benchmarks.timing import Row, percentile, ratio
from benchmarks.traffic import RATE_HZ, touched
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.core.frames import Frame

ROUNDS = 5
SECONDS = 30.0


def _listen(
    path: str, wanted: tuple[bytes, ...], into: list[float], ask: bytes = b""
) -> tuple[socket.socket, threading.Thread]:
    sock = socket.socket(socket.AF_UNIX)
    sock.connect(path)
    sock.sendall(ask)

    def run() -> None:
        with sock.makefile("rb") as lines:
            for line in lines:
                if any(word in line for word in wanted):
                    into.append(time.monotonic())

    thread = threading.Thread(target=run)
    thread.start()
    return sock, thread


def play(port: int, stream: list[bytes], rate_hz: float = RATE_HZ) -> list[float]:
    """Send a stream at its pace; returns when each packet was sent, in monotonic seconds."""
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


def _delays(sent: list[float], heard: list[float]) -> list[float]:
    """Milliseconds from the last packet before each answer to that answer."""
    return [1e3 * (at - max(t for t in sent if t <= at)) for at in heard if at > sent[0]]


def _measure(port: int, path: str, wanted: tuple[bytes, ...], stream: list[bytes], ask: bytes = b"") -> float:
    heard: list[float] = []
    sock, thread = _listen(path, wanted, heard, ask)
    with closing(sock):
        sent = play(port, stream)
        sock.shutdown(socket.SHUT_RDWR)
        thread.join()
    return percentile(_delays(sent, heard), 0.5)


def latency(model: str) -> list[Row]:
    """Against an echo that does nothing, and against the ordinary script."""
    form = Form("bench", plain=True)
    ours, echoed, ordinary = [], [], []
    echo_at, script_at = free_socket(), free_socket()
    ask = b'{"subscribe": {"types": ["gesture", "unknown"]}}\n'
    with Engine(model, 9, 9) as engine, Program("echo", echo_at) as echo, Program("ordinary", script_at) as script:
        for k in range(ROUNDS):
            stream = [form.packet(Frame(0.0, f), 0, 0.0) for f in touched(20 + k, SECONDS).frames]
            answers = (b'"type":"gesture"', b'"type":"unknown"')
            ours.append(_measure(engine.listen[1], str(engine.socket), answers, stream, ask))
            echoed.append(_measure(echo.ready["port"], echo_at, (b"echo",), stream[:90]))
            ordinary.append(_measure(script.ready["port"], script_at, (b"confidence",), stream[:90]))
    beside_echo, beside_script = ratio(ours, echoed), ratio(ours, ordinary)
    text = f"{percentile(ours, 0.5):.2f} ms"
    what = "last frame sent to event received (p50), 67 ms apart"
    against = f"{percentile(echoed, 0.5):.2f} ms (UDP-to-Unix echo)"
    script_text = f"{percentile(ordinary, 0.5):.2f} ms (ordinary script)"
    return [
        Row(what, text, against, str(beside_echo), "<= 3.5", beside_echo.median <= 3.5),
        Row(what, text, script_text, str(beside_script), "<= 0.33", beside_script.median <= 1 / 3),
    ]
