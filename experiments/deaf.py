"""How long a sensor is deaf, its gestures unrecognised, after it sent bad frames: `python -m experiments.deaf`.

Simulated people gesture on the nominal sensor, as in `experiments.damage`; for a while, at the start or in the middle,
its frames are replaced by bad ones. The daemon's own backlog and hub take them.
"""

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.damage import FIRST, Bench, damage
from experiments.pages import add_document, tell
from gestured.daemon import log
from gestured.daemon.health import TICK_S
from gestured.lab.progress import progress
from gestured.lab.table import Table
from gestured.model.shipped import shipped
from gestured.record.judge import Performed, Tally
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session
from tests.hostile.faults import Counts, Fault, Frames, Stream, Times

SESSION_S = 100.0
BOOT_S = 1.2  # how long a sensor takes to send what it should
MIDDLE_S = 20.0  # when frames become bad that were good
NOISE = 10.0  # counts, one standard deviation of what the nominal sensor shows from frame to frame
SINCE_S = (0.0, 3.0, 10.0, 20.0, 60.0)  # s since the last bad frame: the columns
Array = NDArray[np.float64]
Shares = Array  # (n,) how much of the bad time has passed, 0..1
Change = Callable[[Array, Shares, np.random.Generator], Array]  # (n, R, C) sound frames -> bad ones


@dataclass(frozen=True)
class Bad:
    """Bad frames, which a sensor sends for a while."""

    begins_s: float
    lasts_s: float
    frames: Change
    stays: bool = False  # the level stays as the last bad frame had it

    def stream(self, frames: Frames, times: Times, counts: Counts, rng: np.random.Generator) -> Stream:
        """The sensor's stream with its bad frames."""
        share = (times - times[0] - self.begins_s) / self.lasts_s
        bad = (share >= 0) & (share < 1)
        sent = frames.astype(np.float64)
        sent[bad] = self.frames(sent[bad], share[bad], rng)
        if self.stays:
            sent[share >= 1] += np.median(sent[bad][-1] - frames[bad][-1])
        return sent.astype(np.float32), times, counts


def _random(bits: int) -> Change:
    return lambda sound, share, rng: rng.integers(0, 2**bits, sound.shape).astype(np.float64)


def _ramp(sound: Array, share: Shares, rng: np.random.Generator) -> Array:
    return 1000.0 * share[:, None, None] + rng.normal(0, NOISE, sound.shape)


def _rise(sound: Array, share: Shares, rng: np.random.Generator) -> Array:
    return sound + 1e6 * share[:, None, None]


def _noise(sound: Array, share: Shares, rng: np.random.Generator) -> Array:
    return sound + rng.normal(0, 50 * NOISE, sound.shape)


def _taxel(sound: Array, share: Shares, rng: np.random.Generator) -> Array:
    sound = sound.copy()
    sound[:, rng.integers(9), rng.integers(9)] = rng.integers(0, 2**16, len(sound))
    return sound


BAD = {
    "none": Bad(0.0, BOOT_S, lambda sound, share, rng: sound),
    "start: a ramp from 0 to 1000": Bad(0.0, BOOT_S, _ramp),
    "start: 8 random bits": Bad(0.0, BOOT_S, _random(8)),
    "start: 12 random bits": Bad(0.0, BOOT_S, _random(12)),
    "start: 16 random bits": Bad(0.0, BOOT_S, _random(16)),
    "start: 16 random bits for 6 s": Bad(0.0, 6.0, _random(16)),
    "12 random bits for 4 s": Bad(MIDDLE_S, 4.0, _random(12)),
    "16 random bits for 4 s": Bad(MIDDLE_S, 4.0, _random(16)),
    "16 random bits for 15 s": Bad(MIDDLE_S, 15.0, _random(16)),
    "50 times its noise for 25 s": Bad(MIDDLE_S, 25.0, _noise),
    "a rise by 1e6 in 20 s, and back": Bad(MIDDLE_S, 20.0, _rise),
    "a rise by 1e6 in 20 s, for good": Bad(MIDDLE_S, 20.0, _rise, stays=True),
    "one taxel at random for 4 s": Bad(MIDDLE_S, 4.0, _taxel),
    "one taxel at random for 25 s": Bad(MIDDLE_S, 25.0, _taxel),
}


