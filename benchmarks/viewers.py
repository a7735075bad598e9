"""What the daemon notices of those who look on: the delay of its events with three viewers, and without."""

import http.client
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from urllib.parse import urlsplit

from benchmarks.timing import Row, interleaved, percentile, ratio
from benchmarks.traffic import RATE_HZ, touched
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.client.stream import Stream
from gestured.core.frames import Frame

VIEWERS = 3
SENSORS = 20  # all of them are touched: so many events that a 99th percentile says something
SECONDS = 12.0
ROUNDS = 3
WARM = 30  # frames
TYPES = ["onset", "gesture", "unknown", "cancelled", "release"]


@contextmanager
def viewer(control: str, sensor: str) -> Iterator[None]:
    """`gesturectl view` with one browser that looks at a sensor, and reads all that comes."""
    command = [sys.executable, "-m", "gestured.control", "view", "--control", control, "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            address = urlsplit(process.stdout.readline().strip())
            page = http.client.HTTPConnection(address.netloc)
            page.request("GET", f"/?{address.query}")
            answer = page.getresponse()
            cookie = answer.headers["Set-Cookie"].partition(";")[0]
            answer.read()
            page.request("GET", f"/stream?sensor={sensor}", headers={"Cookie": cookie})
            stream = page.getresponse()
            while not stream.readline().startswith(b"event: frame"):
                pass  # it sees what it looks at
            threading.Thread(target=_read, args=(stream,), daemon=True).start()
            yield
        finally:
            process.terminate()


def _read(stream: http.client.HTTPResponse) -> None:
    try:
        while stream.readline():
            pass
    except (OSError, ValueError, AttributeError):
        pass  # the viewer has ended


def viewers(model: str) -> Row:
    """Delays of all events in the same daemon, in turn with three viewers and with none."""
    forms = [Form(f"bench{n}") for n in range(SENSORS)]
    takes = [touched(40 + n, SECONDS).frames for n in range(SENSORS)]
    sent = [0.0] * SENSORS  # monotonic s, the last frame of each
    count = 0

    def play(sender: socket.socket, frames: int) -> None:
        nonlocal count
        begin = time.monotonic()
        for k in range(frames):
            time.sleep(max(begin + k / RATE_HZ - time.monotonic(), 0.0))
            for n, form in enumerate(forms):
                sender.send(form.packet(Frame(0.0, takes[n][k]), count, time.time()))
                sent[n] = time.monotonic()
            count += 1

    with Engine(model, 9, 9) as engine, socket.socket(type=socket.SOCK_DGRAM) as sender:
        sender.connect(engine.listen)
        control = engine.ready["control"]

        def measure(watchers: int) -> float:
            delays: list[float] = []
            with ExitStack() as stack:
                play(sender, 1)  # so that there is something to look at
                for _ in range(watchers):
                    stack.enter_context(viewer(control, "bench0"))
                play(sender, WARM)  # what the pause has left behind is over
                stream = stack.enter_context(Stream(engine.socket, {"types": TYPES}))

                def hear() -> None:
                    for event in stream:
                        delays.append(1e3 * (time.monotonic() - sent[int(event["sensor"].removeprefix("bench"))]))

                listener = threading.Thread(target=hear, daemon=True)
                listener.start()
                play(sender, min(len(frames) for frames in takes))  # a sensor misses a frame now and then
                stream.socket.shutdown(socket.SHUT_RDWR)
                listener.join()
            return percentile(delays, 0.99)

        watched, alone = interleaved(lambda: measure(VIEWERS), lambda: measure(0), ROUNDS)
    found = ratio(watched, alone)
    ours, against = (f"p99 {percentile(values, 0.5):.2f} ms" for values in (watched, alone))
    what = f"events of {SENSORS} touched sensors, {VIEWERS} viewers looking at one of them"
    return Row(what, ours, f"{against} (nobody looks)", str(found), "<= 1.1", found.median <= 1.1)
