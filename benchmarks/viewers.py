"""What viewers cost the daemon: the delay of its events with three viewers, and with none."""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from benchmarks.process import Program
from benchmarks.timing import Row, cpu_s_of, delay_ms, interleaved, percentile, ratio
from benchmarks.traffic import RATE_HZ, touched
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.client.subscriber import Subscriber
from gestured.core.frames import Frame

VIEWERS = 3
SENSORS = 20  # all touched, for enough events for a 99th percentile
SECONDS = 12.0
ROUNDS = 6
WARM = 30  # frames
TYPES = ["onset", "gesture", "unknown"]


@contextmanager
def viewer(control: str, sensor: str) -> Iterator[int]:
    """Run `gesturectl view` with one browser that views a sensor; gives its process id."""
    command = [sys.executable, "-m", "gestured.control", "view", "--control", control, "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            with Program("browser", process.stdout.readline().strip(), sensor):
                yield process.pid
        finally:
            process.terminate()


def viewers(model: str) -> list[Row]:
    """Delays of all events, and processor time, in the same daemon: in turn with three viewers and with none."""
    forms = [Form(f"bench{n}") for n in range(SENSORS)]
    takes = [touched(40 + n, SECONDS).frames for n in range(SENSORS)]
    count = 0
    daemon_ms: dict[int, list[float]] = {0: [], VIEWERS: []}  # of processor time in a second, by the number of viewers
    viewers_ms: list[float] = []  # ms of processor time in a second, of all viewers together

    def play(sender: socket.socket, frames: int) -> None:
        nonlocal count
        begin = time.monotonic()
        for k in range(frames):
            time.sleep(max(begin + k / RATE_HZ - time.monotonic(), 0.0))
            for n, form in enumerate(forms):
                sender.send(form.packet(Frame(0.0, takes[n][k]), count, time.time()))
            count += 1

    with Engine(model, 9, 9) as engine, socket.socket(type=socket.SOCK_DGRAM) as sender:
        sender.connect(engine.listen)
        control = engine.ready["control"]

        def measure(watchers: int) -> float:
            delays: list[float] = []
            with ExitStack() as stack:
                play(sender, 1)  # so that the daemon knows the sensor
                looking = [stack.enter_context(viewer(control, "bench0")) for _ in range(watchers)]
                play(sender, WARM)  # until the effect of the pause is over
                subscriber = stack.enter_context(Subscriber(engine.socket, types=TYPES))

                def hear() -> None:
                    for event in subscriber:
                        delays.append(delay_ms(event, time.monotonic()))

                listener = threading.Thread(target=hear, daemon=True)
                listener.start()
                began, before = time.monotonic(), [cpu_s_of(pid) for pid in (engine.pid, *looking)]
                play(sender, min(len(frames) for frames in takes))  # takes differ in length, since sensors lose frames
                after, took = [cpu_s_of(pid) for pid in (engine.pid, *looking)], time.monotonic() - began
                ours, *theirs = (1e3 * (b - a) / took for a, b in zip(before, after, strict=True))
                daemon_ms[watchers].append(ours)
                viewers_ms.append(sum(theirs))
                subscriber.close()
                listener.join()
            return percentile(delays, 0.99)

        watched, alone = interleaved(lambda: measure(VIEWERS), lambda: measure(0), ROUNDS)
    found, busy = ratio(watched, alone), ratio(daemon_ms[VIEWERS][1:], daemon_ms[0][1:])
    what = f"events of {SENSORS} touched sensors, {VIEWERS} viewers looking at one of them"
    delays = [f"p99 {percentile(values, 0.5):.2f} ms" for values in (watched, alone)]
    spent = [f"{percentile(daemon_ms[watchers][1:], 0.5):.0f} ms a second" for watchers in (VIEWERS, 0)]
    theirs = f"{percentile([ms for ms in viewers_ms if ms][1:], 0.5):.0f} ms a second"
    return [
        Row(what, delays[0], f"{delays[1]} (nobody looks)", str(found), "<= 1.1", found.median <= 1.1),
        Row(
            f"the same: CPU of the daemon; the viewers use {theirs}",
            spent[0],
            f"{spent[1]} (nobody looks)",
            str(busy),
            "",
            None,
        ),
    ]
