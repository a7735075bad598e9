"""Hours to be judged: simulated days, recordings (.npz) and tapes, each as a stream of frames with its truth."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gestured.client.say import shown
from gestured.core.errors import RecordingError
from gestured.core.frames import Frame
from gestured.core.scene import Setup
from gestured.core.timing import Timing
from gestured.lab.everyday import FIRST
from gestured.record.arrays import read_timed
from gestured.record.check import SESSION
from gestured.record.judge import NONE, UNNAMED, Performed
from gestured.record.replay import frames_used, opened
from gestured.simulator.everyday import day
from gestured.simulator.places import PLACES

HOUR_S = 3600.0
WAKING, WOKEN = "the gesture that arms", "within two seconds after it"
HEARD = f"{WOKEN}, where that one was heard"


@dataclass
class Stretch:
    """One person at one place for a while; times in s on one clock."""

    place: str
    person: str
    frames: Iterable[Frame]
    setup: Setup  # the sensor's; only grid, mounting and zones count
    meant: list[Performed]  # gestures
    taps: list[Performed]  # contacts that nobody meant, but that are taps
    contacts: int | None = None  # contacts that nobody meant; None if only the front end can count them
    tap_gap_s: float = Timing().tap_gap_s
    others: Sequence[Performed] = ()  # non-gestures that were performed, and touches that nobody has named


def lived(seed: int, seconds: float = HOUR_S, wake: str = "") -> Stretch:
    """A simulated day of the person with this seed, at one of the places in turn.

    With `wake` that gesture comes before each meant one; the kinds of both are WAKING and WOKEN.
    """
    life = day(seed, list(PLACES.values())[(seed - FIRST) % len(PLACES)], seconds, wake=wake)
    taps = [Performed(NONE, act.kind, act.onset_s, act.offset_s) for act in life.like]
    meant = [Performed(act.label, lay, act.onset_s, act.offset_s) for act, lay in life.meant]
    if wake:
        meant = [replace(act, kind=(WAKING, WOKEN)[n % 2]) for n, act in enumerate(meant)]
    frames = map(Frame, life.take.times.tolist(), life.take.frames)
    setup = Setup(grid=life.take.frames[0].shape)
    return Stretch(life.place, str(life.person), frames, setup, meant, taps, life.contacts)


def recorded(path: Path, place: str = "") -> Iterator[Stretch]:
    """The streams of a file, whose `place` is its name unless told. A tape does not hold what was performed.

    Raises RecordingError.
    """
    yield from (_arrays if path.suffix == ".npz" else _tape)(path, shown(place or path.stem))


def _arrays(path: Path, place: str) -> Iterator[Stretch]:
    found = read_timed(path)
    events = (found.event_recording, found.event_labels, found.event_onsets, found.event_offsets)
    told = [] if any(field is None for field in events) else list(zip(*events, strict=True))  # type: ignore[arg-type]
    for i, whole in enumerate(found.labels):
        acts = [Performed(str(label), "", float(on), float(off)) for n, label, on, off in told if n == i]
        if whole != SESSION:  # without marks it may have been at any time
            marks = [end if of is None else of[i] for of, end in ((found.onsets, 0), (found.releases, -1))]
            start, end = map(float, found.times_of(i)[marks])
            acts.append(Performed(str(whole), "", start, end))
        meant = [act for act in acts if act.label not in (NONE, UNNAMED)]
        others = [act for act in acts if act.label in (NONE, UNNAMED)]
        setup = Setup(grid=found.frames.shape[1:])
        yield Stretch(place, str(found.subjects[i]), found.stream(i), setup, meant, [], others=others)


def _tape(path: Path, place: str) -> Iterator[Stretch]:
    tape, maker = opened(path)
    used = frames_used(tape, maker.scene)
    if not used:
        raise RecordingError(f"{path}: holds no frames that a daemon could use")
    for name, frames in used.items():
        own = maker.scene.setup(name)
        setup = Setup(maker.scene.grid_of(name), own.mounting, zones=own.zones)
        yield Stretch(f"{place}: {name}", str(path), frames, setup, [], [], tap_gap_s=maker.scene.tap_gap_s)