def take(person: int) -> Take:
    """A session of somebody on a healthy sensor."""
    sensor = replace(SimulatedSensor.nominal(day=person), loss=0.0)
    return session(Participant(person), sensor, generator(person, 0xDE), SESSION_S, 0.0)


@dataclass
class Heard:
    """What became of a take's gestures, and the states of its sensor."""

    gestures: list[tuple[float, bool]]  # onset (s), and whether the answer was right
    more: int  # gestures published while none was performed
    states: list[tuple[float, str]]  # of the sensor, at each tick (s)

    def first(self, after: float) -> float:
        """The onset (s) of the first gesture from `after` s on that is answered rightly; infinite if there is none."""
        return next((t for t, right in self.gestures if right and t >= after), math.inf)


def hear(healthy: Take, bad: Bad, seed: int, bench: Bench) -> Heard:
    """Play one take, with bad frames."""
    heard, tally = Heard([], 0, []), Tally()
    for event in healthy.events:
        tally.begin(Performed(event.label, event.kind, event.onset_s, event.offset_s))
    arrivals = damage(Fault(sensor=bad.stream), healthy, seed).arrivals
    said = [line for line in bench.events(arrivals, states=heard.states) if line["type"] == "gesture"]
    for outcome in [*(tally.hear(line, line["decided"]) for line in said), *tally.settle(math.inf)]:
        if outcome is None or outcome.verdict == "false" or outcome.performed is None:
            heard.more += 1
        else:
            heard.gestures.append((outcome.performed.onset, outcome.verdict == "right"))
    heard.gestures.sort()
    return heard


def figures(name: str, takes: list[Take], sound: list[Heard], bench: Bench) -> dict[str, Any]:
    """The row of one kind of bad frames, against the same takes without any (`sound`)."""
    bad, deaf, ok, more = BAD[name], list[float](), list[float](), 0
    right = {since: list[bool]() for since in (-math.inf, *SINCE_S)}  # by seconds since the last bad frame
    for seed, healthy in enumerate(takes):
        begins = float(healthy.sensor_times[0]) + bad.begins_s
        over = begins + bad.lasts_s
        heard = hear(healthy, bad, seed, bench)
        deaf.append(heard.first(over) - sound[seed].first(over))
        ok.append(TICK_S * sum(state == "ok" for t, state in heard.states if begins <= t < heard.first(over)))
        more += heard.more
        for t, rightly in heard.gestures:
            if t >= begins:
                right[max(since for since in right if t - over >= since)].append(rightly)
    names = ("right meanwhile", *(f"{a:.0f} to {b:.0f} s" for a, b in zip(SINCE_S, SINCE_S[1:], strict=False)))
    shares = [f"{100 * np.mean(some):.0f}" if some else "-" for some in right.values()]
    return {
        "bad frames": name, "deaf s": f"{median(deaf):.1f}", "at most": f"{max(deaf):.1f}", "ok s": f"{max(ok):.1f}",
        **dict(zip(names, shares, strict=False)), "more": more,
    }  # fmt: skip


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", type=int, default=10, help="100 seconds each (default: 10)")
    add_document(parser, "deaf")
    parser.add_argument("--bad", action="append", choices=tuple(BAD), help="only these frames; may be repeated")
    args = parser.parse_args()
    log.configure("error")
    bench = Bench("cnn_lstm")
    takes = [take(person) for person in range(FIRST, FIRST + args.people)]
    sound = [hear(healthy, BAD["none"], seed, bench) for seed, healthy in enumerate(takes)]
    rows = [
        figures(name, takes, sound, bench) for name in progress(args.bad or BAD, len(args.bad or BAD), "bad frames")
    ]
    table = Table("Seconds until a sensor hears again", tuple(rows[0]), [tuple(row.values()) for row in rows])
    tell(table, [shipped()["cnn_lstm"]], "deaf", args.document)
    return 0


if __name__ == "__main__":
    sys.exit(main())
