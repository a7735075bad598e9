"""`gestured-lab collect` leads a participant through the protocol: prompt, countdown, gesture, verdict, key.

Every kept take is on disk before the next prompt, so a session can end at any moment and be continued later.
"""

import argparse
import math
import select
import textwrap
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from datetime import date
from pathlib import Path

from gestured.client.pad.pad import Pad
from gestured.client.pad.server import PadServer
from gestured.client.picture import draw, trace
from gestured.client.say import say_json
from gestured.core.address import Address
from gestured.core.errors import RecordingError
from gestured.lab.recordings.live import LiveSensor
from gestured.lab.recordings.protocol import INCLINATION_NAMES, Exercise, left, one_spelling, order
from gestured.lab.recordings.quality import Captured, faults
from gestured.lab.recordings.store import join_recordings, recording
from gestured.lab.recordings.terminal import KIND, NON_GESTURES, RATE_HZ, Ended, PadTerminal, Terminal
from gestured.model.opening import open_model
from gestured.record.arrays import read, write
from gestured.record.recordings import Recordings

GESTURE_TIMEOUT_S = 10.0  # s for a gesture to begin, and then for it to end
APART_S = 0.4  # s: a second contact within this time belongs to the take, and spoils it
CONSENT = """\
Consent of participant {participant}
  What is recorded: the pressure on the sensor while you perform gestures, and
  when. No name, no picture, no sound. It is kept under the pseudonym
  {participant} in {path}, to train and test gesture recognition.
  You may stop at any time, and have your recordings deleted later:
  gestured-lab forget {participant} {path}"""
WIDTH = 80  # columns of a terminal
KEEP = "Enter keep  "
KEYS = KEEP + "r repeat  d discard, it comes again  p pause  q quit, go on later"
SURE = 0.9  # confidence from which a model contradicts


class Paused(Exception):
    """Somebody asked for a pause; the take that was being captured is void."""


class Session:
    """One participant at one sensor; `kept` holds the recordings on disk."""

    def __init__(
        self, participant: str, path: Path, kept: Recordings | None, sensor: LiveSensor, terminal: Terminal, wait_s: int
    ) -> None:
        self.participant, self.path, self.kept = participant, path, kept
        self._sensor, self._terminal, self._wait_s = sensor, terminal, wait_s
        self._consent = ""
        self.inclination: int | None = None  # of the sensor; None if it is not known
        self.kind = ""  # kind of sensor, as in recordings

    def run(self, trials: Sequence[Exercise]) -> None:
        """Ask for one trial after the other until all are kept or somebody quits."""
        say = self._terminal.say
        try:
            if not self._agree():
                say("No consent, so nothing is recorded.")
                return
            todo = left(trials, self.kept)
            total = len(trials)
            if len(todo) < total:
                say(f"{total - len(todo)} of {total} are done already.")
            self._await_sensor()
            while todo:
                take = self._trial(todo[0], total - len(todo) + 1, total)
                trial = todo.pop(0)
                if take is not None:
                    self._keep(take, trial)
                else:  # repeated before the sensor is moved
                    others = (k for k, other in enumerate(todo) if other.inclination != trial.inclination)
                    todo.insert(next(others, len(todo)), trial)
            say(f"All {total} are done. Thank you.")
        except Ended:
            done = 0 if self.kept is None else len(self.kept)
            say(f"\nEnded with {done} recordings in {self.path}; the same command goes on from here.")

    def _agree(self) -> bool:
        if self.kept is not None and self.kept.consents is not None and self.kept.consents[0]:
            self._consent = str(self.kept.consents[0])
            self._terminal.say(f"Participant {self.participant} gave consent on {self._consent}.")
            return True
        self._terminal.say(CONSENT.format(participant=self.participant, path=self.path))
        if self._terminal.line("Do you agree? (yes/no) ").strip().lower() != "yes":
            return False
        self._consent = date.today().isoformat()
        return True

    def _await_sensor(self) -> None:
        self._terminal.say(f"Waiting for the sensor on {self._sensor.where}; do not touch it.")
        while not self._sensor.ready:
            with suppress(Paused):  # there is nothing to pause yet
                self._until(lambda: self._sensor.ready)
        rows, columns = self._sensor.grid
        self._terminal.say(f"Sensor {self._sensor.name}: {rows} x {columns} at {self._sensor.rate_hz:.1f} Hz.")

    def _trial(self, trial: Exercise, number: int, total: int) -> Captured | None:
        """The take to keep, or None if it was discarded."""
        say = self._terminal.say
        while True:
            try:
                if trial.inclination != self.inclination:
                    self.inclination = None
                    say(f"\nThe sensor {INCLINATION_NAMES[trial.inclination]}, please. Enter when it is in place.")
                    while self._until(None) != "\n":
                        pass
                    self.inclination = trial.inclination
                say(f"\n{number}/{total}  {trial}")
                answer, take = self._once(trial)
            except Paused:
                say("\nPaused. Enter goes on, q quits.")
                key = ""
                while key != "\n":
                    with suppress(Paused):  # it is paused already
                        key = self._until(None)
                continue
            if answer == "d":
                return None
            if answer == "\n" and take is not None:
                return take

    def _once(self, trial: Exercise) -> tuple[str, Captured | None]:
        """Capture one performance; returns the key that was pressed for it, and the take."""
        terminal, sensor = self._terminal, self._sensor
        for left_s in range(self._wait_s, 0, -1):
            terminal.say(f"{left_s} ", end="")
            self._until(None, 1.0)
        if not self._free():  # touched, or moved, so that it must be learned again
            terminal.say("do not touch the sensor ", end="")
            self._until(self._free)
        sensor.begin()
        terminal.say("now!")
        self._until(lambda: sensor.onset is not None, GESTURE_TIMEOUT_S)
        if sensor.onset is not None:
            self._until(lambda: sensor.quiet(APART_S), GESTURE_TIMEOUT_S)
        take = sensor.take()
        self._show(trial, take)
        usable = take is not None and not take.trouble
        doubt = usable and take is not None and take.sure >= SURE and take.looks != trial.gesture and not trial.none
        if doubt and take is not None:
            terminal.say(f"  that looked like {take.looks}, {take.sure:.2f}: keep? [y/N]")
        terminal.say(f"  {KEYS if usable and not doubt else KEYS.removeprefix(KEEP)}")
        while True:
            key = self._until(None)
            if doubt:
                key = {"y": "\n", "n": "r", "\n": "r"}.get(key, key)
            if key in ("r", "d") or (usable and key == "\n"):
                return key, take

    def _free(self) -> bool:
        return self._sensor.ready and not self._sensor.touched

    def _show(self, trial: Exercise, take: Captured | None) -> None:
        if take is None:
            self._terminal.say("  nothing touched the sensor")
            return
        wrong = faults(take, trial.gesture)
        peak = take.peak()
        words = [
            "",
            f"touched for {take.seconds:.2f} s, frames: {take.release - take.onset + 1}",
            f"peak {peak:{'.0f' if peak >= 10 else '.2g'}} counts, {peak / max(take.noise, 1e-9):.0f} times the noise",
            "good" if not wrong else "",
            "",
        ]
        start = max(take.onset - 2, 0)
        picture = draw(trace(take.values()[start : take.release + 1]), colour=True)
        for row, text in zip(picture, words, strict=True):
            self._terminal.say(f"  {row}   {text}".rstrip())
        if wrong:
            self._terminal.say(textwrap.fill("  NOT GOOD: " + "; ".join(wrong), WIDTH, subsequent_indent="  "))

    def _keep(self, take: Captured, trial: Exercise) -> None:
        new = recording(take, trial, self.participant, self._consent, self.kind)
        # Read anew: meanwhile `forget` may have removed what was there, or another session have added to it.
        before = already(self.path, self.participant, take.frames[0].values.shape)
        together = new if before is None else join_recordings([before, new])
        write(self.path, together)
        self.kept = together
        self._terminal.say(f"  kept, {len(together)} in {self.path}")

    def _until(self, done: Callable[[], bool] | None, seconds: float = math.inf) -> str:
        """Feed the front end until `done` is true or `seconds` are over; returns "".

        Without `done` and `seconds` it waits for a key, and returns that. Raises Paused for the key p, and Ended for q.
        """
        end = time.monotonic() + seconds
        told = False
        while True:
            self._sensor.pump()
            if done is not None and done():
                return ""
            key = self._terminal.key()
            if key == "q":
                raise Ended
            if key == "p":
                raise Paused
            if key is not None and done is None and seconds == math.inf:
                return key
            if self._sensor.silent and not told:
                told = True
                self._terminal.say(f"\n  {self._sensor.trouble()}")
            rest = end - time.monotonic()
            if rest <= 0:
                return ""
            select.select([self._terminal.fileno(), self._sensor.socket.fileno()], [], [], min(rest, 0.5))


