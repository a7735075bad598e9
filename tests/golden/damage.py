"""Golden tapes of bad sensors and bad packets: the damage table, rubbish, silence and restarts."""

import random
import struct
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.client.sensor import Form
from tests import encoding
from tests.golden.making import ARM, LEG, UINT16, Sent, damaged, hands, moment, sent, tape
from tests.golden.tape import Tape
from tests.hostile.faults import FAULTS, Fault


def faults() -> list[Tape]:
    """Every fault of the damage table, on two people's sensors."""
    takes = [hands(50, 45), hands(51, 45)]

    def of(name: str, fault: Fault) -> Tape:
        values = "floats" if "spike" in name else "uint16"
        packets = [
            damaged(fault, take, Form(who, values), n, source)
            for n, (take, who, source) in enumerate(zip(takes, ("arm", "leg"), (ARM, LEG), strict=True))
        ]
        return tape(name, "a fault of the damage table", *packets)

    return [of(name, fault) for name, fault in FAULTS.items()]


def rubbish() -> list[Tape]:
    """Packets that mean nothing among those that do."""
    rng = random.Random(90)
    good = sent(hands(90, 60), UINT16)
    values = np.full(81, 50.0, np.float32)

    def message(types: str = "f" * 81, *args: object, address: str = "/arm/pressure") -> bytes:
        return encoding.message(address, types, list(args) or [values])  # type: ignore[arg-type]

    nan = values.copy()
    nan[7] = np.nan
    huge = np.full(81, 3e38, np.float32)
    fixed = [
        b"", b"\0", b"/", b"#bundle\0", b"#bundle\0" + bytes(8), bytes(65_000),
        message("f" * 80, values[:80]), message("f" * 82, np.append(values, 1)), message("f" * 81, nan),
        message("f" * 81, huge), message("s", "hello"), message("b", bytes(80)), message("b", bytes(81 * 8)),
        message(address="/arm/else"), message(address="/nobody knows/pressure"), message(address="/ar*/pressure"),
        message("iff", 1, 2.0, 3.0, address="/arm/trajectory"), message("if", 1, 2.0, address="/arm/trajectory"),
        message("iff" * 4, *([1, 2.0, 3.0] * 4), address="/arm/trajectory"),
        encoding.bundle([encoding.bundle([message()], moment(1.0))], moment(1.0)),
        encoding.bundle([b"abc", message("f" * 81, nan)], moment(2.0)), message() + b"x", message()[:-4],
        b"#bundle\0" + bytes(8) + struct.pack(">i", -4), b"#bundle\0" + bytes(8) + struct.pack(">i", 2**31 - 4),
    ]  # fmt: skip
    bad: list[Sent] = []
    for t, _, data in good:
        source = ARM if rng.random() < 0.5 else ("10.0.0.8", 1)
        kind = rng.random()
        if kind < 0.2:
            bad.append((t + 0.01, source, rng.choice(fixed)))
        elif kind < 0.3:
            changed = bytearray(data)
            for _ in range(rng.randrange(1, 4)):
                changed[rng.randrange(len(changed))] = rng.randrange(256)
            bad.append((t + 0.01, source, bytes(changed)))
        elif kind < 0.35:
            bad.append((t + 0.01, source, rng.randbytes(rng.randrange(60))))
    return [
        tape("rubbish", "broken packets from the owner and from others", good, bad),
        tape("rubbish, sensor's clock", "the same, by time tags", good, bad, clock="sensor"),
    ]


def silence() -> list[Tape]:
    """Sensors that fall silent and return, and that restart as another sensor."""
    take = hands(95, 60)
    packets = sent(take, UINT16)
    onsets = [(event.onset_s + event.offset_s) / 2 for event in take.events]
    middle = next((e.onset_s + e.offset_s) / 2 for e in take.events if e.offset_s - e.onset_s > 0.7 and e.onset_s > 20)
    cut = [p for p in packets if not any(t <= p[0] < t + 1.4 for t in onsets[1::4])]  # in the middle of a gesture
    brief = [p for p in packets if not any(t <= p[0] < t + 0.35 for t in onsets[1::3])]
    levels: NDArray[Any] = take.frames.copy()
    shifted = replace(take, frames=levels)
    at = len(take.frames) // 3
    levels[at:] += 40  # everything has another level after a restart that the counter does not show
    levels[2 * at :] -= 60
    long = [*[p for p in packets if p[0] < 20], *[(t + 90, who, data) for t, who, data in packets if t >= 20]]
    new = [(t + 0.5 * (t > 30), who, data) for t, who, data in sent(shifted, UINT16, counter=lambda n: n % 450)]
    return [
        tape("silent in a gesture", "for 1.4 s, again and again", cut),
        tape("holes in gestures", "of 0.35 s", brief),
        tape("silent for long", "a minute and a half", long),
        tape("another level", "a restart that nobody announced", sent(shifted, UINT16)),
        tape("another level, no counter", "the same without a counter", sent(shifted, replace(UINT16, plain=True))),
        tape("restarts", "another level and a counter that begins anew", new),
        tape("falls silent in a contact", "and the daemon stops", [p for p in packets if p[0] < middle], rest_s=0.1),
    ]
