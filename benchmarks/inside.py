"""What can be measured inside one process: decoding, recognising, following, and sending an event to many clients."""

import asyncio
import socket
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pythonosc.osc_message import OscMessage

from benchmarks.timing import Row, cpu_us, interleaved, ratio
from benchmarks.traffic import touched
from gestured.client.sensor import Form
from gestured.core import messages, osc
from gestured.core.address import Grid
from gestured.core.events import Gesture
from gestured.core.frames import Frame
from gestured.core.front_end import Cut, FrontEnd
from gestured.core.hub import Hub
from gestured.core.osc import Layouts
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.core.wire import Addresses, Decoder
from gestured.daemon.clients import EventServer
from gestured.daemon.metrics import Metrics
from gestured.model.opening import open_model
from gestured.record.replay import Mute

CLIENTS = 1000
STALLED = 50
HELD = 60  # frames of a finger that is followed
TOGETHER = 64  # packets of one read


def decode() -> list[Row]:
    """Rows for decoding one frame of 81 floats against python-osc: parser against parser, and frame against frame."""
    rng = np.random.default_rng(0)
    packet = Form("armrest", plain=True).packet(Frame(0.0, rng.uniform(0, 4000, (9, 9))), 0, 0.0)
    decoder = Decoder(Addresses(), lambda _: Grid(9, 9), keep_touches=False)
    layouts, source = Layouts(), ("127.0.0.1", 40000)
    read = [
        Form(f"arm{n}", plain=True).packet(Frame(0.0, rng.uniform(0, 4000, (9, 9))), 0, 0.0) for n in range(TOGETHER)
    ]
    for one in read:
        decoder.decode(one, source)

    def theirs() -> None:
        values = np.array(OscMessage(packet).params, np.float32).reshape(9, 9)
        assert np.isfinite(values).all()

    return [
        _decode(
            "decode one frame of 81 floats: the OSC message",
            lambda: osc.decode(packet, None, layouts),
            lambda: OscMessage(packet),
        ),
        _decode("the same, to a checked 9 x 9 matrix", lambda: decoder.decode(packet, source), theirs),
        _decode(f"the same, {TOGETHER} sensors in one read", lambda: decoder.together(read), theirs, TOGETHER),
    ]


