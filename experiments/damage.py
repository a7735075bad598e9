"""How often a damaged gesture is wrong, for each fault: `python -m experiments.damage`.

Simulated people (the project's own simulator, nominal sensor, people whom the models have not seen) perform gestures. A
fault damages what the sensor sends, or delays the daemon. The daemon's own backlog and hub take the packets at
prescribed times, so the same seed gives the same numbers on any machine. A gesture is damaged if a packet or frame was
altered during it, or waited while the daemon stood still. An untouched sensor has the same fault for as long: each
gesture on it is false.
"""

import argparse
import heapq
import itertools
import json
import math
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.pages import add_document, tell
from gestured.client.sensor import Form
from gestured.core import messages
from gestured.core.events import Event
from gestured.core.frames import Frame
from gestured.core.hub import Hub
from gestured.daemon import log
from gestured.daemon.asked import scene_of
from gestured.daemon.backlog import Backlog
from gestured.daemon.health import TICK_S
from gestured.daemon.merge import load_settings
from gestured.lab.progress import progress
from gestured.lab.table import Table
from gestured.model.ladder import ladder_for
from gestured.model.shipped import shipped
from gestured.record.judge import Performed, Tally
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session
from tests.hostile.faults import FAULTS, Fault, Stall
from tests.hostile.grammar import violations
from tests.hostile.line import Line

SESSION_S = 120.0
FIRST = 2000  # the first participant; training, calibration and evaluation use none from here on
SOURCE = ("127.0.0.1", 40000)
BEFORE_S, AFTER_S = 0.1, 0.2  # s around a contact whose frames belong to its segment, or decide its end


@dataclass
class Row:
    """The figures of one fault."""

    fault: str
    gestures: int = 0
    damaged: Counter[str] = field(default_factory=Counter)  # by verdict
    others: Counter[str] = field(default_factory=Counter)  # by verdict, of gestures that the fault left alone
    more: int = 0  # gestures published while none was performed
    untouched_minutes: float = 0.0
    untouched: int = 0  # gestures on the untouched sensor
    unended: int = 0  # violations of the events' grammar

    def figures(self) -> dict[str, Any]:
        """The figures that are printed; shares are per cent."""
        damaged, others = self.damaged.total(), self.others.total()
        return {
            "fault": self.fault, "gestures": self.gestures, "damaged": damaged,
            "right": _share(self.damaged["right"], damaged), "wrong": _share(self.damaged["wrong"], damaged),
            "unknown or missed": _share(self.damaged["missed"], damaged),
            "undamaged right": _share(self.others["right"], others),
            "more": self.more, "untouched min": round(self.untouched_minutes), "of nobody": self.untouched,
            "unended": self.unended,
        }  # fmt: skip


def _share(part: int, whole: int) -> float | None:
    return round(100 * part / whole, 1) if whole else None


def take(participant: int, seconds: float = SESSION_S, touched: bool = True) -> Take:
    """A session of somebody, or of nobody, on a healthy sensor."""
    sensor = replace(SimulatedSensor.nominal(day=participant), loss=0.0)
    rng = generator(participant, 0xFA)
    return session(Participant(participant), sensor, rng, seconds, 0.0, kinds=None if touched else [])


class Bench:
    """The daemon's backlog and hub, at prescribed times."""

    def __init__(self, model: str) -> None:
        # The events must not depend on the speed of this machine, so no rung is ever too slow.
        self._ladder = ladder_for(model, [], slow_s=math.inf)
        self._scene = scene_of(load_settings({"model": model}, {})[0], self._ladder)

    def events(
        self,
        arrivals: list[tuple[float, bytes]],
        stalls: Sequence[Stall] = (),
        states: list[tuple[float, str]] | None = None,
    ) -> list[dict[str, Any]]:
        """The daemon's events for (time in s, packet) in order of arrival, as a client's lines.

        The time (s) and the state of each sensor at each tick are appended to `states`.

        In a stall the daemon neither reads packets nor ticks. After each group of packets that waited it ticks again,
        since its loop may do so after any of them.
        """

        def awake(t: float) -> float:
            return next((until for since, until in stalls if since <= t < until), t)

        now, facts = 0.0, []
        hub = Hub(self._scene, self._ladder)
        backlog = Backlog(lambda source: source in hub.owners)
        tick = arrivals[0][0]
        for now, found in itertools.groupby(arrivals, key=lambda arrival: awake(arrival[0])):
            while tick < now:
                if awake(tick) == tick:
                    facts += hub.tick(tick)
                    if states is not None:
                        states += [(tick, reading.state) for reading in hub.readings(tick).values()]
                tick += TICK_S
            times, packets = zip(*found, strict=True)
            backlog.add([(packet, SOURCE) for packet in packets], times)
            while backlog:
                facts += hub.receive(*backlog.group())
                facts += hub.tick(min(now, backlog.oldest))
        facts += hub.flush(now)
        return [json.loads(messages.to_json(fact, 0.0)) for fact in facts if isinstance(fact, Event)]


