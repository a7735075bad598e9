"""One sensor: its frames in, its events out.

`t` is seconds on the stream's clock, by which everything is decided; `now` is seconds on the hub's clock, by which
frames arrive. A caller without arrivals (`gestured.open`, the lab) uses only `push`, `wait`, `flush`, `reset`, `gate`
and `due`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from gestured.core.beside.foresight import Foresight, Preview
from gestured.core.beside.habits import Habits
from gestured.core.beside.reading import Reading, Vitals, view_of
from gestured.core.beside.touch import Fingers
from gestured.core.classifier import Classifier, Scores
from gestured.core.cutter import bearable_s
from gestured.core.decision import Decision
from gestured.core.errors import ModelError
from gestured.core.events import ANSWERS, Cancelled, Event, Gate, Gesture, Onset, Release, Unknown, Where
from gestured.core.facts import Arrived, Changed, Decided, Fact, Fault, Taken
from gestured.core.frames import UNDISTURBED, Frame, Segment
from gestured.core.front_end import Cut, Ended, Found, FrontEnd, Opened
from gestured.core.listening import INHIBITED, Listening
from gestured.core.owner import Owner, Source
from gestured.core.scene import Scene
from gestured.core.stamping import Stamper
from gestured.core.timing import outside
from gestured.core.where import where
from gestured.core.wire import Arrival

ABSENT_S = 60.0  # s of silence, after which a sensor that sends only while it is touched counts as stale
HELD_S = 60.0  # s on the hub's clock; a contact that lasts longer is given up, whatever the sensor's own clock says
NOBODY: Source = ("", 0)  # the source of a sensor that is in no hub

Told = Event | Decided

_new = tuple.__new__  # Arrived(...) takes twice the time


class Sensor:
    """One sensor of a scene. `classifier` may be replaced between two frames.

    The classifier is asked while the segmenter still waits to see whether the finger stays off, so that its answer is
    there when the wait is over. If the finger comes back, that answer is thrown away. If somebody asks for provisional
    events, the classifier is also asked about contacts that are not over; no answer depends on that.
    """

    def __init__(
        self,
        name: str,
        scene: Scene,
        classifier: Classifier,
        source: Source = NOBODY,
        numbers: tuple[int, int] = (0, 0),
    ) -> None:
        """A sensor that was not heard yet. `numbers`: the last sequence and id that a sensor of this name has used."""
        self.name, self.classifier = name, classifier
        self.owner = Owner(source)
        self.silent = False  # whether the stream has ended or paused, and was flushed
        self.sequence, self.segments = numbers
        self.front_end = _front_end(name, scene)
        self._scene, self._decision = scene, Decision(scene, name)
        self._zones, self._listening = scene.setup(name).zones, Listening(scene.arming_of(name))
        self.stamper = Stamper(scene.clock_of(name))
        # The classifier and the segment of the last question, and its answers.
        self._asked: tuple[Classifier, Segment, Scores | None, Where] | None = None
        self._alone: tuple[Classifier, Segment, Scores | None] | None = None  # as `_asked`, without the past
        self.shown: Segment | None = None  # the segment that `ask` is to ask about
        self._foresight = Foresight(name, taps=scene.provisional_taps)
        self._fingers = Fingers(name, scene.setup(name).zones)
        # Whether runs of the model wait: those for provisional events until `look`; those for answers until `ask` or
        # until the answer is due, unless somebody asks for provisional events.
        self._later = False
        self.habits, self.vitals = Habits(*self.front_end.grid_sent), Vitals()
        self._square = self.front_end.rows == self.front_end.columns  # if so, idle frames tell `habits` nothing
        self._fresh = True  # whether no frame was used since the sensor came or restarted
        self._open: int | None = None  # id of the contact that was not released yet
        self._answered = True  # whether that contact has its answer
        self._since = 0.0  # s, on the hub's clock: when the frame that opened it arrived
        self._lost = 0  # frames that went missing so far
        self._lost_at: float | None = None  # s, on the hub's clock: when the last of them went missing

    # --- by the stream's time

    def push(self, frame: Frame) -> list[Told]:
        """Take one frame and return the events that it decides; see `FrontEnd.push`."""
        front_end, foresight = self.front_end, self._foresight
        told = self._late(frame.t) if foresight.asked else []
        if self._listening.armed:
            told += self.lapse(frame.t)
        found = front_end.push(frame)
        if found:
            told += self._tell(found)
        if foresight.asked and front_end.segmenter.phase.pending:
            last = found[-1] if found else None
            if isinstance(last, Segment):
                told += self._foresee(foresight.preview(front_end, last, frame.t, drafted=True))
            foresight.see(front_end, frame.t)
            told += self._at_once()
        if self._fingers.asked and self.front_end.touched and not self._listening.silences(front_end.segmenter.onset):
            told += self._fingers.see(front_end)
        if not self._square or ((look := front_end.look) is not None and look.burst):
            self.habits.see(front_end)
        return told

    @property
    def due(self) -> float | None:
        """When `wait` will have something to say unless a frame comes before, in s; None if nothing waits."""
        off = self._foresight.due(self.front_end)  # it comes before the end of the wait of the segmenter
        if off is None:
            return self.front_end.due
        return off if off <= self.front_end.pace.sure else None

    def wait(self, t: float) -> list[Told]:
        """No frame has come until `t` s: a contact may be over; see `FrontEnd.wait`."""
        return self._late(t) + self._tell(self.front_end.wait(t))

    def flush(self, t: float) -> list[Told]:
        """The stream paused or ended at `t` s: decide what can be decided, and cancel the rest."""
        return self._late(t) + self._tell(self.front_end.flush(t))

    def reset(self) -> list[Told]:
        """The sensor restarted: cancel the open contact, and learn the idle sensor anew."""
        self.habits.clear()
        return self._tell(self.front_end.reset())

    def lapse(self, t: float) -> list[Told]:
        """The `Gate` event if the sensor has ceased to be armed by `t` s."""
        onset = self.front_end.segmenter.onset if self.front_end.segmenter.phase.pending else None
        return [self._gate(t)] if self._listening.lapse(t, onset) else []

    def gate(self, closed: Mapping[str, float], t: float, past: float | None = None) -> list[Told]:
        """Close these gates at `t` s and open all others; `closed`: by name, when it opens by itself (hub's clock, s).

        A contact that began by `past` (s, by default `t`) counts as begun before that.
        """
        told = [*(self._fingers.end() if closed else ()), *self.wait(t)]
        return [*told, self._gate(t)] if self._listening.gate(closed, t if past is None else past) else told

    def _gate(self, t: float) -> Gate:
        """The event that says what the sensor listens to since `t` s; the times in it are on the hub's clock."""
        when = self.stamper.when
        return self._listening.told(self.name, when(t), when(self._listening.armed_until))

    def _tell(self, found: Sequence[Found]) -> list[Told]:
        """The events of what the front end has found, with the sensor's name and ids."""
        told: list[Told] = []
        for one in found:
            if isinstance(one, Segment):
                self.shown = one
                if self._foresight.asked or not self._later:
                    self.ask()
                continue
            self.habits.hear(one)
            if isinstance(one, Opened):
                self.segments += 1
                self._foresight.begin(self.segments)
                self._fingers.begin(self.segments)
                told.append(Onset(self.name, self.segments, one.onset))
            elif isinstance(one, Ended):
                told[:0] = self._fingers.end(self.front_end.baseline)  # the fingers' `up` comes before the release
                told.append(Release(self.name, self.segments, one.offset))
            elif isinstance(one, Cut):
                told += self._decide(one)
                self._asked = self._alone = self.shown = None
            else:
                told.append(self._cancelled(one.reason))
        return told

    def ask(self) -> list[Told]:
        """Ask the classifier about the segment that was shown. No events follow before the answer is due."""
        segment, self.shown = self.shown, None
        if segment is not None:
            answer, at = self._ask(segment)
            if answer is not None:
                scores, best, confidence, least = self._best(segment, answer, at)
                if confidence < least:
                    self._doubt(segment, scores[best], least)
        return []

    def _ask(self, segment: Segment) -> tuple[Scores | None, Where]:
        """The classifier's scores of a segment, None if it fails, and where the segment was; found out only once."""
        asked = self._asked
        if asked is None or asked[0] is not self.classifier or asked[1] is not segment:
            try:
                scores = self.classifier.classify(segment)
            except ModelError:
                scores = None
            asked = self._asked = self.classifier, segment, scores, where(segment, self._zones)
        return asked[2:]

    def _best(self, segment: Segment, answer: Scores, at: Where) -> tuple[dict[str, float], str, float, float]:
        """The scores of gestures in use, the best gesture, its confidence, and the confidence that it needs."""
        scores, best, confidence = self._decision.best(self.classifier.gestures, answer, at.zone)
        armed = segment.onset <= self._listening.armed_until
        return scores, best, confidence, self._decision.threshold(best, answer, armed=armed)

    def _decide(self, cut: Cut) -> list[Told]:
        """The answer to a segment, and `Decided` if a classifier gave scores."""
        name, segment, decision, listening = self.name, cut.segment, self._decision, self._listening
        answer, at = self._ask(segment)
        if answer is None:
            return [self._cancelled("model")]
        scores, best, confidence, least = self._best(segment, answer, at)
        seen = cut.hole_s <= bearable_s(self.front_end.pace.interval_s)
        known = seen and decision.may(best, at.zone) and confidence >= least
        decided = Decided(name, segment, answer, known)
        own = answer.own if seen and decision.is_own(answer.own, at.zone, known=known) else None
        if own is not None:
            best, confidence = own.name, own.confidence
        what = (
            segment.onset, segment.offset, cut.decided, segment.last - segment.first + 1, segment.lost,
            answer.model, answer.degraded, scores,
        )  # fmt: skip
        recognised = best if known or own is not None else None
        why = listening.refusal(segment.onset, recognised)
        if why is None and recognised is None:
            # At a rate that the model does not know, holes and low confidence follow from the rate: it is the reason.
            score = scores[best] if decision.may(best, at.zone) else 0.0
            why = "rate" if outside(self.front_end.rate_hz) else self._doubt(segment, score, least) if seen else "hole"
        if why is not None:
            gates = listening.silenced if why == INHIBITED else ()
            unknown = Unknown(name, self.segments, confidence, *what, reason=why, where=at, gates=gates)
            return [self._foresight.judged(unknown), *([] if gates else [decided])]
        if decision.too_early(best, segment):
            return [self._cancelled("refractory"), decided]
        decision.published(best, segment)
        self.sequence += 1
        gesture = Gesture(name, self.segments, best, confidence, self.sequence, *what, own=own is not None, where=at)
        armed = [self._gate(cut.decided)] if listening.heard(cut.decided) else []
        return [self._foresight.judged(gesture), decided, *armed]

    def _doubt(self, segment: Segment, score: float, least: float) -> str:
        """Why a segment's best gesture, with that score, is less sure than `least`: "context" if its past is why.

        To find that out takes a run of the model, on which no answer depends. It takes none if the score is too low,
        or if `ask` has found it out already.
        """
        if score < least or segment.before == UNDISTURBED:
            return "confidence"
        if self._alone is None or self._alone[0] is not self.classifier or self._alone[1] is not segment:
            alone = self.classifier.preview(replace(segment, before=UNDISTURBED))
            self._alone = self.classifier, segment, alone
        alone = self._alone[2]
        return "context" if alone is not None and score * (1.0 - alone.unknown) >= least else "confidence"

    def _cancelled(self, why: str) -> Cancelled:
        self.shown = None
        return self._foresight.judged(Cancelled(self.name, self.segments, why))

    def _late(self, t: float) -> list[Told]:
        """The provisional event, if any, of a finger that is off, as shows because no frame has come until `t` s."""
        self._foresight.wait(self.front_end, min(t, self.front_end.pace.sure))
        return self._at_once()

    def _at_once(self) -> list[Told]:
        return [] if self._later or self._foresight.wanted is None else self.look()

    def look(self) -> list[Told]:
        """The provisional event, if any, of the open contact. It costs one run of the model at most."""
        return self._foresee(self._foresight.look(self.front_end))

    def _foresee(self, preview: Preview | None) -> list[Told]:
        """The provisional event of a contact that is not over, if the classifier is sure enough."""
        classifier, foresight, decision = self.classifier, self._foresight, self._decision
        if preview is None or (certainty := classifier.certainty) is None:
            return []
        if not self._listening.hears(preview.segment.onset):
            return []
        seen = preview.hole_s <= bearable_s(self.front_end.pace.interval_s)
        if not seen or not foresight.wants(preview, certainty, self._scene.gestures):
            return []
        answer = self._ask(preview.segment)[0] if preview.drafted else classifier.preview(preview.segment)
        if answer is None:
            return []
        zone = where(preview.segment, self._zones).zone if decision.restricted else None
        _, best, confidence = decision.best(classifier.gestures, answer, zone)
        armed = preview.segment.onset <= self._listening.armed_until
        least = decision.threshold(best, answer, armed=armed)
        held = decision.too_early(best, preview.segment) or decision.is_own(answer.own, zone, known=confidence >= least)
        needed = math.inf if held else decision.early(best, answer, armed=armed)
        said = foresight.say(preview, certainty, best, confidence, needed)
        return [] if said is None else [said]

    # --- by the hub's time: what is found is added to `facts`

    def count(self) -> tuple[int, int]:
        """The next sequence and id, for the events of a test; both count as used."""
        self.sequence += 1
        self.segments += 1
        return self.sequence, self.segments

    @property
    def calm(self) -> bool:
        """Whether an idle frame would say only that the sensor is idle; see `FrontEnd.calm`."""
        waits = self._listening.armed or self._foresight.wanted is not None or self.habits.falling
        return self.front_end.calm and not waits and not self._scene.frames

    def run(self, act: Callable[["Sensor"], Sequence[Told] | None], now: float, facts: list[Fact]) -> None:
        """Call `act` with the sensor at `now` (s), and add to `facts` what it returns, or the bug in it."""
        try:
            self._add(act(self) or (), now, facts)
        except Exception as error:
            self._recover(error, self.stamper.at(now), facts)

    def receive(self, arrivals: Sequence[Arrival], now: float, facts: list[Fact], *, missed: bool = False) -> float:
        """Take frames that were found waiting at `now` (s); returns `elapses_at` as it is after them.

        `missed`: this machine may have had no room for frames just before these.
        """
        try:
            stamps = self.stamper.stamp(arrivals, now, missed=missed)
            self.vitals.arrived(now, len(arrivals), missed=missed)
        except Exception as error:
            self._recover(error, self.stamper.at(now), facts)
            return self.elapses_at
        taken = lost = duplicates = late = implausible = 0
        for arrival, stamp in zip(arrivals, stamps, strict=True):
            if stamp.dropped:
                duplicates += stamp.dropped == "duplicate"
                late += stamp.dropped == "late"
                continue
            lost += stamp.lost
            implausible += stamp.implausible
            frame = Frame(stamp.t, arrival.values, arrival.touches, stamp.lost)
            try:
                if stamp.restarted:
                    facts.append(Changed(self.name, "restarted", self.owner.source))
                    self.restart(now, facts)
                told = self.push(frame)
            except Exception as error:
                self._recover(error, stamp.t, facts)
                continue
            taken += 1
            if self._scene.frames:
                facts.append(Taken(self.name, frame, self._fresh, self.front_end.ready))
            self._fresh = False
            if told:
                self._add(told, now, facts)
        if self._open is not None and now - self._since > HELD_S:
            self._run(lambda t: self._tell(self.front_end.give_up(t)), now, facts)
        if lost:
            self._lost, self._lost_at = self._lost + lost, now
        facts.append(_new(Arrived, ((self.name,), taken, lost, duplicates, late, implausible)))
        return math.inf if self._open is None else self.elapses_at

    @property
    def elapses_at(self) -> float:
        """When `elapse` will find something unless a frame comes before, in s; infinite if nothing waits."""
        due = None if self._open is None else self.due  # nothing waits without a contact
        return math.inf if due is None else self.stamper.when(due)

    def elapse(self, now: float, facts: list[Fact]) -> None:
        """No frame has come until `now` (s): a contact may be over."""
        if self._foresight.asked or self.front_end.due is not None:
            self._run(self.wait, now, facts)

    def end(self, now: float, facts: list[Fact]) -> None:
        """The sensor has fallen silent: its open contact is answered or cancelled."""
        self.silent = True
        self.vitals.silent()
        self._run(self.flush, now, facts)

    def restart(self, now: float, facts: list[Fact]) -> None:
        """Learn the sensor anew; a contact that is open is cancelled."""
        self.vitals.restart()
        self._fresh = True
        self.run(Sensor.reset, now, facts)

    def change(self, scene: Scene, classifier: Classifier, now: float, facts: list[Fact]) -> None:
        """Go on in another scene; what was learned stays if it still holds."""
        before, self._scene = self._scene, scene
        old, new = self.front_end, _front_end(self.name, scene)
        another_clock = scene.clock_of(self.name) != before.clock_of(self.name)
        alike = (old.grid_sent, old.mounting, old.timing) == (new.grid_sent, new.mounting, new.timing)
        if another_clock or not alike or scene.waits_for_double_tap != before.waits_for_double_tap:
            self.run(Sensor.reset, now, facts)
            self.front_end, self.habits = new, Habits(*new.grid_sent)
            self._square = new.rows == new.columns
        if another_clock:
            self.stamper = Stamper(scene.clock_of(self.name))
        if self._listening.change(scene.arming_of(self.name), another_clock=another_clock):
            facts.append(self._gate(self.stamper.at(now)))
        self.classifier, self._asked = classifier, None
        self._decision = Decision(scene, self.name, None if another_clock else self._decision)
        self._zones = scene.setup(self.name).zones
        self._foresight.taps = scene.provisional_taps
        self._fingers.zones = self._zones

    def shut(
        self, closed: Mapping[str, float], now: float, facts: list[Fact], armed_until: float | None = None
    ) -> None:
        """Close these gates at `now` and open all others; `closed`: by name, when it opens by itself (hub's clock, s).

        With `armed_until` the sensor is new, and a `Gate` event is given in any case, unless the sensor always listens.
        """
        if armed_until is not None and armed_until > -math.inf:
            self._listening.arm(armed_until)
        if closed != self._listening.closed:
            self._run(lambda t: self.gate(closed, t, self.stamper.past(now)), now, facts)
        elif armed_until is not None and self._listening.arming is not None:
            facts.append(self._gate(self.stamper.at(now)))

    def foresee(self, *, asked: bool, later: bool = False) -> None:
        """Give provisional events from now on, or no longer.

        The model is run at once, or `later`: by `look`, when `looks` is true. A frame that was not looked at when the
        next one comes gives no provisional event.
        """
        self._foresight.asked, self._later = asked, later

    def follow(self, facts: list[Fact], *, asked: bool) -> None:
        """Give touch events from now on, or no longer; then `facts` gets an `up` for each finger that is down."""
        if not asked:
            facts += self._fingers.end()
        self._fingers.asked = asked

    @property
    def looks(self) -> bool:
        """Whether there is something for `look`."""
        return self._foresight.wanted is not None

    def review(self, now: float, facts: list[Fact]) -> None:
        """Do what is not needed with each frame; called with each tick, at `now` (s)."""
        self.run(lambda sensor: sensor.vitals.review(sensor.front_end), now, facts)
        if self._listening.armed:
            self._run(self.lapse, now, facts)

    def stale(self, now: float) -> bool:
        """Whether nothing of the sensor was admitted for `stale_s` of the scene."""
        return now - self.owner.heard > self._scene.stale_s

    def condition(self, now: float) -> tuple[str, str]:
        """The state of the sensor, and the reason for it; see `Reading`."""
        if self.vitals.intermittent and now - self.owner.heard <= ABSENT_S:
            return "intermittent", ""
        if self.stale(now):
            return "stale", ""
        return self.vitals.condition(self.front_end, inverted=self.habits.inverted)

    def listens(self, now: float) -> Gate | None:
        """The gates and the arming at `now` (s); None for a sensor that always listens."""
        always = not self._listening.closed and self._listening.arming is None
        return None if always else self._gate(self.stamper.at(now))

    def reading(self, now: float) -> Reading:
        """All that is known of the sensor."""
        front_end = self.front_end
        state, reason = self.condition(now)
        return Reading(
            state,
            self._scene.grid_of(self.name),
            reason=reason,
            interval_s=front_end.pace.interval_s,
            jitter_s=self.vitals.jitter_s,
            bad_taxels=front_end.bad_taxels,
            noise=front_end.noise,
            source=self.owner.source,
            heard=self.owner.heard,
            lost=self._lost,
            lost_at=self._lost_at,
            exchanged=self.habits.exchanged,
            gate=self._gate(self.stamper.at(now)),
            touched=front_end.touched,
            contact=self._open,
            sequence=self.sequence,
            segments=self.segments,
            first=self.vitals.first,
            baseline=front_end.baseline if front_end.ready else None,
        )

    def view(self, now: float, *, raw: bool) -> dict[str, Any] | None:
        """The sensor's last frame and its state at `now` (s), as JSON values; None before its first frame."""
        felt = view_of(self.front_end, raw=raw)
        return felt and {"sensor": self.name, "state": self.condition(now)[0], **felt, "contact": self._open}

    def _run(self, act: Callable[[float], list[Told]], now: float, facts: list[Fact]) -> None:
        self.run(lambda _: act(self.stamper.at(now)), now, facts)

    def _recover(self, error: Exception, t: float, facts: list[Fact]) -> None:
        """After a bug: start clean, and end the contact that consumers believe to be open."""
        facts.append(Fault(self.name, error))
        try:
            facts += self._fingers.end()
            self.reset()
        except Exception as second:
            facts.append(Fault(self.name, second))
        if self._open is not None:
            if not self._answered:
                facts.append(self._foresight.judged(Cancelled(self.name, self._open, "internal_error")))
            facts.append(Release(self.name, self._open, t))
            self._open = None

    def _add(self, told: Sequence[Told], now: float, facts: list[Fact]) -> None:
        """Add events to `facts`, and remember which contact is open by what they say."""
        for one in told:
            if isinstance(one, Onset):
                self._open, self._answered, self._since = one.id, False, now
            elif isinstance(one, ANSWERS):
                self._answered = True
            elif isinstance(one, Release):
                self._open = None
        facts += told


Recognizer = Sensor  # its public name before version 0.2


def _front_end(name: str, scene: Scene) -> FrontEnd:
    """A sensor's front end, new."""
    return FrontEnd(
        *scene.grid_of(name),
        mounting=scene.setup(name).mounting,
        wait_for_double_tap=scene.waits_for_double_tap,
        timing=scene.timing,
    )