def _decode(figure: str, ours: Callable[[], object], theirs: Callable[[], object], frames: int = 1) -> Row:
    """A row of CPU time for a frame; one call of `ours` decodes so many `frames`, one of `theirs` a single frame."""
    slow, fast = interleaved(lambda: cpu_us(theirs, 2_000), lambda: cpu_us(ours, 20_000 // frames) / frames, 9)
    found = ratio(slow, fast)
    return Row(
        figure,
        f"{np.median(fast):.2f} us",
        f"{np.median(slow):.1f} us (python-osc)",
        f"{found} times as fast",
        ">= 20",
        found.median >= 20,
    )


def recognise(model: str) -> Row:
    """A row for recognising one gesture (prepare, infer, decide) against onnxruntime's bare `run` on its window."""
    take = touched(1, 60.0)
    front = FrontEnd(9, 9)
    cuts = [c for t, f in zip(take.sensor_times, take.frames, strict=True) for c in front.push(Frame(float(t), f))]
    segments = [c for c in cuts if isinstance(c, Cut)]
    opened = open_model(model)
    asked = [opened._inputs(opened.metadata.window.apply(c.segment)[np.newaxis], None) for c in segments]
    session: Any = opened._session._session
    recognizer = Sensor("bench", Scene(opened.gestures, (9, 9)), opened)

    def whole() -> None:
        for segment in segments:
            recognizer._decide(segment)

    def bare() -> None:
        for inputs in asked:
            session.run(None, inputs)

    ours, theirs = interleaved(lambda: cpu_us(whole, 5), lambda: cpu_us(bare, 5), 9)
    found = ratio(ours, theirs)
    return Row(
        "recognise one gesture: prepare, infer, decide",
        f"{np.median(ours) / len(segments):.0f} us",
        f"{np.median(theirs) / len(segments):.0f} us (bare run)",
        str(found),
        "<= 3",
        found.median <= 3,
    )


def follow() -> Row:
    """What a frame costs in the hub: with a finger that is followed, against one that nobody follows."""
    rows, columns = np.mgrid[:9, :9]
    noise, form = np.random.default_rng(0).normal(0, 2, (2 * HELD, 9, 9)), Form("bench", plain=True)
    frames = [1000 + each for each in noise]
    for k in range(HELD):  # the first half of the frames shows the idle sensor
        row, column = 4 + 2 * np.sin(k / 9), 1 + 6 * k / HELD
        frames[HELD + k] += 300 * np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / 1.6)
    packets = [form.packet(Frame(0.0, frame), 0, 0.0) for frame in frames]

    def played(sensors: tuple[str, ...] | None) -> float:
        hub = Hub(Scene(("one_tap",), (9, 9), touch=True), Mute(("one_tap",)))
        hub.foresee(())
        hub.follow(sensors)
        stream = enumerate(packets)

        def step() -> None:
            k, packet = next(stream)
            hub.receive([(packet, ("127.0.0.1", 40000))], k / 15)

        cpu_us(step, HELD + 1)
        return cpu_us(step, HELD - 1)

    ours, theirs = interleaved(lambda: played(None), lambda: played(()), 99)
    found = ratio(ours, theirs)
    return Row(
        "a frame of a finger that is followed, in the hub",
        f"{np.median(ours):.1f} us",
        f"{np.median(theirs):.1f} us (not followed)",
        str(found),
        "<= 1.2",
        found.median <= 1.2,
    )


def subscribers() -> Row:
    """A row for sending one event to 1,000 clients, 50 of whom read nothing, against as many bare sends."""
    return asyncio.run(_subscribers())


async def _subscribers() -> Row:
    event = Gesture(
        sensor="armrest", id=1, gesture="swipe_left", confidence=0.98, sequence=1, onset=12.0, offset=12.6,
        decided=12.8, frames=9, lost=0, model="cnn_lstm", degraded=False, scores={},
    )  # fmt: skip
    line = messages.to_json(event, 0.0)
    with tempfile.TemporaryDirectory(prefix="gestured-bench-") as folder:
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(Path(folder) / "events.sock"))
        listener.listen(CLIENTS)
        listener.setblocking(False)
        server = EventServer(listener, lambda: b"{}\n", Metrics(), known=dict, changed=lambda: None)
        clients = []
        for _ in range(CLIENTS):
            client = socket.socket(socket.AF_UNIX)
            client.connect(listener.getsockname())
            client.setblocking(False)
            clients.append(client)
            await asyncio.sleep(0)
        while server.count < CLIENTS:
            await asyncio.sleep(0.01)
        pairs = [socket.socketpair(socket.AF_UNIX) for _ in range(CLIENTS)]
        for one, other in pairs:
            one.setblocking(False)
            other.setblocking(False)
        heard = 0

        def read(socks: list[socket.socket]) -> int:
            total = 0
            for sock in socks[STALLED:]:
                try:
                    total += sock.recv(1 << 20).count(b'"type":"gesture"')
                except BlockingIOError:
                    pass
            return total

        async def settle() -> None:
            nonlocal heard
            for _ in range(3):
                await asyncio.sleep(0)
            heard += read(clients)

        def bare() -> None:
            for one, _ in pairs:
                try:
                    one.send(line)
                except BlockingIOError:
                    pass

        for _ in range(3000):  # until the buffers of clients that read nothing are full
            server.publish(event, 0.0)
            await settle()
            bare()
            read([other for _, other in pairs])
        ours, theirs, sent = [], [], 0
        heard = 0
        for _ in range(200):
            ours.append(cpu_us(lambda: server.publish(event, 0.0), 1))
            sent += 1
            await settle()
            theirs.append(cpu_us(bare, 1))
            read([other for _, other in pairs])
        whole = heard == sent * (CLIENTS - STALLED)
        for sock in (*clients, *(s for pair in pairs for s in pair)):
            sock.close()
        await server.close(0.0)
        listener.close()
    found = ratio(ours, theirs)
    return Row(
        f"event to {CLIENTS} clients, {STALLED} of them stalled; the others lost {'none' if whole else 'some'}",
        f"{np.median(ours) / 1e3:.2f} ms",
        f"{np.median(theirs) / 1e3:.2f} ms (bare sends)",
        f"{found.median:.3g}",
        "<= 3",
        found.median <= 3 and whole,
    )
