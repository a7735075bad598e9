"""Labelled recordings (.npz) as packets to play, and their labels as the expected answers."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.client.sensor import Form
from gestured.control.diff import Answer, Difference, Knew, Line, Verdict
from gestured.control.show import STOPWATCH_S
from gestured.core.address import Address
from gestured.core.errors import RecordingError
from gestured.core.scene import Scene
from gestured.core.sensor import ABSENT_S
from gestured.core.stamping import Stamper
from gestured.record import arrays as recording
from gestured.record.check import SESSION
from gestured.record.judge import NONE, UNNAMED, Outcome, Performed, tallied
from gestured.record.tape import Packet, Tape

BETWEEN_RECORDINGS_S = 3.0  # a pause long enough for every contact of the last recording to be answered
SOURCE = Address("127.0.0.1", 9)  # stands for the file as the sender; nobody sends from port 9 (discard)
STANDS_OUT = 0.5  # of the largest excursion of any taxel: a touch has begun if one goes so far, well above the noise
DIFFERENT = ("wrong", "missed", "false")


def stands_out(frames: NDArray[Any]) -> int:
    """The index of the first of (T, R, C) frames that is far from the median frame: about where a touch begins."""
    way = np.abs(frames - np.median(frames, axis=0)).max(axis=(1, 2))
    return int(np.argmax(way >= STANDS_OUT * way.max()))


class Labelled:
    """A labelled .npz, played as one sensor, one recording after the other. Raises RecordingError.

    The frame counter leaps before each recording, like that of a sensor that restarts, so that the idle sensor is
    learned anew. A performance whose onset nobody has marked begins with the first frame that stands out.
    """

    def __init__(self, path: Path, sensor: str) -> None:
        self._path, self._sensor = path, sensor
        self._found = found = recording.read_timed(path)
        spans = [found.times_of(g) for g in range(len(found))]
        lengths = [float(times[-1] - times[0]) for times in spans]
        self.seconds = sum(float(np.minimum(np.diff(times), ABSENT_S).sum()) for times in spans)
        self._first = np.array([times[0] for times in spans])  # (G,) s, as in the file
        begin = float(self._first[0]) if spans and self._first[0] >= STOPWATCH_S else 0.0
        # (G,) s, as played
        self._start = begin + np.cumsum([0.0, *(length + BETWEEN_RECORDINGS_S for length in lengths)])[:-1]
        self.tape = Tape({}, tuple(self._packets()), (), whole=True)

    def scene(self, gestures: Iterable[str]) -> Scene:
        """The default scene with these gestures, the recording's grid and the sensor's own clock."""
        rows, columns = self._found.frames.shape[1:]
        return Scene(tuple(gestures), (rows, columns), clock="sensor")

    def compare(self, lines: Iterable[Line], knew: Knew) -> Verdict:
        """Compare the events of a replay with the labels."""
        performed = list(self.performed())
        named = [one for one in performed if one.label != UNNAMED]
        asked = {id(one) for one in named if knew(self._sensor, one.onset)}
        _, outcomes = tallied(performed, (line for line in lines if line["type"] in ("gesture", "unknown")))
        found = [
            outcome
            for outcome in outcomes
            if outcome.verdict in DIFFERENT and (outcome.performed is None or id(outcome.performed) in asked)
        ]
        found.sort(key=lambda one: one.performed.onset if one.performed else float((one.event or {})["onset"]))
        skipped = len(named) - len(asked)
        return f"{len(asked)} labels", skipped, [self._difference(outcome) for outcome in found]

    def _packets(self) -> Iterator[Packet]:
        found = self._found
        form = Form(self._sensor, "ints" if np.can_cast(found.frames.dtype, np.int32) else "floats")
        counter = 0
        for g, (start, first) in enumerate(zip(self._start, self._first, strict=True)):
            counter += Stamper.LEAP
            for frame in found.stream(g):
                counter += 1
                t = float(start + (frame.t - first))
                yield Packet(round(1e9 * t), SOURCE, form.packet(frame, counter, t))

    def performed(self) -> Iterator[Performed]:
        """The labelled performances, in the times of playing. Raises RecordingError for a session without events."""
        found = self._found
        for g, label in enumerate(found.labels.tolist()):
            if label == SESSION:
                if found.event_recording is None:
                    raise RecordingError(
                        f"{self._path}: event_labels: recording {g} is a session whose events are not known"
                    )
            # The onset of a non-gesture need not be known, since any gesture during it is false.
            elif found.onsets is not None or label != NONE:
                times = found.times_of(g)
                first = stands_out(found.frames_of(g)) if found.onsets is None else int(found.onsets[g])
                last = -1 if found.releases is None else int(found.releases[g])
                kind = label if found.kinds is None else str(found.kinds[g])
                yield self._played(g, label, kind, float(times[first]), float(times[last]))
        if found.event_recording is not None:
            columns = (found.event_labels, found.event_kinds, found.event_onsets, found.event_offsets)
            rows = zip(found.event_recording.tolist(), *(c.tolist() for c in columns if c is not None), strict=True)
            for g, label, kind, onset, offset in rows:
                yield self._played(g, label, kind, onset, offset)

    def _played(self, g: int, label: str, kind: str, onset: float, offset: float) -> Performed:
        later = float(self._start[g] - self._first[g])
        return Performed(label, kind, onset + later, offset + later)

    def _difference(self, outcome: Outcome) -> Difference:
        performed, event = outcome.performed, outcome.event
        before = after = None
        if performed is not None:
            before = self._answer(performed.onset, performed.label, None)
        if event is not None:
            after = self._answer(event["onset"], event["gesture"], event["confidence"])
        elif performed is not None and performed.unknown:
            after = self._answer(performed.onset, "unknown", None)
        return Difference(before, after)

    def _answer(self, t: float, name: str, confidence: float | None) -> Answer:
        g = max(int(np.searchsorted(self._start, t, "right")) - 1, 0)
        return Answer(f"recording {g}", float(t - self._start[g] + self._first[g]), name, confidence)
