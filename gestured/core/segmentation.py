"""The pressure-activity state machine: which frames belong to one gesture.

Activity is the strongest spot of a frame in units of noise. The cases, and what becomes of them:

    tap          ##..............   one segment, decided after `tap_gap_s` of quiet: a second tap may come
    double tap   ##...##..          one segment of two contacts, decided `release_s` after the second
    tap, swipe   ##...######..      two segments, told apart as soon as the second contact moves
    swipe        ########..         one segment, decided `release_s` after the finger left
    flicker      ###.####..         one contact: a single quiet frame is shorter than `release_s`
    hold         ############...    after `limit_s` cancelled ("held"); nothing more until it is let go
    object       ###############    the same; the baseline learns it, then the sensor is idle again
    silence      ####     ...       cancelled ("silence") after `stale_s` without a frame
    glitch       |                  shorter than any finger at a fast sensor: cancelled ("glitch")

Not handled: two people on one sensor, and a tap that begins while another finger still rests (one contact).
"""

from typing import NamedTuple

from gestured.core.activity import hardly_ever, rarely
from gestured.core.contact import Memory, Place
from gestured.core.phases import IDLE, TRANSITIONS, Action, Phase, Signal
from gestured.core.timing import Timing


class Deed(NamedTuple):
    """An action, and the segment that it is about."""

    action: Action
    onset: float  # s
    offset: float  # s, when it was last touched
    decided: float  # s


class Segmenter:
    """Activity over time in, deeds out, by the table in `phases`. Knows times and levels, no frames."""

    def __init__(self, taxels: int, travel: float, *, wait_for_double_tap: bool = True, timing: Timing | None = None):
        """`travel`: taxel pitches that a tap may move."""
        self.on = hardly_ever(taxels)  # noise units: activity from which there is a contact
        self.off = rarely(taxels)  # noise units: activity below which there is none
        self._memory = Memory(timing or Timing(), self.on, self.off, travel, wait_for_double_tap)
        self.after = self._memory.after  # what the last contact has left behind
        self.phase: Phase = IDLE

    def reset(self) -> None:
        """Start clean, in IDLE."""
        self.phase = IDLE
        self._memory.clear()

    @property
    def onset(self) -> float:
        """When the segment began, in s."""
        return self._memory.onset

    @property
    def second(self) -> bool:
        """Whether the segment's second contact has begun."""
        return self._memory.first is not None

    @property
    def last_touched(self) -> float:
        """When it was touched last, in s."""
        return self._memory.contact.touched

    def levels(self, t: float) -> tuple[float, float]:
        """Activity from which a frame at `t` s is strong, and below which it is quiet; noise units."""
        return self.phase.levels(self._memory, t)

    def push(self, t: float, activity: float, place: Place | None) -> list[Deed]:
        """One frame at `t` s, after `flush(t)`; `place`: the centroid (row, column), if activity is at least `off`."""
        return self._step(self.phase.reads(self._memory, t, activity), t, activity, place)

    @property
    def over(self) -> float | None:
        """When the wait that goes on is over unless the finger comes back, in s; None where none goes on."""
        wait, since = self.phase.wait, self._memory.quiet_since
        return None if wait is None or since is None else since + wait.lasts(self._memory.timing)

    def flush(self, t: float, sure: float) -> list[Deed]:
        """What the time alone decides until `t` s. Comes before `push`: a late frame cannot join what is over.

        A wait that was over while everything was known, until `sure` (s), is decided at its end; another one at `t`.
        """
        memory = self._memory
        deeds: list[Deed] = []
        while (wait := self.phase.wait) is not None and (over := self.over) is not None and t >= over:
            deeds += self._step(wait.says(memory), over if over <= sure else t)
        if self.phase.pending and t - memory.onset >= memory.timing.limit_s:
            deeds += self.give_up(t)
        return deeds

    def give_up(self, t: float) -> list[Deed]:
        """The contact has taken too much of something else than its own time: as if `limit_s` were over."""
        return self._step(Signal.LIMIT, t) if self.phase.pending else []

    def _step(self, signal: Signal | None, t: float, activity: float = 0.0, place: Place | None = None) -> list[Deed]:
        deeds: list[Deed] = []
        while signal is not None:
            then, action, remember = TRANSITIONS[self.phase, signal]
            if action is not None:
                deeds.append(self._deed(action, t))
            self.phase = then
            signal = None if remember is None else remember(self._memory, t, activity, place)
        return deeds

    def _deed(self, action: Action, t: float) -> Deed:
        """The action, with the segment as it is before anything is remembered of it."""
        memory = self._memory
        if action is Action.OPEN:
            return Deed(action, t, t, t)
        if action is Action.SPLIT and memory.first is not None:
            return Deed(action, memory.first.began, memory.first.touched, t)
        return Deed(action, memory.onset, memory.contact.touched, t)
