"""What models say of a stretch whose frames pass through the daemon's own path."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from gestured.core.events import Gesture, Onset, Provisional, Unknown
from gestured.core.facts import Decided
from gestured.core.front_end import FrontEnd
from gestured.core.listening import Arming
from gestured.core.points import Strictness
from gestured.core.scene import DOUBLE_TAP, ONE_TAP, Scene
from gestured.core.segmenter import SPENT
from gestured.core.sensor import ABSENT_S, Sensor, Told
from gestured.lab.everyday.stretches import HOUR_S, Stretch
from gestured.model.model import Model
from gestured.record.judge import Performed, Said, whose

TAPS = (ONE_TAP, DOUBLE_TAP)
LONGEST_STEP_S = 1.0  # from frame to frame that counts as heard or deaf; in a longer one the sensor was silent
ASIDE_S = 0.2  # beyond the judge's tolerance: nothing within half a second of what nobody can name is counted
NOT_READY, RESTARTING, HELD = "not ready", "restarting", "spent"  # in what a sensor is deaf


@dataclass
class Heard:
    """What was said of one stretch, by each model, and whether the sensor could hear at all."""

    place: str
    person: str
    contacts: int
    meant: list[Performed]
    said: dict[str, list[Said]]  # by model, each at any confidence; of a contact that may be published at all
    seconds: float = 0.0  # a sensor that was silent for longer than ABSENT_S was not there
    deaf_s: dict[str, float] = field(default_factory=dict)
    provisional: int = 0  # events of the first model where nothing was meant

    @property
    def hours(self) -> float:
        """How long it took."""
        return self.seconds / HOUR_S


def hear(
    life: Stretch,
    models: Sequence[Model],
    strictness: Strictness,
    arming: Arming | None = None,
    *,
    published: bool = False,
) -> Heard:
    """Play a stretch to the first model, at its operating point, and show what was cut to the others, too.

    With `arming` a gesture arms the sensor. Then, and with `published`, only what is published there is said.
    """
    first, published = models[0], published or arming is not None
    scene = Scene(
        first.gestures, (9, 9), {"lab": life.setup}, strictness=strictness, tap_gap_s=life.tap_gap_s, arming=arming
    )
    sensor = Sensor("lab", scene, first)
    sensor.foresee(asked=True)
    meant = [act for act in life.meant if act.label in first.gestures]
    heard = Heard(life.place, life.person, 0, meant, {model.name: [] for model in models})
    began: float | None = None
    last, absent_s, known, onsets = 0.0, 0.0, False, 0
    for frame in life.frames:
        began, last = (frame.t, frame.t) if began is None else (began, last)
        told = sensor.push(frame)
        known = known or sensor.front_end.ready
        why = _deaf(sensor.front_end, known=known)
        if why:
            heard.deaf_s[why] = heard.deaf_s.get(why, 0.0) + min(frame.t - last, LONGEST_STEP_S)
        absent_s += max(frame.t - last - ABSENT_S, 0.0)
        last = frame.t
        onsets += sum(isinstance(one, Onset) for one in told)
        _take(heard, told, life, models, published=published)
    _take(heard, sensor.flush(last + 5.0), life, models, published=published)
    heard.seconds = last - (last if began is None else began) - absent_s
    heard.contacts = max(onsets - len(meant), 0) if life.contacts is None else life.contacts
    return heard


def _deaf(front_end: FrontEnd, *, known: bool) -> str:
    """Why no gesture can begin now, empty where one can. `known`: the idle sensor has been known before."""
    if front_end.segmenter.phase is SPENT:
        return HELD
    if not front_end.ready:
        return RESTARTING if known else NOT_READY
    return RESTARTING if front_end.look is not None and front_end.look.shifted else ""


def _take(heard: Heard, told: Iterable[Told], life: Stretch, models: Sequence[Model], *, published: bool) -> None:
    answer: Gesture | Unknown | None = None
    for one in told:
        if isinstance(one, Provisional):
            heard.provisional += _whose(one.gesture, one.onset, one.decided, heard.meant, life.taps) is None
        elif isinstance(one, Gesture | Unknown):
            answer = one
        elif isinstance(one, Decided) and not (isinstance(answer, Unknown) and (published or answer.reason == "hole")):
            for model in models:
                scores = one.scores if model is models[0] else model.classify(one.segment)
                name = model.gestures[int(scores.values.argmax())]
                act = _whose(name, one.segment.onset, one.segment.offset, heard.meant, life.taps)
                if act is None and whose(one.segment.onset - ASIDE_S, one.segment.offset + ASIDE_S, life.unnamed):
                    continue
                heard.said[model.name].append(Said(name, scores.confidence, act))


def _whose(
    gesture: str, onset: float, offset: float, meant: list[Performed], taps: list[Performed]
) -> Performed | None:
    """The gesture that was meant then; where none was, the tap in truth, if a tap is said."""
    return whose(onset, offset, meant) or (whose(onset, offset, taps) if gesture in TAPS else None)
