"""Behaviour as text: a scenario file is parsed to steps and played to a `FrontEnd`, frame by frame.

One statement a line, in order; `#` begins a comment. A taxel is `ROW,COLUMN` from the top left, a duration
`130ms`, `2s` or `3 frames`, an amplitude a share of the sensor's full scale.

    sensor KEY VALUE ...              grid 9x9, rate 15 (Hz), noise 2, gain 600, baseline 300 (counts),
                                      jitter 0ms, width 0.9 (taxels, of a finger),
                                      waiting yes (for a second tap)
    quiet for D                       frames without a finger
    press R,C A [and R,C A] for D     fingers that stay where they are
    move R,C to R,C A [and ...] in D  fingers that slide
    circle R,C radius X A in D        a finger that goes round once, clockwise
    object R,C A                      something lies there from now on
    clear                             the objects are gone
    drift A in D                      the baseline moves by A, evenly, from now on for so long
    dead R,C                          a taxel that shows nothing from now on
    random R,C BITS                   a taxel that shows anything, of so many bits, from now on
    rubbish BITS for D                all taxels show anything
    ramp A to B in D                  all taxels show A counts, then more or less, and B in the end
    noise N                           the sensor's noise is another one from now on (counts)
    sound                             no taxel is dead or random any more, and the noise is as it was
    lose N                            the next N frames are lost on their way
    silence for D                     time passes without a frame
    shift B                           the baseline is another one from now on (counts)
    restart B                         the same, and the sensor's counter says that it began anew
    end                               the stream ends: flush

    expect X, X ...                   what came since the last `expect`, in order: onset, cut, release,
                                      cancelled REASON, segment (= onset, cut, release), N segments, nothing
    forget                            what came since then depends on chance, and is not looked at
    check X, X ...                    how things are: ready, not ready, touched, not touched, lost N, bad N,
                                      lasting D to D (the last segment, first to last touched frame)
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Frame, Segment
from gestured.core.front_end import Cut, Ended, Found, FrontEnd, Opened, Void

Finger = tuple[float, float, float]  # row, column, amplitude
Fingers = Callable[[float], list[Finger]]  # by the share of a step's time that has passed


@dataclass(frozen=True, slots=True)
class Sensor:
    rows: int = 9
    columns: int = 9
    rate: float = 15.0  # Hz
    noise: float = 2.0  # counts, one standard deviation
    gain: float = 600.0  # counts, full scale
    baseline: float = 300.0  # counts
    jitter: float = 0.0  # s, one standard deviation
    width: float = 0.9  # taxels
    waiting: bool = True


@dataclass(frozen=True, slots=True)
class Step:
    """One line: its number and text, its verb, and what the verb needs."""

    line: int
    text: str
    verb: str
    seconds: float = 0.0
    fingers: Fingers = lambda share: []
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Scenario:
    name: str
    sensor: Sensor
    steps: tuple[Step, ...]


class ScenarioError(Exception):
    """A line that cannot be understood."""


def load(path: Path) -> Scenario:
    """Read a scenario file; raises ScenarioError naming the line."""
    return parse(path.stem, path.read_text())


def parse(name: str, text: str) -> Scenario:
    """Read a scenario; raises ScenarioError naming the line."""
    sensor, steps = Sensor(), []
    for number, line in enumerate(text.splitlines(), 1):
        text = line.split("#")[0].strip()
        if not text:
            continue
        try:
            verb, _, rest = text.partition(" ")
            if verb == "sensor":
                sensor = _sensor(sensor, rest.split())
            else:
                steps.append(_step(number, text, verb, rest, sensor))
        except (ValueError, IndexError, KeyError) as error:
            raise ScenarioError(f"{name}.txt:{number}: {text!r}: {error}") from None
    return Scenario(name, sensor, tuple(steps))


def _sensor(sensor: Sensor, words: list[str]) -> Sensor:
    for key, value in zip(words[::2], words[1::2], strict=True):
        if key == "grid":
            rows, columns = (int(n) for n in value.split("x"))
            sensor = replace(sensor, rows=rows, columns=columns)
        elif key == "waiting":
            sensor = replace(sensor, waiting={"yes": True, "no": False}[value])
        elif key == "jitter":
            sensor = replace(sensor, jitter=_seconds([value], sensor))
        else:
            sensor = replace(sensor, **{key: float(value)})
    return sensor


def _seconds(words: list[str], sensor: Sensor) -> float:
    if len(words) == 2 and words[1] in ("frame", "frames"):
        return int(words[0]) / sensor.rate
    (word,) = words
    return float(word[:-2]) / 1000 if word.endswith("ms") else float(word.removesuffix("s"))


def _point(word: str) -> tuple[float, float]:
    row, column = (float(n) for n in word.split(","))
    return row, column


def _step(number: int, text: str, verb: str, rest: str, sensor: Sensor) -> Step:
    what, _, duration = rest.rpartition(" in " if verb in ("move", "circle", "drift", "ramp") else "for ")
    seconds = _seconds(duration.split(), sensor) if verb in _TIMED else 0.0
    step = Step(number, text, verb, seconds, words=tuple(rest.split()))
    if verb in ("quiet", "silence"):
        return step
    if verb in ("press", "move"):
        return replace(step, fingers=_fingers([part.split() for part in what.split(" and ")], verb == "move"))
    if verb == "circle":
        centre, _, radius, amplitude = what.split()
        return replace(step, fingers=_round(*_point(centre), float(radius), float(amplitude)))
    if verb == "object":
        (row, column), force = _point(step.words[0]), float(step.words[1])
        return replace(step, fingers=lambda share: [(row, column, force)])
    if verb in ("drift", "ramp", "rubbish"):
        return replace(step, words=tuple(what.split()))
    if verb in ("expect", "check"):
        return replace(step, words=tuple(part.strip() for part in rest.split(",")))
    if verb in ("clear", "dead", "random", "noise", "sound", "lose", "shift", "restart", "forget", "end"):
        return step
    raise ValueError(f"unknown verb {verb!r}")


_LASTING = ("quiet", "silence", "press", "move", "circle", "ramp", "rubbish")
_TIMED = (*_LASTING, "drift")  # which goes on beside what lasts


def _fingers(parts: list[list[str]], moving: bool) -> Fingers:
    paths = [(_point(part[0]), _point(part[2] if moving else part[0]), float(part[-1])) for part in parts]

    def at(share: float) -> list[Finger]:
        return [(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), force) for a, b, force in paths]

    return at


def _round(row: float, column: float, radius: float, amplitude: float) -> Fingers:
    def at(share: float) -> list[Finger]:
        angle = 2 * math.pi * share
        return [(row - radius * math.cos(angle), column + radius * math.sin(angle), amplitude)]

    return at


@dataclass
class Player:
    """Plays a scenario. `seed` decides noise, jitter and when the sensor samples within its period.

    Times are multiples of 2**-20 s.
    """

    scenario: Scenario
    seed: int = 0
    events: list[Found] = field(default_factory=list)
    segment: Segment | None = None  # the last one

    def __post_init__(self) -> None:
        sensor = self.scenario.sensor
        self.front_end = FrontEnd(sensor.rows, sensor.columns, wait_for_double_tap=sensor.waiting)
        self._rng = np.random.default_rng(self.seed)
        self._sampling = self._rng.uniform()
        # Taxels differ: in their baseline, and in how much they show.
        shape = sensor.rows, sensor.columns
        self._spread = self._rng.uniform(0.9, 1.1, shape)
        self._gain = sensor.gain * self._rng.uniform(0.9, 1.1, shape)
        self._baseline = sensor.baseline
        self._rising = (0.0, 0.0, 0.0)  # counts, from when, for how long
        self._lying: list[Finger] = []
        self._noise = sensor.noise
        self._dead = np.zeros(shape, dtype=bool)
        self._random: dict[tuple[int, int], int] = {}  # bits
        self._now = 0.0
        self._frame = 0
        self._lose = self._lost = 0

    def play(self) -> list[Found]:
        """Take every statement in order; AssertionError where an expectation is not met.

        Returns the events that no `expect` has asked for.
        """
        for step in self.scenario.steps:
            self._take(step)
        return self.events

    def frames(self, step: Step) -> Iterator[Frame]:
        """What the sensor sends while one step lasts; one that does not last changes what it sends from now on."""
        if step.verb not in _LASTING:
            self._change(step)
            return
        sensor = self.scenario.sensor
        begin, end = self._now, self._now + step.seconds
        while (t := (self._frame + self._sampling) / sensor.rate) < end:
            self._frame += 1
            if step.verb == "silence":
                continue
            if self._lose:
                self._lose -= 1
                self._lost += 1
                continue
            values = self._shown(step, (t - begin) / step.seconds, t)
            late = min(abs(self._rng.normal(0, sensor.jitter)), 0.9 / sensor.rate) if sensor.jitter else 0.0
            yield Frame(_exact(t + late), values, (), self._lost)
            self._lost = 0
        self._now = end

    def _shown(self, step: Step, share: float, t: float) -> NDArray[np.float64]:
        """(R, C) counts at `t` s, when that share of the step's time has passed."""
        values = self._values(step.fingers(share), t)
        if step.verb == "rubbish":
            return self._rng.integers(0, 2 ** int(step.words[0]), values.shape).astype(np.float64)
        if step.verb == "ramp":
            begin, end = float(step.words[0]), float(step.words[2])
            return np.rint(begin + share * (end - begin) + self._rng.normal(0, self._noise, values.shape))
        for at, bits in self._random.items():
            values[at] = self._rng.integers(0, 2**bits)
        return values

    def _values(self, fingers: list[Finger], t: float) -> NDArray[np.float64]:
        """(R, C) counts at `t` s: whole numbers from 0 on, as sensors send them."""
        sensor = self.scenario.sensor
        rows, columns = np.arange(sensor.rows)[:, None], np.arange(sensor.columns)
        pressed = np.zeros((sensor.rows, sensor.columns))
        for row, column, amplitude in [*fingers, *self._lying]:
            distance = (rows - row) ** 2 + (columns - column) ** 2
            pressed = np.maximum(pressed, amplitude * np.exp(-distance / (2 * sensor.width**2)))
        rise, since, lasting = self._rising
        drifted = rise * min(1.0, (t - since) / lasting) if lasting else 0.0
        noise = self._rng.normal(0, self._noise, pressed.shape)
        shown = self._baseline * self._spread + drifted + self._gain * pressed + noise
        return np.where(self._dead, 0.0, np.maximum(np.rint(shown), 0.0))

    def _take(self, step: Step) -> None:
        if step.verb == "expect":
            self._expect(step)
        elif step.verb == "check":
            for word in step.words:
                assert self._holds(word, step), self._says(step, f"{word!r} is not so")
        elif step.verb == "forget":
            self.events = []
        elif step.verb == "end":
            self._note(self.front_end.flush(_exact(self._now)))
        else:
            if step.verb == "restart":
                self._note(self.front_end.reset())
            for frame in self.frames(step):
                self._note(contacts(self.front_end, frame))

    def _change(self, step: Step) -> None:
        words = step.words
        if step.verb == "object":
            self._lying += step.fingers(0.0)
        elif step.verb == "clear":
            self._lying = []
        elif step.verb == "drift":
            self._rising = (float(words[0]) * self.scenario.sensor.gain, self._now, step.seconds)
        elif step.verb == "dead":
            row, column = _point(words[0])
            self._dead[int(row), int(column)] = True
        elif step.verb == "random":
            row, column = _point(words[0])
            self._random[int(row), int(column)] = int(words[1])
        elif step.verb == "noise":
            self._noise = float(words[0])
        elif step.verb == "sound":
            self._dead[:], self._random, self._noise = False, {}, self.scenario.sensor.noise
        elif step.verb == "lose":
            self._lose = int(words[0])
        elif step.verb in ("shift", "restart"):
            self._baseline = float(words[0])

    def _note(self, events: Sequence[Found]) -> None:
        self.events += events
        for event in events:
            if isinstance(event, Cut):
                self.segment = event.segment

    def _expect(self, step: Step) -> None:
        expected: list[str] = []
        for word in step.words:
            many, _, noun = word.partition(" ")
            if word == "segment" or noun == "segments":
                expected += ["onset", "cut", "release"] * (1 if word == "segment" else int(many))
            elif word != "nothing":
                expected.append(word)
        got = [name(event) for event in self.events]
        self.events = []
        assert got == expected, self._says(step, f"found {', '.join(got) or 'nothing'}")

    def _holds(self, word: str, step: Step) -> bool:
        front_end = self.front_end
        state = {"ready": front_end.ready, "touched": front_end.touched}
        noun = word.removeprefix("not ")
        if noun in state:
            return state[noun] == (word == noun)
        key, *values = word.split()
        if key == "bad":
            return front_end.bad_taxels == int(values[0])
        assert self.segment is not None, self._says(step, "no segment yet")
        if key == "lost":
            return self.segment.lost == int(values[0])
        if key == "lasting":
            low, high = (_seconds([value], self.scenario.sensor) for value in (values[0], values[2]))
            return low <= self.segment.offset - self.segment.onset <= high
        raise ScenarioError(self._says(step, f"cannot check {word!r}"))

    def _says(self, step: Step, text: str) -> str:
        where = f"{self.scenario.name}.txt:{step.line}: {step.text!r}"
        return f"{where}: {text} (seed {self.seed}, t {self._now:.3f} s)"


def _exact(t: float) -> float:
    return round(t * 2**20) / 2**20


def name(event: Found) -> str:
    """An event as a scenario writes it."""
    if isinstance(event, Void):
        return f"cancelled {event.reason}"
    return {Opened: "onset", Cut: "cut", Ended: "release"}[type(event)]


def frames(*lines: str, seed: int = 0) -> list[Frame]:
    """What a sensor sends while the lines of a scenario last."""
    player = Player(parse("stream", "\n".join(lines)), seed)
    return [frame for step in player.scenario.steps for frame in player.frames(step)]


def contacts(front_end: FrontEnd, frame: Frame) -> list[Found]:
    """What a frame says of contacts: all that a front end finds in it, but for those that are not over."""
    return [found for found in front_end.push(frame) if not isinstance(found, Segment)]
