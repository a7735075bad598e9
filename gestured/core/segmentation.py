"""The pressure-activity state machine: which frames belong to one gesture.

Activity is the largest taxel in units of its own noise. The cases, and what becomes of them:

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

import math
from dataclasses import dataclass
from enum import IntEnum, auto  # its hash is an integer's; Enum's is a function in Python


@dataclass(frozen=True, slots=True)
class Timing:
    """Durations in seconds. At 15 Hz they lie half-way between frames, so that jitter cannot flip a decision."""

    release_s: float = 0.10  # quiet this long: the finger is off
    tap_gap_s: float = 0.50  # a second tap may begin until then (gaps up to 0.4 s, seen through 15 Hz)
    tap_s: float = 0.57  # a tap is at most this long
    tap_travel: float = 0.15  # and stays within this share of the grid's shorter side
    limit_s: float = 5.03  # a contact that is no gesture any more
    limit_frames: int = 6000  # the same at 1000 Hz, where the sensor's own clock may all but stand still
    stale_s: float = 1.0  # silence that ends everything
    shift_s: float = 0.25  # frames far below the baseline for so long: the sensor restarted
    glitch_s: float = 0.02  # a contact surely shorter than this is no finger


OFF_SHARE = 0.12  # of the contact's peak: below it the finger is off (textile recovers slowly)
ON_SHARE = 0.20  # of the last contact's peak: what a new contact must exceed while the textile recovers
RECOVERY_S = 1.0
AFTER_S = 8.0  # then nothing is left of a contact: a firm finger has faded below the noise
SPIKE = 4.0  # a peak that one frame alone reached counts for so many times the next highest frame at most,
FIRM = 8.0  # which is taken to be so many times `on`: a tap may be a single frame


class Phase(IntEnum):
    """What is true of the sensor."""

    IDLE = auto()
    CONTACT = auto()
    RELEASING = auto()
    GAP = auto()
    SPENT = auto()


class Signal(IntEnum):
    """What a frame, or the time that passed, says."""

    QUIET = auto()
    WEAK = auto()
    STRONG = auto()
    RELEASED = auto()  # quiet for release_s
    TAPPED = auto()  # the same, and the segment is one tap so far
    GAP_OVER = auto()  # quiet for tap_gap_s
    MOVED = auto()  # the second contact is no tap, so it does not belong to the first
    LIMIT = auto()


class Action(IntEnum):
    """What the owner of the frames has to do."""

    OPEN = auto()
    CLOSE = auto()
    SPLIT = auto()  # the first contact is a segment, the second one begins another
    HELD = auto()  # give the segment up
    LEFT = auto()  # a given-up contact was let go


P, S, A = Phase, Signal, Action
TRANSITIONS: dict[tuple[Phase, Signal], tuple[Phase, Action | None]] = {
    (P.IDLE, S.QUIET): (P.IDLE, None),
    (P.IDLE, S.WEAK): (P.IDLE, None),
    (P.IDLE, S.STRONG): (P.CONTACT, A.OPEN),
    (P.CONTACT, S.QUIET): (P.RELEASING, None),
    (P.CONTACT, S.WEAK): (P.CONTACT, None),
    (P.CONTACT, S.STRONG): (P.CONTACT, None),
    (P.CONTACT, S.MOVED): (P.CONTACT, A.SPLIT),
    (P.CONTACT, S.LIMIT): (P.SPENT, A.HELD),
    (P.RELEASING, S.QUIET): (P.RELEASING, None),
    (P.RELEASING, S.WEAK): (P.RELEASING, None),
    (P.RELEASING, S.STRONG): (P.CONTACT, None),
    (P.RELEASING, S.RELEASED): (P.IDLE, A.CLOSE),
    (P.RELEASING, S.TAPPED): (P.GAP, None),
    (P.RELEASING, S.LIMIT): (P.SPENT, A.HELD),
    (P.GAP, S.QUIET): (P.GAP, None),
    (P.GAP, S.WEAK): (P.GAP, None),
    (P.GAP, S.STRONG): (P.CONTACT, None),
    (P.GAP, S.GAP_OVER): (P.IDLE, A.CLOSE),
    (P.GAP, S.LIMIT): (P.SPENT, A.HELD),
    (P.SPENT, S.QUIET): (P.SPENT, None),
    (P.SPENT, S.WEAK): (P.SPENT, None),
    (P.SPENT, S.STRONG): (P.SPENT, None),
    (P.SPENT, S.RELEASED): (P.IDLE, A.LEFT),
}
TOUCHED = frozenset({P.CONTACT, P.RELEASING, P.GAP})


class Segmenter:
    """Turns activity over time into actions. Knows times and levels, no frames.

    `on` and `off` are in units of noise; a quiet taxel exceeds 1 + sqrt(2 ln N) rarely and 3 + sqrt(2 ln N)
    almost never (extreme values of N normal deviates).
    """

    def __init__(self, taxels: int, travel: float, *, wait_for_double_tap: bool = True, timing: Timing | None = None):
        self.timing = timing or Timing()
        self.on = 3.0 + math.sqrt(2 * math.log(taxels))
        self.off = 1.0 + math.sqrt(2 * math.log(taxels))
        self._travel = travel  # taxel pitches that a tap may move
        self._wait = wait_for_double_tap
        self.reset()

    def reset(self) -> None:
        """Start clean, in IDLE."""
        self.phase = Phase.IDLE
        self.onset = self.last_touched = 0.0  # s, of the segment
        self.earlier = self.split_onset = 0.0  # s, when its first contact was last touched; its onset, once split off
        self._began = 0.0  # s, of the contact
        self._contacts = 0
        self._peak = self._second = 0.0  # the highest activity, and the next highest
        self._closed = -math.inf  # s, when the last contact was over
        self._quiet_since: float | None = None
        self._box: tuple[float, float, float, float] | None = None  # where the contact's centroid went
        self._widest = 0.0

    def push(self, t: float, activity: float, place: tuple[float, float] | None) -> list[Action]:
        """One frame at `t` s, after `flush(t)`; `place`: the centroid (row, column), if activity is at least `off`."""
        actions: list[Action] = []
        level = self._level(t, activity)
        before = self.phase
        self._step(t, level, actions)
        if self.phase is Phase.SPENT:
            if level is Signal.QUIET:
                self._quiet_since = self._since(t)
            else:
                self._quiet_since, self.last_touched = None, t
        elif self.phase is Phase.CONTACT:
            if before is not Phase.CONTACT and before is not Phase.RELEASING:
                self._began = t
                self._box, self._widest = None, 0.0
                self._contacts = 1 if before is Phase.IDLE else self._contacts + 1
                self.earlier = self.last_touched
            if before is Phase.IDLE:
                self.onset, self._peak, self._second = t, 0.0, 0.0
            elif self._contacts == 1 and self._peak < OFF_SHARE * activity:
                # What came before was too faint to belong to this contact: a hover, or noise.
                self.onset = self._began = t
                self._box, self._widest = None, 0.0
            self._second = max(self._second, min(self._peak, activity))
            self._peak = max(self._peak, activity)
            self.last_touched = t
            self._quiet_since = None
            if place is not None and level is Signal.STRONG:
                self._follow(place)
            if self._contacts == 2 and not self._tap_so_far():
                self._step(t, Signal.MOVED, actions)
                self.split_onset, self.onset, self._contacts = self.onset, self._began, 1
        elif self.phase is not Phase.IDLE:
            self._quiet_since = self._since(t)
        return actions

    def flush(self, t: float) -> list[Action]:
        """What the time alone decides until `t` s. Comes before `push`: a late frame cannot join what is over."""
        actions: list[Action] = []
        timing = self.timing
        if self._quiet_since is not None:
            quiet = t - self._quiet_since
            if self.phase in (Phase.RELEASING, Phase.SPENT) and quiet >= timing.release_s:
                self._step(t, Signal.TAPPED if self._is_tap() else Signal.RELEASED, actions)
            if self.phase is Phase.GAP and quiet >= timing.tap_gap_s:
                self._step(t, Signal.GAP_OVER, actions)
        if self.phase in TOUCHED and t - self.onset >= timing.limit_s:
            self._step(t, Signal.LIMIT, actions)
        return actions

    def give_up(self, t: float) -> list[Action]:
        """The contact has taken too much of something else than its own time: as if `limit_s` were over."""
        actions: list[Action] = []
        if self.phase in TOUCHED:
            self._step(t, Signal.LIMIT, actions)
        return actions

    def recovering(self, t: float) -> bool:
        """Whether a contact has just ended, so that what is left on the sensor is its after-effect."""
        return t - self._closed < RECOVERY_S

    def after_effect(self, t: float) -> float:
        """Activity that a contact may leave behind, now: textile comes back slowly, or swings below its baseline.

        One frame that is beyond all others is a fault of the readout, and leaves nothing behind; but the rest of the
        contact in which it came is no new one.
        """
        past = 0.0 if self.phase is not Phase.IDLE else self._closed - t
        if past < -AFTER_S:
            return 0.0
        peak = self._peak
        if past < -RECOVERY_S:
            peak = min(peak, SPIKE * max(self._second, FIRM * self.on))
        return ON_SHARE * peak * math.exp(past / RECOVERY_S)

    def let_go(self) -> bool:
        """Whether a finger was already off when the stream ended: what is open may then be decided."""
        return self.phase in (Phase.RELEASING, Phase.GAP)

    def _step(self, t: float, signal: Signal, actions: list[Action]) -> None:
        self.phase, action = TRANSITIONS[self.phase, signal]
        if action in (Action.CLOSE, Action.LEFT):
            self._closed = t
        if action is not None:
            actions.append(action)

    def _since(self, t: float) -> float:
        return t if self._quiet_since is None else self._quiet_since

    def _level(self, t: float, activity: float) -> Signal:
        on, off = self.on, self.off
        if self.phase is Phase.IDLE:
            if activity < on:  # the common case first
                return Signal.QUIET if activity < off else Signal.WEAK
            return Signal.STRONG if activity >= on + self.after_effect(t) else Signal.WEAK
        if self.phase is Phase.SPENT:
            return Signal.QUIET if activity < off else Signal.STRONG
        if activity < max(off, OFF_SHARE * self._peak):
            return Signal.QUIET
        return Signal.STRONG if activity >= max(on, ON_SHARE * self._peak) else Signal.WEAK

    def _follow(self, place: tuple[float, float]) -> None:
        row, column = place
        top, left, bottom, right = self._box or (row, column, row, column)
        top, left, bottom, right = min(top, row), min(left, column), max(bottom, row), max(right, column)
        self._box = (top, left, bottom, right)
        self._widest = max(self._widest, math.hypot(bottom - top, right - left))

    def _tap_so_far(self) -> bool:
        """Whether the contact is short and stayed where it was."""
        return self.last_touched - self._began <= self.timing.tap_s and self._widest <= self._travel

    def _is_tap(self) -> bool:
        return self._wait and self.phase is Phase.RELEASING and self._contacts == 1 and self._tap_so_far()
