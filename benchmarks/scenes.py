"""What each scene pays for: start, memory, CPU of a frame, and which packages its daemon has loaded."""

import os
import time

import numpy as np

from benchmarks.latency import play
from benchmarks.timing import Ratio, Row, cpu_s_of, cpu_us, interleaved, percentile, ratio, resident_kib
from benchmarks.traffic import touched
from gestured.client.engine import Engine
from gestured.client.osc_out import dated
from gestured.client.sensor import Form
from gestured.client.stream import Stream
from gestured.core.frames import Frame, Touch
from gestured.core.wire import Addresses, Decoder
from gestured.daemon.values import Grid
from gestured.simulator import Participant, SimulatedSensor, generator, gesture_take

SCENES: dict[str, tuple[str, ...]] = {
    "minimal": (),
    "metrics": ("--metrics", "127.0.0.1:0"),
    "OSC out": ("--publish", "osc://127.0.0.1:9"),
    "forest alone": (),
    "trajectories": (),  # the sensor sends finger positions beside its frames; nothing in the daemon asks for them
    "swipes alone": ("--gestures", "swipe_left,swipe_right"),
    "everything": ("--metrics", "127.0.0.1:0", "--publish", "osc://127.0.0.1:9", "--log-level", "debug"),
}
REPEATS = 5
TOUCHES = tuple(Touch(finger, 4.0, 1.0 + 3.0 * finger) for finger in range(3))


def table(model: str) -> None:
    """Print the table of scenes, and what finger positions add to the decoding of a frame."""
    frames = touched(40, 15.0).frames
    plain, bundle = Form("bench", plain=True), Form("bench")
    streams = {"trajectories": [bundle.packet(Frame(0.0, f, TOUCHES), k, k / 15) for k, f in enumerate(frames)]}
    matrices = [plain.packet(Frame(0.0, f), 0, 0.0) for f in frames]
    print("| scene | start to ready | resident | CPU a frame | threads | descriptors |\n|---|---|---|---|---|---|")
    for name, flags in SCENES.items():
        used = "touch_pattern_rf" if name == "forest alone" else model
        seconds, kib = [], []
        for _ in range(REPEATS):
            begin = time.monotonic()
            with Engine(used, 9, 9, *flags) as engine:
                seconds.append(time.monotonic() - begin)
                kib.append(resident_kib(engine.pid))
        with Engine(used, 9, 9, *flags) as engine:
            before = cpu_s_of(engine.pid)
            play(engine.listen[1], streams.get(name, matrices))
            cpu = 1e6 * (cpu_s_of(engine.pid) - before) / len(frames)
            threads = len(os.listdir(f"/proc/{engine.pid}/task"))
            descriptors = len(os.listdir(f"/proc/{engine.pid}/fd"))
        print(
            f"| {name} | {np.median(seconds):.2f} s ({min(seconds):.2f} to {max(seconds):.2f}) "
            f"| {np.median(kib) / 1024:.1f} MiB | {cpu:.0f} us | {threads} | {descriptors} |",
            flush=True,
        )
    passed, parsed = (_decoding(keep_touches) for keep_touches in (False, True))
    print(f"\ndecode of a bundle, with three finger positions against without: {passed}; if they were kept: {parsed}")


def _decoding(keep_touches: bool) -> Ratio:
    """CPU of a bundle of a matrix and three touches, over that of one of a matrix alone."""
    decoder = Decoder(Addresses(), lambda _: Grid(9, 9), keep_touches=keep_touches)
    values = touched(40, 5.0).frames[0]
    matrix = Form("bench", plain=True).packet(Frame(0.0, values), 0, 0.0)
    both, alone = Form("bench").packet(Frame(0.0, values, TOUCHES), 0, 0.0), dated(0.0, matrix)
    source = ("127.0.0.1", 40000)
    return ratio(
        *interleaved(
            lambda: cpu_us(lambda: decoder.decode(both, source), 5_000),
            lambda: cpu_us(lambda: decoder.decode(alone, source), 5_000),
            9,
        )
    )


def subset(model: str) -> Row:
    """How long a tap waits for its answer: with all gestures in use, and with swipes alone."""
    waits = [_wait(model, ()), _wait(model, ("--gestures", "swipe_left,swipe_right"))]
    return Row(
        "last touched frame of a tap to its answer: swipes alone in use, all in use",
        f"{1e3 * waits[1]:.0f} ms",
        f"{1e3 * waits[0]:.0f} ms",
        f"{waits[1] / waits[0]:.2g}",
        "< 1",
        waits[1] < waits[0],
    )


def _wait(model: str, flags: tuple[str, ...]) -> float:
    """Seconds from the last touched frame to the answer, of the sensor's clock: median of ten taps."""
    found = []
    with Engine(model, 9, 9, "--clock", "sensor", *flags) as engine:
        stream = Stream(engine.socket, {"types": ["gesture", "unknown"]})
        for n in range(10):
            take = gesture_take(
                "one_tap", Participant(960 + n), SimulatedSensor.nominal(day=n), generator(960, n), "normal", 0
            )
            form, epoch = Form(f"tap{n}"), time.time()
            packets = [form.packet(Frame(0.0, f), k, epoch + k / 15) for k, f in enumerate(take.frames)]
            play(engine.listen[1], packets)
        for event in stream:
            found.append(event["decided"] - event["offset"])
            if len(found) == 8:  # a light tap may pass unseen
                break
        stream.close()
    return percentile(found, 0.5)
