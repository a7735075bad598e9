"""The segmenter: a state machine of activity that finds which frames belong to one gesture.

Activity is the strongest spot of a frame in units of noise. The cases, and what becomes of them:

    tap          ##..............   one segment, decided after `tap_gap_s` of quiet: a second tap may come
    double tap   ##...##..          one segment of two contacts, decided `release_s` after the second
    tap, swipe   ##...######..      two segments, told apart as soon as the second contact moves
    swipe        ########..         one segment, decided `release_s` after the finger left
    flicker      ###.####..         one contact: a single quiet frame is shorter than `release_s`
    hold         ############...    after `limit_s` cancelled ("held"); nothing more until it is let go
    object       ###############    cancelled as a hold, sooner if it is wide; the baseline learns it: idle again
    on an edge   ....:::##::::      something faint lies there, and a finger comes beside it: a segment of the finger
    silence      ####     ...       cancelled ("silence") after `stale_s` without a frame
    glitch       |                  shorter than any finger at a fast sensor: cancelled ("glitch")

Not handled: two people on one sensor, and a tap that begins while another finger still rests (one contact).

`TRANSITIONS` is its table. For a phase (what is true of the sensor) and a signal (what a frame or the time says), a row
names the phase that follows, what the front end does, and what is remembered. ARCHITECTURE.md shows the same table, and
a test compares them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, auto  # its hash is an integer's; Enum's is a function in Python
from typing import NamedTuple

from gestured.core.activity import hardly_ever, rarely
from gestured.core.contact import ON_SHARE, AfterEffect, Centroid, Stretch
from gestured.core.timing import Timing

FAINT = 4.0  # times `on`: something less active, such as the edge of an arm, may lie on the sensor during a gesture
RISE = 2.5  # times the activity of something faint: a contact that becomes so active is a finger beside it
SWAY = 1.25  # times the activity of something faint: it may grow so far, and the finger still counts as off
TREMBLES = 0.5  # of the way that a tap may move: a contact that was given up and moves further is a finger, not a thing
SPAN_S = 0.15  # the length of a span; the highest activity is remembered of each of the last three spans
OFF_SHARE = 0.12  # of the contact's peak: below this share the finger is off, since textile recovers slowly


class Signal(IntEnum):
    """What a frame, or the time that passed, says."""

    QUIET = auto()
    WEAK = auto()
    STRONG = auto()
    ROSE = auto()  # far more active than what has lain there for a while: a finger beside it
    MOVED = auto()  # the second contact is no tap, so it does not belong to the first
    RELEASED = auto()  # quiet for `release_s`
    TAPPED = auto()  # quiet for `release_s` after one tap, so that a second tap may follow
    GAP_OVER = auto()  # quiet for `tap_gap_s`
    LIMIT = auto()  # `limit_s` after the onset


class Action(IntEnum):
    """What the front end has to do."""

    OPEN = auto()  # a contact begins
    RISE = auto()  # the contact begins anew: what was touched before belongs to something that lies there
    CLOSE = auto()  # the segment is over
    SPLIT = auto()  # the first contact is a segment, the second one begins another
    HELD = auto()  # the contact is given up: no segment is made of it
    LEFT = auto()  # a given-up contact was let go


# --- levels of activity in each phase: a frame is strong from the first on, and quiet below the second


def _untouched(segmenter: "Segmenter", t: float) -> tuple[float, float]:
    """Levels while nobody touches the sensor: a contact has to exceed what the last one has left behind."""
    return segmenter.on + segmenter.after.level(t), segmenter.off


def _touched(segmenter: "Segmenter", t: float) -> tuple[float, float]:
    """Levels of a contact: a finger is off below a share of its own peak, and back above a larger share (hysteresis).

    If something faint lies there as well, the shares are of what the finger adds to that thing's activity.
    """
    under = segmenter.under
    risen = segmenter.after.peak - under
    strong = max(segmenter.on, under + ON_SHARE * risen)
    return strong, min(strong, max(segmenter.off, SWAY * under + OFF_SHARE * risen))


def _given_up(segmenter: "Segmenter", t: float) -> tuple[float, float]:
    """Levels of a contact that was given up: all that reaches `off` counts as touched, so no frame is weak."""
    return segmenter.off, segmenter.off


# --- what the end of a wait says


def _released(segmenter: "Segmenter") -> Signal:
    """The finger was off for `release_s`; after a single tap a second one may follow."""
    waits = segmenter.waits and segmenter.first is None and segmenter.tap_so_far()
    return Signal.TAPPED if waits else Signal.RELEASED


# --- what is remembered of a frame; each function may return a signal that follows from it


def _begin(segmenter: "Segmenter", t: float, activity: float, place: Centroid | None) -> Signal | None:
    """The first contact of a segment begins."""
    segmenter.after.begin()
    segmenter.first = None
    segmenter.rise(t)
    return _press(segmenter, t, activity, place)


def _again(segmenter: "Segmenter", t: float, activity: float, place: Centroid | None) -> Signal | None:
    """The second contact of a segment begins."""
    segmenter.first, segmenter.contact = segmenter.contact, Stretch(t)
    return _press(segmenter, t, activity, place)


def _press(segmenter: "Segmenter", t: float, activity: float, place: Centroid | None) -> Signal | None:
    """Remember a strong frame: its activity, and its centroid."""
    rose = _touch(segmenter, t, activity)
    if place is not None:
        segmenter.contact.follow(place)
    return rose or _moved(segmenter)


def _graze(segmenter: "Segmenter", t: float, activity: float, place: Centroid | None) -> Signal | None:
    """A frame that is pressed weakly."""
    return _touch(segmenter, t, activity) or _moved(segmenter)


def _touch(segmenter: "Segmenter", t: float, activity: float) -> Signal | None:
    rose, lay = None, segmenter.lately(t, activity)
    if segmenter.first is None:
        if segmenter.after.peak < OFF_SHARE * activity:
            segmenter.rise(t)  # what came before was too faint to belong to the contact: a hover, or noise
        elif 0 < lay <= FAINT * segmenter.on and activity >= RISE * lay:
            rose = Signal.ROSE
            segmenter.after.begin()
            segmenter.rise(t, lay)  # a finger beside something faint, such as the edge of an arm that has shifted
    segmenter.after.touch(activity)
    segmenter.contact.touched = t
    segmenter.quiet_since = None
    return rose


def _moved(segmenter: "Segmenter") -> Signal | None:
    return Signal.MOVED if segmenter.first is not None and not segmenter.tap_so_far() else None


def _quiet(segmenter: "Segmenter", t: float, activity: float, place: Centroid | None) -> None:
    """Remember the first quiet frame, from which the waits count."""
    if segmenter.quiet_since is None:
        segmenter.quiet_since = t


def _lie(segmenter: "Segmenter", t: float, activity: float, place: Centroid | None) -> None:
    """What was given up still lies there."""
    segmenter.quiet_since = None
    segmenter.contact.touched = t
    if place is not None:
        segmenter.rests.follow(place)
    if segmenter.rests.widest > TREMBLES * segmenter.travel:
        segmenter.rests = Stretch(t)  # a finger that goes on moving does not lie there


def _part(segmenter: "Segmenter", t: float, activity: float, place: Centroid | None) -> None:
    """The second contact is a segment of its own."""
    segmenter.first = None


# --- the phases and the table


@dataclass(frozen=True, eq=False, slots=True)
class Phase:
    """What is true of the sensor, and how frames and waits are read while it is."""

    name: str
    levels: Callable[["Segmenter", float], tuple[float, float]]  # strong from the first on, quiet below the second
    wait: str = ""  # the name in `Timing` of the seconds of quiet after which time alone decides
    says: Callable[["Segmenter"], Signal] | None = None  # what the end of that wait says
    touched: bool = True  # whether a contact goes on, given up or not
    pending: bool = True  # whether a contact goes on that may still become a segment
    let_go: bool = False  # whether the finger is off, so that the contact can be decided if the stream ends

    def reads(self, segmenter: "Segmenter", t: float, activity: float) -> Signal:
        """What a frame at `t` s says by its activity, in noise units."""
        strong, quiet = self.levels(segmenter, t)
        return Signal.QUIET if activity < quiet else Signal.STRONG if activity >= strong else Signal.WEAK


IDLE = Phase("IDLE", _untouched, touched=False, pending=False)
CONTACT = Phase("CONTACT", _touched)
RELEASING = Phase("RELEASING", _touched, "release_s", _released, let_go=True)
GAP = Phase("GAP", _touched, "tap_gap_s", lambda segmenter: Signal.GAP_OVER, let_go=True)
SPENT = Phase("SPENT", _given_up, "release_s", lambda segmenter: Signal.RELEASED, pending=False)


# What follows when a signal comes in a phase: the next phase, what the front end does, and what is remembered.
Row = tuple[Phase, Action | None, Callable[["Segmenter", float, float, Centroid | None], Signal | None] | None]
S, A = Signal, Action
TRANSITIONS: dict[tuple[Phase, Signal], Row] = {
    (IDLE, S.QUIET): (IDLE, None, None),
    (IDLE, S.WEAK): (IDLE, None, None),
    (IDLE, S.STRONG): (CONTACT, A.OPEN, _begin),
    (CONTACT, S.QUIET): (RELEASING, None, _quiet),
    (CONTACT, S.WEAK): (CONTACT, None, _graze),
    (CONTACT, S.STRONG): (CONTACT, None, _press),
    (CONTACT, S.ROSE): (CONTACT, A.RISE, None),
    (CONTACT, S.MOVED): (CONTACT, A.SPLIT, _part),
    (CONTACT, S.LIMIT): (SPENT, A.HELD, None),
    (RELEASING, S.QUIET): (RELEASING, None, None),
    (RELEASING, S.WEAK): (RELEASING, None, None),
    (RELEASING, S.STRONG): (CONTACT, None, _press),
    (RELEASING, S.RELEASED): (IDLE, A.CLOSE, None),
    (RELEASING, S.TAPPED): (GAP, None, None),
    (RELEASING, S.LIMIT): (SPENT, A.HELD, None),
    (GAP, S.QUIET): (GAP, None, None),
    (GAP, S.WEAK): (GAP, None, None),
    (GAP, S.STRONG): (CONTACT, None, _again),
    (GAP, S.GAP_OVER): (IDLE, A.CLOSE, None),
    (GAP, S.LIMIT): (SPENT, A.HELD, None),
    (SPENT, S.QUIET): (SPENT, None, _quiet),
    (SPENT, S.WEAK): (SPENT, None, _lie),
    (SPENT, S.STRONG): (SPENT, None, _lie),
    (SPENT, S.RELEASED): (IDLE, A.LEFT, None),
}


class Deed(NamedTuple):
    """An action, and the times of the segment that it is about."""

    action: Action
    onset: float  # s
    offset: float  # s, when the segment was touched last
    decided: float  # s


class Segmenter:
    """Activity over time in, deeds out, by `TRANSITIONS`. It knows times and levels, but no frames."""

    def __init__(self, taxels: int, travel: float, *, wait_for_double_tap: bool = True, timing: Timing | None = None):
        """For a sensor of so many `taxels`; `travel`: taxel pitches that a tap may move."""
        self.on = hardly_ever(taxels)  # noise units: activity from which there is a contact
        self.off = rarely(taxels)  # noise units: activity below which there is none
        self.timing, self.travel, self.waits = timing or Timing(), travel, wait_for_double_tap
        self.after = AfterEffect(self.on)  # what the last contact has left behind
        self.reset()

    def reset(self) -> None:
        """Start clean, in IDLE."""
        self.phase: Phase = IDLE
        self.after.clear()
        self.first: Stretch | None = None  # the segment's first contact, if `contact` is its second
        self.quiet_since: float | None = None  # s, the first quiet frame since the last touched one
        self.rise(0.0)

    def rise(self, t: float, under: float = 0.0) -> None:
        """A contact begins at `t` s, above something that lies there with an activity of `under` noise units."""
        self.contact = Stretch(t)  # the contact that goes on, or the last one
        self.rests = Stretch(t)  # how long a contact that was given up has stayed in its place
        self.under = under
        self._span = t  # s, when the latest of the spans began
        self._tops = (0.0, 0.0, 0.0)  # noise units, the highest activity of three spans, the latest last

    def lately(self, t: float, activity: float) -> float:
        """Take a frame at `t` s; return the highest activity of the two spans before this one, 0 without both."""
        older, old, latest = self._tops
        if t - self._span >= SPAN_S:
            older, old, latest, self._span = old, latest, 0.0, t
        self._tops = (older, old, max(latest, activity))
        return max(older, old) if older else 0.0

    def tap_so_far(self) -> bool:
        """Whether the contact is short and stayed where it was."""
        contact = self.contact
        return contact.touched - contact.began <= self.timing.tap_s and contact.widest <= self.travel

    @property
    def onset(self) -> float:
        """When the segment began, in s."""
        return self.contact.began if self.first is None else self.first.began

    @property
    def last_touched(self) -> float:
        """When the last contact was touched last, in s."""
        return self.contact.touched

    def levels(self, t: float) -> tuple[float, float]:
        """Activity from which a frame at `t` s is strong, and below which it is quiet; noise units."""
        return self.phase.levels(self, t)

    def push(self, t: float, activity: float, place: Centroid | None) -> list[Deed]:
        """Take a frame at `t` s, after `wait(t)`; `place`: its centroid (row, column), if it is as active as `off`."""
        if activity < self.off and self.phase is IDLE:
            return []  # what the first row of the table says, without looking it up
        return self._step(self.phase.reads(self, t, activity), t, activity, place)

    @property
    def over(self) -> float | None:
        """When the present wait is over unless the finger comes back, in s; None if there is no wait."""
        since = self.quiet_since
        return since + float(getattr(self.timing, wait)) if since is not None and (wait := self.phase.wait) else None

    def wait(self, t: float, sure: float) -> list[Deed]:
        """What the time alone decides until `t` s. Call it before `push`: a late frame cannot join what is over.

        A wait that was over by `sure` (s), before which no frame can be missing, is decided at its end; else at `t`.
        """
        deeds: list[Deed] = []
        while (says := self.phase.says) is not None and (over := self.over) is not None and t >= over:
            deeds += self._step(says(self), over if over <= sure else t)
        if self.phase.pending and t - self.onset >= self.timing.limit_s:
            deeds += self.give_up(t)
        return deeds

    def give_up(self, t: float) -> list[Deed]:
        """End the contact at `t` s as if `limit_s` were over: it has too many frames, or another clock says so."""
        return self._step(Signal.LIMIT, t) if self.phase.pending else []

    def _step(
        self, signal: Signal | None, t: float, activity: float = 0.0, place: Centroid | None = None
    ) -> list[Deed]:
        deeds: list[Deed] = []
        while signal is not None:
            then, action, remember = TRANSITIONS[self.phase, signal]
            if action is Action.OPEN:
                deeds.append(Deed(action, t, t, t))
            elif action is Action.SPLIT and self.first is not None:
                deeds.append(Deed(action, self.first.began, self.first.touched, t))
            elif action is not None:  # about the segment as it is before this frame is remembered
                deeds.append(Deed(action, self.onset, self.last_touched, t))
            self.phase = then
            signal = None if remember is None else remember(self, t, activity, place)
        return deeds
