"""What an idle frame costs in the hub: processed together with the others of its read, and by itself."""

import time

import numpy as np

from benchmarks.timing import Row, ratio
from gestured.client.sensor import Form
from gestured.core import bank
from gestured.core.frames import Frame
from gestured.core.hub import Hub
from gestured.core.scene import Scene
from gestured.record.replay import Mute

SETTLE_S = 1.6  # s, after which each idle sensor is learned
READS = 160  # reads after SETTLE_S whose cost is measured
NEVER = 1 << 30  # a value for `FEW`: so many frames never wait together, so each is taken by itself


def idle_frames() -> list[Row]:
    """A row for each number of sensors, of 9 x 9 at 15 Hz and of 16 x 16 at 200 Hz."""
    nine = [_row(sensors, 9, 15.0, "floats") for sensors in (1, 4, 16, 64)]
    return [*nine, _row(64, 16, 200.0, "uint16")]


def _row(sensors: int, side: int, rate_hz: float, values: str) -> Row:
    together, alone = _costs(sensors, side, rate_hz, values)
    found = ratio(together, alone)
    us = float(np.median(together))
    return Row(
        f"idle frame of {side} x {side} in the hub, {sensors} in a read",
        f"{us:.1f} us: {1e6 / us / rate_hz:,.0f} sensors at {rate_hz:g} Hz fill a core",
        f"{np.median(alone):.1f} us (each by itself)", str(found), "", None,
    )  # fmt: skip


def _costs(sensors: int, side: int, rate_hz: float, values: str) -> tuple[list[float], list[float]]:
    """Processor time of a frame (us), medians of eight groups of reads: the hub as it is, and each frame by itself."""
    rng = np.random.default_rng(0)
    base = rng.uniform(80, 160, (sensors, side, side))
    forms = [Form(f"s{n}", values) for n in range(sensors)]
    scene = Scene(("one_tap",), (side, side), clock="sensor", touches=False)
    few = bank.FEW
    pair = [(Hub(scene, Mute(scene.gestures)), at, list[float]()) for at in (few, NEVER)]
    settle = round(SETTLE_S * rate_hz) + 1
    for k in range(settle + READS):
        noisy = base + rng.normal(0, 3, base.shape)
        read = [
            (form.packet(Frame(0.0, one), k, 1.7e9 + k / rate_hz), ("127.0.0.1", 1))
            for form, one in zip(forms, noisy, strict=True)
        ]
        for hub, at, costs in pair:
            bank.FEW = at
            start = time.process_time_ns()
            hub.receive(read, k / rate_hz)
            if k >= settle:
                costs.append((time.process_time_ns() - start) / sensors / 1e3)
    bank.FEW = few
    parts = [np.array(costs).reshape(8, -1) for _, _, costs in pair]
    together, alone = (np.median(part, axis=1).tolist() for part in parts)
    return together, alone
