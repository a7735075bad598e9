"""One sensor on its way through the hub: its frames are stamped and recognised, and a bug in it stays in it."""

import math
from collections.abc import Callable, Sequence

from gestured.core.classifier import Classifier
from gestured.core.events import Cancelled, Event, Gesture, Onset, Release, Unknown
from gestured.core.facts import Arrived, Changed, Decided, Fact, Fault, Taken
from gestured.core.foresight import Foresight
from gestured.core.frames import Frame
from gestured.core.front_end import FrontEnd
from gestured.core.owner import Owner, Source
from gestured.core.reading import Reading
from gestured.core.recognizer import Recognizer
from gestured.core.scene import Scene
from gestured.core.stamping import Stamper
from gestured.core.view import View, view_of
from gestured.core.vitals import Vitals, faulty
from gestured.core.wire import Arrival

ABSENT_S = 60.0  # of silence: whoever touches a sensor that sends only then has gone, or it has
HELD_S = 60.0  # of arrivals: a contact that lasts longer by the sensor's own clock is given up


class Feed:
    """One sensor of a hub. Its methods add what they find to `facts`; times are seconds on the hub's clock."""

    def __init__(
        self, name: str, source: Source, scene: Scene, classifier: Classifier, numbers: tuple[int, int] = (0, 0)
    ) -> None:
        """`numbers`: the sequence and the id that the sensor has used before."""
        self.name, self._scene = name, scene
        self.owner = Owner(source)
        self.silent = False  # and has been flushed
        self._stamper = Stamper(scene.clock_of(name))
        front_end = front_end_of(name, scene)
        sequence, front_end.segments = numbers
        self._foresight = Foresight(name, taps=scene.provisional_taps)
        self._recognizer = _recognizer(front_end, scene, classifier, self._foresight, sequence)
        self._vitals = Vitals()
        self._fresh = True  # no frame was used since it came or restarted
        self._open: int | None = None  # id of the contact that was not released yet
        self._since = 0.0  # s, when the frame arrived that opened it
        self._answered = True  # whether that contact has its answer
        self._lost = 0  # frames
        self._lost_at: float | None = None  # s

    @property
    def numbers(self) -> tuple[int, int]:
        """The last sequence and the last id."""
        return self._recognizer.sequence, self._recognizer.front_end.segments

    def count(self) -> tuple[int, int]:
        """The next sequence and id, for an event that is made up; they count as used."""
        self._recognizer.sequence += 1
        self._recognizer.front_end.segments += 1
        return self.numbers

    def take(self, arrivals: Sequence[Arrival], now: float, facts: list[Fact], *, missed: bool) -> None:
        """Push frames that were found waiting at `now`; `missed`: this machine may have had no room for others."""
        try:
            stamps = self._stamper.stamp(arrivals, now, missed=missed)
        except Exception as error:
            self._recover(error, now, facts)
            return
        self._vitals.arrived(now, len(arrivals), self._recognizer.front_end.rate_hz, missed=missed)
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
                found = self._recognizer.push(frame)
            except Exception as error:
                self._recover(error, stamp.t, facts)
                continue
            taken += 1
            if self._scene.frames:
                facts.append(Taken(self.name, now, frame, self._fresh, self._recognizer.front_end.ready))
            self._fresh = False
            if found:
                self._tell(found, now, facts)
        if self._open is not None and now - self._since > HELD_S:
            self._run(self._recognizer.give_up, now, facts)
        if lost:
            self._lost, self._lost_at = self._lost + lost, now
        facts.append(Arrived(self.name, taken, lost, duplicates, late, implausible))

    @property
    def due(self) -> float:
        """When `wait` will find something unless a frame comes before; infinite where nothing waits."""
        due = None if self._open is None else self._recognizer.due  # nothing waits where there is no contact
        return math.inf if due is None else self._stamper.when(due)

    def wait(self, now: float, facts: list[Fact]) -> None:
        """No frame has come until `now`: a contact may be over."""
        self._run(self._recognizer.wait, now, facts)

    def flush(self, now: float, facts: list[Fact]) -> None:
        """The sensor has nothing more to say: what is open is answered or cancelled."""
        self.silent = True
        self._vitals.silent()
        self._run(self._recognizer.flush, now, facts)

    def restart(self, now: float, facts: list[Fact]) -> None:
        """Learn the sensor anew; a contact that is open is cancelled."""
        self._vitals.restart()
        self._fresh = True
        self._tell(self._recognizer.reset(), now, facts)

    def change(self, scene: Scene, classifier: Classifier, now: float, facts: list[Fact]) -> None:
        """Go on in another scene; what was learned stays where it still holds."""
        before, self._scene = self._scene, scene
        old, new = self._recognizer.front_end, front_end_of(self.name, scene)
        another_clock = scene.clock_of(self.name) != before.clock_of(self.name)
        alike = (old.sent, old.mounting, old.timing) == (new.sent, new.mounting, new.timing)
        if another_clock or not alike or scene.waits_for_double_tap != before.waits_for_double_tap:
            self._tell(self._recognizer.reset(), now, facts)
            new.segments = old.segments  # its segments are numbered on
            old = new
        if another_clock:
            self._stamper = Stamper(scene.clock_of(self.name))
        old.previews, self._foresight.taps = self._recognizer.front_end.previews, scene.provisional_taps
        self._recognizer = _recognizer(old, scene, classifier, self._foresight, self._recognizer.sequence)

    def foresee(self, *, asked: bool) -> None:
        """Say of contacts from now on, or no longer, what they will most probably be."""
        self._recognizer.front_end.previews = asked

    def review(self) -> None:
        """Look at what is not looked at with each frame."""
        self._vitals.review(self._recognizer.front_end)

    def stale(self, now: float) -> bool:
        """Whether the sensor is silent."""
        return now - self.owner.heard > self._scene.stale_s

    def state(self, now: float) -> str:
        """How the sensor is; see `Reading`."""
        front_end = self._recognizer.front_end
        if self._vitals.intermittent and now - self.owner.heard <= ABSENT_S:
            return "intermittent"
        if self.stale(now):
            return "stale"
        if not front_end.ready:
            return "starting"
        if front_end.habits.inverted:
            return "inverted"
        return "faulty" if faulty(front_end) else "degraded" if front_end.bad_taxels else "ok"

    def reading(self, now: float) -> Reading:
        """All that is known of the sensor."""
        front_end = self._recognizer.front_end
        return Reading(
            self.state(now),
            self._scene.grid_of(self.name),
            interval_s=front_end.interval_s,
            jitter_s=self._vitals.jitter_s,
            bad_taxels=front_end.bad_taxels,
            noise=front_end.noise,
            source=self.owner.source,
            heard=self.owner.heard,
            lost=self._lost,
            lost_at=self._lost_at,
            exchanged=front_end.habits.exchanged,
            touched=front_end.touched,
            contact=self._open,
            sequence=self._recognizer.sequence,
            segments=front_end.segments,
            first=self._vitals.first,
            baseline=front_end.baseline if front_end.ready else None,
        )

    def view(self, *, raw: bool) -> View | None:
        """The sensor as it is felt now; None before its first frame."""
        return view_of(self._recognizer.front_end, raw=raw)

    def _run(self, act: Callable[[float], list[Event | Decided]], now: float, facts: list[Fact]) -> None:
        t = self._stamper.at(now)
        try:
            self._tell(act(t), now, facts)
        except Exception as error:
            self._recover(error, t, facts)

    def _recover(self, error: Exception, t: float, facts: list[Fact]) -> None:
        """After a bug: start clean, and end what consumers believe to be open."""
        facts.append(Fault(self.name, error))
        try:
            self._recognizer.reset()
        except Exception as second:
            facts.append(Fault(self.name, second))
        if self._open is not None:
            ended: list[Event | Decided] = [Release(self.name, self._open, t)]
            if not self._answered:
                ended.insert(0, self._foresight.judged(Cancelled(self.name, self._open, "internal_error")))
            self._tell(ended, t, facts)

    def _tell(self, found: Sequence[Event | Decided], now: float, facts: list[Fact]) -> None:
        """Add events, and remember what is open."""
        for one in found:
            if isinstance(one, Onset):
                self._open, self._answered, self._since = one.id, False, now
            elif isinstance(one, Gesture | Unknown | Cancelled):
                self._answered = True
            elif isinstance(one, Release):
                self._open = None
        facts += found


def front_end_of(name: str, scene: Scene) -> FrontEnd:
    """A sensor's front end, new."""
    return FrontEnd(
        name,
        *scene.grid_of(name),
        mounting=scene.setup(name).mounting,
        wait_for_double_tap=scene.waits_for_double_tap,
        timing=scene.timing,
    )


def _recognizer(
    front_end: FrontEnd, scene: Scene, classifier: Classifier, foresight: Foresight, sequence: int
) -> Recognizer:
    return Recognizer(
        front_end,
        classifier,
        gestures=scene.gestures,
        thresholds=scene.thresholds,
        refractory=scene.refractory,
        foresight=foresight,
        sequence=sequence,
    )
