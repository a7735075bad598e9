"""Golden tapes of what hands do: people on several sensors, kind by kind, and in other settings."""

import itertools
from dataclasses import replace

from gestured.client.sensor import Form
from gestured.simulator import GESTURES, NON_GESTURES, SEQUENCES, SimulatedSensor, Take, any_sensor, generator
from tests.golden.making import LEG, QUIET, UINT16, hands, held, jammed, sent, struck, tape
from tests.golden.tape import Tape

TAPS = ("one_tap", "double_tap", "tap_then_swipe", "one_tap", "triple_tap", "double_tap", "tap_then_hold", "taps_apart")


def people() -> list[Tape]:
    """Several sensors at once, of different grids, rates, mountings and forms of frames."""
    arm = sent(hands(1, 80), UINT16)
    leg = replace(QUIET, rows=12, columns=6, rate_hz=30.0)
    back = replace(QUIET, rows=6, columns=8, pitch_mm=10.0, gain=900.0)
    seat = replace(QUIET, rows=15, columns=10, pitch_mm=6.0, clipped=True, gain=90.0, dtype="uint8", saturation=255)
    mounted = {
        "leg": {"grid": "12x6", "rotate": 90},
        "back": {"grid": "6x8", "mirror": True},
        "seat": {"grid": "15x10", "rotate": 270, "mirror": True},
    }
    four = tape(
        "four sensors",
        "floats, ints, uint16 and uint8; rotated and mirrored; with trajectories; long after the machine started",
        arm,
        sent(hands(2, 60, leg), Form("leg"), LEG, 0.013),
        sent(hands(3, 80, back), Form("back", "ints"), ("10.0.0.3", 5003), 0.41),
        sent(hands(4, 60, seat), Form("seat", "uint8"), ("10.0.0.4", 5004), 7.2),
        origin_s=86_400.125,
        sensors=mounted,
    )
    small = replace(QUIET, rows=6, columns=6, pitch_mm=12.0, gain=60.0)
    rates = tape(
        "rates",
        "5, 30, 100 and 1000 frames a second, two sensors without counter and time tag",
        sent(hands(5, 90, replace(QUIET, rate_hz=5.0, jitter_s=0.01)), Form("slow", "uint16")),
        sent(hands(6, 60, replace(small, rate_hz=30.0)), Form("mid", "float32", plain=True), LEG, 0.02),
        sent(hands(7, 30, replace(small, rate_hz=100.0)), Form("fast", "uint8"), ("10.0.0.3", 5003), 1.0),
        sent(
            hands(8, 12, replace(small, rows=4, columns=4, pitch_mm=18.0, rate_hz=1000.0, jitter_s=0.0002)),
            Form("rapid", "uint8", plain=True),
            ("10.0.0.4", 5004),
            3.0,
        ),
        sensors={name: {"grid": "6x6", "rotate": 180} for name in ("mid", "fast")} | {"rapid": {"grid": "4x4"}},
    )
    return [four, rates, *(_wide(n) for n in range(2))]


def _wide(number: int) -> Tape:
    """Four sensors as strange as the simulator knows them."""
    rng, found = generator(number, 0x31DE), list[tuple[int, SimulatedSensor]]()
    for seed in itertools.count(100 * number):
        sensor = any_sensor(rng, 0.8)
        if sensor.rows * sensor.columns <= 120 and sensor.gain < 400 and sensor.rate_hz < 40:
            found.append((seed, sensor))
        if len(found) == 4:
            break
    packets = [
        sent(hands(seed, 40, sensor), Form(f"s{seed}", "ints"), ("10.0.1.1", 6000 + seed)) for seed, sensor in found
    ]
    grids = {f"s{seed}": {"grid": f"{sensor.rows}x{sensor.columns}"} for seed, sensor in found}
    return tape(f"wide {number}", "four strange sensors", *packets, sensors=grids)