def run(args: argparse.Namespace) -> int:
    """Collect until all is done or somebody quits; the same command continues later."""
    terminal = PadTerminal() if args.pad else Terminal()
    args.out.mkdir(parents=True, exist_ok=True)
    path: Path = args.out / f"{args.participant}.npz"
    kept = already(path, args.participant, args.grid)
    model = open_model(args.model)
    others = args.non_gestures or (NON_GESTURES if args.pad else ())
    trials = order(args.participant, args.seed, args.gestures, args.repeats, others)
    listen = Address("127.0.0.1", 0) if args.pad else args.listen
    with closing(LiveSensor(listen, args.grid, args.sensor, model)) as sensor, ExitStack() as held:
        session = Session(args.participant, path, kept, sensor, terminal, args.countdown)
        if isinstance(terminal, PadTerminal):
            pad = Pad(Address(*sensor.socket.getsockname()), args.sensor or "pad", args.grid, RATE_HZ)
            terminal.join(held.enter_context(PadServer(args.pad, pad, "gestured-lab collect --pad")).serve())
            session.inclination, session.kind = 0, KIND
            trials = [trial for trial in trials if trial.inclination == session.inclination]
        held.enter_context(terminal)
        session.run(trials)
    if args.json:
        labels = Counter(session.kept.labels.tolist()) if session.kept is not None else {}
        say_json({"file": str(path), "trials": len(trials), "recordings": labels})
    return 0


def already(path: Path, participant: str, grid: tuple[int, int]) -> Recordings | None:
    """The recordings of an earlier session, if there was one.

    Raises RecordingError if they are of another participant or grid, or if another spelling has some: 07 for 7.
    """
    if not path.exists():
        like = [other for other in path.parent.glob("*.npz") if one_spelling(other.stem) == one_spelling(participant)]
        if like:
            raise RecordingError(
                f"{like[0]}: may be of the same person; expected that name, or one less alike, found {participant!r}"
            )
        return None
    kept = read(path)
    others = sorted(set(kept.subjects.astype(str).tolist()) - {participant})
    if others:
        raise RecordingError(f"{path}: subjects: expected {participant} alone, found {others[0]}; choose another --out")
    if kept.frames.shape[1:] != grid:
        found, expected = ("x".join(map(str, shape)) for shape in (kept.frames.shape[1:], grid))
        raise RecordingError(f"{path}: frames: expected the grid {expected}, found {found}; see --grid")
    return kept
