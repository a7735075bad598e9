"""What each scene costs beside the minimal one: instructions that are counted, and time and memory."""

import os
import socket
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import date
from statistics import median

from benchmarks import scenes_counted
from benchmarks.latency import play
from benchmarks.timing import Ratio, Row, cpu_s_of, cpu_us, interleaved, percentile, ratio, resident_kib
from benchmarks.traffic import RATE_HZ, touched
from gestured.client.engine import Engine
from gestured.client.lines import read_ahead
from gestured.client.osc_out import dated
from gestured.client.sensor import Form
from gestured.client.subscriber import Subscriber
from gestured.core.address import Grid
from gestured.core.frames import Frame, Touch
from gestured.core.wire import Addresses, Decoder
from gestured.simulator import Participant, SimulatedSensor, generator, gesture_take

OSC = "osc://127.0.0.1:{port}"  # a socket that is open, but not read
TUIO = "tuio://127.0.0.1:{port}"
SCENES: dict[str, tuple[str, ...]] = {
    "minimal": (),
    "metrics": ("--metrics", "127.0.0.1:0"),  # nobody reads them
    "OSC out": ("--publish", OSC),
    "TUIO out": ("--touch", "true", "--publish", TUIO),  # fingers are followed
    "flight recorder": ("--flight-recorder", "4"),
    "forest alone": (),
    "trajectories": (),  # the sensor sends finger positions beside its frames; nothing in the daemon asks for them
    "swipes alone": ("--gestures", "swipe_left,swipe_right"),
    "everything": ("--metrics", "127.0.0.1:0", "--publish", OSC, "--flight-recorder", "4", "--log-level", "debug"),
}
SECONDS = 15.0  # of touching
ROUNDS = 5
TOUCHES = tuple(Touch(finger, 4.0, 1.0 + 3.0 * finger) for finger in range(3))


@dataclass(frozen=True)
class Scene:
    """A daemon's model and flags, and what its sensor sends."""

    model: str
    flags: tuple[str, ...]
    stream: list[bytes]


@dataclass(frozen=True)
class Cost:
    """The cost of one daemon in one round."""

    start_s: float
    resident_kib: int
    cpu_s: float
    threads: int
    descriptors: int


def table(model: str) -> str:
    """Both tables of scenes, and what finger positions add to the decoding of a frame."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        found = _scenes(model, listener.getsockname()[1])
        counts = {name: scenes_counted.counted(one.model, one.flags, one.stream) for name, one in found.items()}
        beside = _beside([_round(found) for _ in range(ROUNDS + 1)][1:])  # the first round warms up
    passed, parsed = (_decoding(keep_touches) for keep_touches in (False, True))
    cost = f"decode of a bundle, with three finger positions against without: {passed}; if they were kept: {parsed}"
    return "\n\n".join((scenes_counted.table(counts), f"Measured on {date.today()}:", beside, cost))


def _scenes(model: str, port: int) -> dict[str, Scene]:
    """The scenes by name; all their sensors show the same touches, and send bundles with time tags."""
    frames, plain, bundle = touched(40, SECONDS).frames, Form("bench", plain=True), Form("bench")
    epoch = time.time()
    alone = [dated(epoch + k / RATE_HZ, plain.packet(Frame(0.0, f), 0, 0.0)) for k, f in enumerate(frames)]
    fingers = [bundle.packet(Frame(0.0, f, TOUCHES), k, epoch + k / RATE_HZ) for k, f in enumerate(frames)]
    return {
        name: Scene(
            "touch_pattern_rf" if name == "forest alone" else model,
            tuple(flag.format(port=port) for flag in flags),
            fingers if name in ("trajectories", "everything") else alone,
        )
        for name, flags in SCENES.items()
    }


def _round(found: Mapping[str, Scene]) -> dict[str, Cost]:
    """The cost of each scene's daemon; all run together and are fed in turn, so the machine is as busy for each."""
    with ExitStack() as stack:
        engines: dict[str, tuple[Engine, float]] = {}
        for name, scene in found.items():
            begin = time.monotonic()
            engine = stack.enter_context(Engine(scene.model, 9, 9, "--clock", "sensor", *scene.flags))
            engines[name] = engine, time.monotonic() - begin
        before = {name: cpu_s_of(engine.pid) for name, (engine, _) in engines.items()}
        sock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        begin = time.monotonic()
        for k in range(len(next(iter(found.values())).stream)):
            for n, (name, (engine, _)) in enumerate(engines.items()):
                time.sleep(max(begin + (k + n / len(engines)) / RATE_HZ - time.monotonic(), 0.0))
                sock.sendto(found[name].stream[k], ("127.0.0.1", engine.listen[1]))
        return {
            name: Cost(
                start_s,
                resident_kib(engine.pid),
                cpu_s_of(engine.pid) - before[name],
                len(os.listdir(f"/proc/{engine.pid}/task")),
                len(os.listdir(f"/proc/{engine.pid}/fd")),
            )
            for name, (engine, start_s) in engines.items()
        }


def _beside(rounds: list[dict[str, Cost]]) -> str:
    """The table of costs beside the first scene: over the rounds, the median, the least and the most."""
    first = next(iter(rounds[0]))
    lines = [
        "| scene | start, times minimal | CPU, times minimal | resident, MiB more | threads | descriptors |",
        "|---|---|---|---|---|---|",
    ]
    for name in rounds[0]:
        ours, least = [one[name] for one in rounds], [one[first] for one in rounds]
        start = ratio([cost.start_s for cost in ours], [cost.start_s for cost in least])
        cpu = ratio([cost.cpu_s for cost in ours], [cost.cpu_s for cost in least])
        more = sorted((a.resident_kib - b.resident_kib) / 1024 for a, b in zip(ours, least, strict=True))
        lines.append(
            f"| {name} | {start} | {cpu} | {median(more):+.2f} ({more[0]:+.2f} to {more[-1]:+.2f}) "
            f"| {ours[0].threads} | {ours[0].descriptors} |"
        )
    plain = [one[first] for one in rounds]
    lines.append(
        f"\nminimal: {median(cost.start_s for cost in plain):.2f} s to start, "
        f"{median(cost.resident_kib for cost in plain) / 1024:.1f} MiB, "
        f"{1e3 * median(cost.cpu_s for cost in plain) / SECONDS:.1f} ms of CPU a second at {RATE_HZ:g} Hz"
    )
    return "\n".join(lines)


def _decoding(keep_touches: bool) -> Ratio:
    """CPU time to decode a bundle of a matrix and three touches, over that of a bundle of the matrix alone."""
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
    """Seconds of the sensor's clock from the last touched frame to the answer: the median of eight of ten taps."""
    found = []
    with Engine(model, 9, 9, "--clock", "sensor", *flags) as engine:
        subscriber = Subscriber(engine.socket, types=["gesture", "unknown"])
        heard = read_ahead(line for _, line in subscriber.lines())
        heard.get()  # the hello
        for n in range(10):
            take = gesture_take(
                "one_tap", Participant(960 + n), SimulatedSensor.nominal(day=n), generator(960, n), "normal", 0
            )
            form, epoch = Form(f"tap{n}"), time.time()
            packets = [form.packet(Frame(0.0, f), k, epoch + k / 15) for k, f in enumerate(take.frames)]
            play(engine.listen[1], packets)
        for event in iter(heard.get, None):
            found.append(event["decided"] - event["offset"])
            if len(found) == 8:  # a light tap may be missed
                break
        subscriber.close()
    return percentile(found, 0.5)