def hand() -> list[Tape]:
    """What hands do, kind by kind, on one or two sensors of the usual kind."""
    everything = tuple(NON_GESTURES)
    first, second = everything[: len(everything) // 2], everything[len(everything) // 2 :]

    def two(name: str, about: str, one: Take, other: Take) -> Tape:
        return tape(name, about, sent(one, UINT16), sent(other, Form("leg", "uint16"), LEG, 0.03))

    rested = held(hands(28, 20, kinds=("long_press", "swipe_left", "one_tap")), 2.5, 2.5)  # not yet too long
    lies = held(hands(29, 25, kinds=("object_put_down", "one_tap", "swipe_left")), 2.6, 15.0)
    lifted = held(hands(30, 25, kinds=("palm", "double_tap", "swipe_up")), 2.4, 7.0)
    fast = replace(QUIET, rows=5, columns=5, pitch_mm=14.0, rate_hz=200.0, gain=60.0, jitter_s=0.0005)
    glitches = struck(hands(32, 20, fast, ("one_tap", "swipe_up", "spike", "electrical_burst") * 5))
    bad = replace(QUIET, dead=3, stuck=2, bursts_per_minute=20.0, hum=0.02)
    drifting = replace(QUIET, drift=0.4, slow_noise=0.01)
    clipped = replace(QUIET, clipped=True, dead_zone=0.03, gain=90.0, dtype="uint8", saturation=255)
    return [
        two(
            "taps",
            "taps, double taps and what follows a tap",
            hands(20, 75, kinds=TAPS * 9),
            hands(21, 75, kinds=TAPS * 9),
        ),
        two("gestures", "all gestures, twice", hands(22, 80, kinds=GESTURES * 3), hands(23, 80, kinds=GESTURES * 3)),
        two("others", "what is no gesture", hands(24, 75, kinds=first), hands(25, 75, kinds=second)),
        two("sequences", "a gesture right after another", hands(26, 50, kinds=SEQUENCES * 9), hands(27, 50)),
        tape(
            "touched from the start",
            "a hand lies there when the first frame comes",
            sent(hands(31, 30, lead_s=-0.3), UINT16),
        ),
        tape("rested", "a press that is nearly too long", sent(rested, UINT16)),
        tape(
            "held",
            "an object is left lying, a palm is lifted late",
            sent(lies, UINT16),
            sent(lifted, Form("leg", "uint16"), LEG),
        ),
        tape(
            "glitches",
            "at 200 Hz, contacts too short for a finger",
            sent(glitches, Form("arm", "uint8")),
            grid="5x5",
        ),
        tape("jammed", "taxels that jump up and stand still", sent(jammed(hands(37, 16, kinds=())), UINT16)),
        two(
            "bad taxels",
            "dead and stuck taxels, bursts and hum; much drift",
            hands(33, 50, bad),
            hands(34, 50, drifting),
        ),
        tape(
            "clipped",
            "whole counts without the baseline; the usual sensor at its usual gain",
            sent(hands(35, 50, clipped), Form("arm", "uint8")),
            sent(hands(36, 25, SimulatedSensor.nominal()), Form("leg", "uint16"), LEG, 0.03),
        ),
    ]


def settings() -> list[Tape]:
    """The same packets in scenes that differ in their settings."""
    one, other = hands(40, 60, kinds=TAPS * 9), hands(41, 60, kinds=GESTURES * 3)
    packets = [*sent(one, UINT16), *sent(other, Form("leg", "uint16"), LEG, 0.03)]
    swipes = [g for g in GESTURES if g.startswith("swipe")]
    strict = {g: {"threshold": 0.97 if i % 2 else 0.1, "refractory_s": 0.0} for i, g in enumerate(GESTURES)}
    return [
        tape("all gestures", "as it comes", packets),
        tape("no double tap", "nothing waits for a second tap", packets, gestures=["one_tap", *swipes]),
        tape("one gesture", "all but one are masked", packets, gestures=["swipe_left"]),
        tape("thresholds", "some higher, some lower than the model's own", packets, per_gesture=strict),
        tape(
            "refractory",
            "not again within some seconds",
            packets,
            per_gesture={g: {"refractory_s": 6.0} for g in GESTURES},
        ),
        tape("stale early", "silent after 0.3 s", packets, stale_s=0.3),
        tape("stale late", "silent after 5 s", packets, stale_s=5.0, rest_s=6.0),
        tape("stopped", "the daemon stops in the middle", [p for p in packets if p[0] < 30.7], rest_s=0.0),
        tape(
            "addresses",
            "firmware with addresses of its own",
            [(t, who, _address(data)) for t, who, data in packets if t < 20],
            addresses={"pressure": "/v/{sensor}/raw/x", "trajectory": "/v/{sensor}/fing/x"},
        ),
    ]


def _address(packet: bytes) -> bytes:
    """The same packet with addresses of another firmware, which are as long."""
    for name in (b"arm", b"leg"):
        packet = packet.replace(b"/%s/pressure" % name, b"/v/%s/raw/x" % name + b"\0")
        packet = packet.replace(b"/%s/trajectory" % name, b"/v/%s/fing/x" % name + b"\0\0")
    return packet