@dataclass(frozen=True)
class Damaged:
    """What a fault makes of a take."""

    arrivals: list[tuple[float, bytes]]  # (time in s, packet) in order
    stalls: list[Stall]  # of the daemon
    struck: np.ndarray  # (n,) s, times of the frames that were altered, or not served in time
    felt: Callable[[float], float]  # from a time (s) of the take to that of the same moment with the fault


def damage(fault: Fault, healthy: Take, seed: int) -> Damaged:
    """Apply a fault to a take."""
    rng = np.random.default_rng(seed)
    line = Line(fault.line, seed)
    form = Form("arm", plain=not fault.counted)
    whole = {float(t): frame for t, frame in zip(healthy.sensor_times, healthy.frames, strict=True)}
    sound = set()
    waiting: list[tuple[float, int, bytes]] = []
    order = itertools.count()
    stream = fault.apply((healthy.frames, healthy.sensor_times, healthy.counter), rng)
    stalls = fault.stalls(healthy.sensor_times, rng)
    for frame, t, count in zip(*stream, strict=True):
        packet = form.packet(Frame(float(t), frame), int(count), 1.7e9 + t)
        arrivals = line.push(float(t), packet)
        for arrival, what in arrivals:
            heapq.heappush(waiting, (arrival, next(order), what))
        stalled = any(since <= t < until for since, until in stalls)
        if not stalled and arrivals == [(t, packet)] and np.array_equal(whole.get(float(t), ()), frame):
            sound.add(float(t))
    ordered = [heapq.heappop(waiting) for _ in range(len(waiting))]
    moved = stream[1] if len(stream[1]) == len(whole) else healthy.sensor_times
    return Damaged(
        [(t, packet) for t, _, packet in ordered],
        stalls,
        np.array(sorted(whole.keys() - sound)),
        lambda t: float(np.interp(t, healthy.sensor_times, moved)) + fault.line.delay_s,
    )


def measure(name: str, takes: list[Take], idle: list[Take], bench: Bench) -> Row:
    """The figures of one fault on all takes."""
    row, fault = Row(name), FAULTS[name]
    for seed, healthy in enumerate(takes):
        damaged = damage(fault, healthy, seed)
        lines = bench.events(damaged.arrivals, damaged.stalls)
        row.unended += len(violations(lines))
        tally, hit, struck, felt = Tally(), {}, damaged.struck, damaged.felt
        for event in healthy.events:
            performed = Performed(event.label, event.kind, felt(event.onset_s), felt(event.offset_s))
            tally.begin(performed)
            hit[performed] = ((struck > event.onset_s - BEFORE_S) & (struck < event.offset_s + AFTER_S)).any()
        outcomes = [tally.hear(line, line["decided"]) for line in lines if line["type"] in ("gesture", "unknown")]
        for outcome in [*outcomes, *tally.settle(math.inf)]:
            if outcome is None:
                continue
            if outcome.verdict == "false" or outcome.performed is None:
                row.more += 1
                continue
            row.gestures += 1
            (row.damaged if hit[outcome.performed] else row.others)[outcome.verdict] += 1
    for seed, healthy in enumerate(idle):
        damaged = damage(fault, healthy, seed)
        lines = bench.events(damaged.arrivals, damaged.stalls)
        row.unended += len(violations(lines))
        row.untouched += sum(line["type"] == "gesture" for line in lines)
        row.untouched_minutes += float(healthy.sensor_times[-1] - healthy.sensor_times[0]) / 60
    return row


def main() -> int:
    """Print the table; returns 1 if the untouched sensor gave a gesture, or if an onset has no end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", help="path or name (default: cnn_lstm)")
    parser.add_argument("--people", type=int, default=10, help="two minutes each, touched and untouched (default: 10)")
    parser.add_argument("--fault", action="append", choices=tuple(FAULTS), help="only this one; may be repeated")
    add_document(parser, "damage")
    args = parser.parse_args()
    log.configure("error")
    bench = Bench(args.model)
    people = range(FIRST, FIRST + args.people)
    takes, idle = [take(person) for person in people], [take(person, touched=False) for person in people]
    faults = args.fault or list(FAULTS)
    found = [measure(name, takes, idle, bench).figures() for name in progress(faults, len(faults), "faults")]
    rows = [tuple("-" if value is None else str(value) for value in row.values()) for row in found]
    table = Table("Gestures beside a fault", tuple(found[0]), rows)
    tell(table, [shipped().get(args.model, Path(args.model))], "damage", args.document)
    return int(any(figures["of nobody"] or figures["unended"] for figures in found))


if __name__ == "__main__":
    sys.exit(main())
