"""Golden tapes of how packets come: counters, time tags, senders, and the daemon's own stalls."""

import itertools
import random
from collections.abc import Callable
from dataclasses import replace

from gestured.client.sensor import Form
from tests import encoding
from tests.golden.making import ARM, LEG, QUIET, UINT16, Sent, damaged, hands, moment, sent, tape
from tests.golden.tape import Tape
from tests.hostile.faults import Fault
from tests.hostile.line import Impairment


def counters() -> list[Tape]:
    """The sensor's own counter: it wraps around, frames are doubled, late or lost, it begins anew."""
    take = hands(60, 40)
    lossy = replace(QUIET, loss=0.03, duplicates=0.05, late=0.05)
    rough = sent(hands(61, 40, lossy), UINT16)
    wrap = sent(take, UINT16, counter=lambda n: (n + 2**31 - 300 + 2**31) % 2**32 - 2**31)
    again = sent(take, UINT16, counter=lambda n: n if n < 250 else n - 250)
    leaps = sent(take, UINT16, counter=lambda n: n + 20_000 * (n // 200))
    stands = sent(take, UINT16, counter=lambda n: min(n, 300))
    swapped = [packet for pair in itertools.zip_longest(rough[::2], rough[1::2]) for packet in reversed(pair) if packet]
    pairs = [(min(rough[i // 2 * 2][0] + 0.1, rough[-1][0]), who, data) for i, (_, who, data) in enumerate(swapped)]
    return [
        tape("lost, doubled, late", "the sensor's own link is bad", rough),
        tape("wraps around", "from the largest int32 to the smallest", wrap),
        tape("begins anew", "the sensor has restarted", again),
        tape("leaps", "forward by 20 000 every now and then", leaps),
        tape("stands still", "all frames are duplicates of one", stands),
        tape("in pairs, swapped", "two frames at a time, the later one first", pairs),
    ]


def clock_sensor() -> list[Tape]:
    """Stamps by the sensors' time tags, good and bad."""
    take, rng = hands(65, 40), random.Random(65)
    jittery = Fault(Impairment(jitter_s=0.2, loss=0.02))

    def of(name: str, about: str, tag: Callable[[int, float], float]) -> Tape:
        return tape(name, about, sent(take, UINT16, tag=tag), clock="sensor")

    plain = sent(take, replace(UINT16, plain=True))
    mixed = [p if i % 3 else q for i, (p, q) in enumerate(zip(plain, sent(take, UINT16), strict=True))]
    bundles = [
        (group[-1][0], ARM, encoding.bundle([data for _, _, data in group], moment(group[-1][0])))
        for group in (plain[i : i + 3] for i in range(0, len(plain), 3))
    ]
    return [
        of("good tags", "what they are meant to be", lambda n, t: moment(t)),
        tape("good tags, bad way", "jitter of 0.2 s", damaged(jittery, take, UINT16, 3), clock="sensor"),
        of("fast clock", "the sensor's clock runs a tenth too fast", lambda n, t: moment(1.1 * t)),
        of("slow clock", "the sensor's clock runs a tenth too slow", lambda n, t: moment(0.9 * t)),
        of("clock jumps", "by minutes, forward and back", lambda n, t: moment(t + 300 * (n // 120 % 3))),
        of("clock steps", "by seconds, forward and back", lambda n, t: moment(t + 4 * (n // 100 % 4))),
        of("clock stands", "the same tag for ever", lambda n, t: moment(0.0)),
        of("clock goes back", "each tag earlier than the one before", lambda n, t: moment(1000.0 - t)),
        of("coarse clock", "whole tenths of a second", lambda n, t: moment(int(10 * t) / 10)),
        of("random tags", "within ten seconds", lambda n, t: moment(rng.uniform(0, 10))),
        tape("no tags", "frames without a bundle", plain, clock="sensor"),
        tape("tags now and then", "every third frame has none", mixed, clock="sensor"),
        tape("three in a bundle", "one time tag for three frames", bundles, clock="sensor"),
        tape(
            "a clock each",
            "one sensor by its tags, one by arrival",
            sent(take, UINT16, tag=lambda n, t: moment(1.05 * t)),
            sent(hands(66, 40), Form("leg", "uint16"), LEG, tag=lambda n, t: moment(2 * t)),
            sensors={"leg": {"clock": "arrival"}},
            clock="sensor",
        ),
    ]


def sources() -> list[Tape]:
    """Who may feed a sensor."""
    take, other = hands(70, 40), hands(71, 40)
    owner, moved = sent(take, UINT16), ("10.0.0.1", 6001)
    stranger = sent(other, UINT16, ("10.0.0.9", 5009), 0.02)
    gap = [p for p in owner if not 15 <= p[0] < 17.5]
    return [
        tape("second source", "two hosts under one name from the start", owner, stranger),
        tape("second source, later", "a stranger joins in for a while", owner, [p for p in stranger if 10 < p[0] < 25]),
        tape(
            "handed over",
            "silence, then somebody else",
            [p for p in owner if p[0] < 15],
            [p for p in stranger if p[0] > 18],
        ),
        tape("taken over", "the owner returns to find somebody else there", gap, [p for p in stranger if p[0] > 12]),
        tape(
            "changes its port",
            "a sensor that begins anew at once, from another port",
            [p if p[0] < 20 else (p[0], moved, p[2]) for p in owner],
        ),
        tape(
            "allowed",
            "only one network may send",
            owner,
            sent(other, Form("leg", "uint16"), ("192.168.7.3", 5), 0.01),
            sent(other, Form("back", "uint16"), ("::ffff:10.0.0.3", 5), 0.02),
            allow=["10.0.0.0/8", "fd00::/8"],
        ),
    ]


def one_shot() -> list[Tape]:
    """A new port for each packet, as command line tools have it."""
    take, other = hands(72, 30), hands(73, 30)
    ports = itertools.count(20_000)
    each = [(t, ("10.0.0.1", next(ports)), data) for t, _, data in sent(take, UINT16)]
    tool = [(t, ("10.0.0.1", next(ports)), data) for t, _, data in sent(other, UINT16, ARM, 0.03)[::40]]
    far = [(t, ("10.0.0.7", next(ports)), data) for t, _, data in sent(other, UINT16, ARM, 0.03)]
    twice = [(t, ("10.0.0.1", 20_000 + i // 2), data) for i, (t, _, data) in enumerate(each)]
    both = [*sent(take, UINT16), *sent(other, UINT16, ("10.0.0.1", 6001), 0.03)]
    return [
        tape("one-shot", "every packet from a port of its own", each),
        tape("one-shot, and a stranger", "and another host does the same", each, far[100:200]),
        tape("one-shot beside an owner", "a tool on the sensor's host", sent(take, UINT16), tool),
        tape("two one-shots", "two tools of one host under one name", each, tool),
        tape("two packets a port", "a new port for every second packet", twice),
        tape("two of one host", "two programs of one host under one name, each with a port of its own", both),
        tape("owner after one-shot", "a packet of a tool, then the sensor", tool[:1], sent(take, UINT16, ARM, 0.1)),
    ]


def places() -> list[Tape]:
    """More sensors than there are places, and whose place is free."""
    takes = [hands(75 + n, 12) for n in range(3)]
    nobody = hands(79, 12, kinds=())
    coming: list[Sent] = []
    for n in range(8):  # one every 12 s; every other one makes no gesture, and its place is free a minute later
        take = nobody if n % 2 else takes[n // 2 % 3]
        coming += sent(take, Form(f"s{n}", "uint16"), ("10.0.0.1", 6000 + n), 12.0 * n)
    again = [*coming, *sent(takes[0], Form("s0", "uint16"), ("10.0.0.1", 6000), 110.0)]
    at_once = [sent(takes[n % 3], Form(f"s{n}", "uint16"), ("10.0.0.1", 6000 + n), 0.01 * n) for n in range(6)]
    named = {"sensors": {"s4": {}, "s5": {"rotate": 90}}}
    return [
        tape("six at once", "three places", *at_once, max_sensors=3),
        tape("six at once, two expected", "places of those in the file are kept", *at_once, max_sensors=3, **named),
        tape("one after the other", "four places; who made no gesture and is silent gives way", again, max_sensors=4),
    ]


def stalls() -> list[Tape]:
    """The daemon's loop stands still, and finds fewer packets waiting than it takes in one go."""
    arm, leg = sent(hands(80, 40), UINT16), sent(hands(81, 40), Form("leg", "uint16"), LEG)
    rapid = replace(QUIET, rows=4, columns=4, pitch_mm=18.0, rate_hz=100.0, gain=60.0)
    fast = sent(hands(82, 20, rapid), Form("fast", "uint8"), ("10.0.0.3", 5003), 1.0)
    plain = sent(hands(80, 40), replace(UINT16, plain=True))
    short = [(t, t + 0.4) for t in (4.0, 9.3, 13.1, 17.7, 22.2, 30.5)]
    long = [(5.0, 6.5), (12.0, 14.1), (25.0, 33.0)]
    grid = {"fast": {"grid": "4x4"}}
    return [
        tape("short stalls", "0.4 s now and then", arm, leg, fast, stalls=short, sensors=grid),
        tape(
            "short stalls, sensor's clock",
            "the same, by time tags",
            arm,
            leg,
            fast,
            stalls=short,
            sensors=grid,
            clock="sensor",
        ),
        tape("short stalls, no counter", "nor time tags", plain, stalls=short),
        tape("stalls", "longer than a sensor may be silent", arm, leg, stalls=long),
        tape(
            "the first second at once",
            "a sensor of which 30 packets wait when it is first heard",
            arm,
            stalls=[(0.0, 2.0)],
        ),
    ]


def stalls_long() -> list[Tape]:
    """More packets wait than are taken in one go."""
    rapid = replace(QUIET, rows=4, columns=4, pitch_mm=18.0, rate_hz=500.0, gain=60.0, jitter_s=0.0003)
    fast = sent(hands(83, 20, rapid), Form("fast", "uint8"), LEG)
    arm = sent(hands(84, 40), UINT16)
    grid = {"fast": {"grid": "4x4"}}
    return [
        tape(
            "a second at 500 Hz",
            "about 500 packets wait",
            arm,
            fast,
            stalls=[(4.0, 5.1), (9.0, 10.1), (14.0, 14.9)],
            sensors=grid,
        ),
        tape("eight seconds at 500 Hz", "about 4000 packets wait", arm, fast, stalls=[(5.0, 13.0)], sensors=grid),
        tape("half a minute at 15 Hz", "about 450 packets wait", arm, stalls=[(5.0, 36.0)]),
        tape(
            "a second at 500 Hz, sensor's clock",
            "by time tags",
            fast,
            stalls=[(4.0, 5.1), (9.0, 10.1)],
            sensors=grid,
            clock="sensor",
        ),
    ]
