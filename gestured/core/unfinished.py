"""What a front end shows of a contact that is not over: drafts of its segment, and previews of what has come so far."""

from gestured.core.cutter import Cutter
from gestured.core.found import Draft, Preview
from gestured.core.frames import Segment
from gestured.core.pace import Pace
from gestured.core.segmenter import Segmenter
from gestured.core.timing import Timing

PREVIEW_S = 0.0666  # from one preview to the next: 15 a second, a little less than 1/15 because times are rounded
EACH_FRAME_S = 0.0635  # a sensor this slow is shown with each frame: at 15 Hz its rate is known to some per cent
DRAFT_S = 0.085  # quiet for so long, all that a window takes in is there; the wait goes on to see the finger stay off


class Unfinished:
    """The contact that goes on, as a front end's segmenter and cutter know it; it changes neither."""

    def __init__(self, segmenter: Segmenter, cutter: Cutter, pace: Pace, timing: Timing) -> None:
        self._segmenter, self._cutter, self._pace = segmenter, cutter, pace
        self._glitch_s = timing.glitch_s
        self._passed_over = 0  # frames since the last preview of a finger that is down
        self._left: float | None = None  # s, the last touched frame of the contact whose end was shown

    def begin(self) -> None:
        """Another contact begins, of which nothing was shown."""
        self._passed_over = 0

    @property
    def due(self) -> float | None:
        """When a finger that has left will have been off for `DRAFT_S`, in s; None where that was shown."""
        offset = self._segmenter.last_touched
        return offset + DRAFT_S if self._segmenter.phase.let_go and self._left != offset else None

    def show(self, number: int, t: float, *, previews: bool) -> list[Draft | Preview]:
        """What is to be shown with a frame at `t` s of the contact whose id is `number`; previews where asked for."""
        segmenter = self._segmenter
        let_go = segmenter.phase.let_go
        if not let_go and not previews:
            return []
        onset, offset = segmenter.onset, segmenter.last_touched
        if self._pace.longest_s(onset, offset) < self._glitch_s:
            return []
        segment = self._draft(onset, offset, t) if let_go else self._so_far(onset, offset)
        found: list[Draft | Preview] = [Draft(segment)] if let_go and segment is not None else []
        if previews and segment is not None:
            found.append(self._preview(number, segment, t, drafted=let_go))
        return found

    def wait(self, number: int, due: float) -> list[Preview]:
        """A preview of the contact whose id is `number`, at `due`: no frame has come since, and none is overdue."""
        segmenter = self._segmenter
        onset, offset = segmenter.onset, segmenter.last_touched
        self._left = offset
        if self._pace.longest_s(onset, offset) < self._glitch_s:
            return []
        segment = self._whole(onset, offset)
        return [] if segment is None else [self._preview(number, segment, due, drafted=False)]

    def _preview(self, number: int, segment: Segment, t: float, *, drafted: bool) -> Preview:
        segmenter = self._segmenter
        hole_s = self._cutter.hole(segment.onset, segment.offset, t)
        return Preview(number, segment, t, not segmenter.phase.let_go, drafted, segmenter.second, hole_s)

    def _draft(self, onset: float, offset: float, t: float) -> Segment | None:
        """The segment as it would be cut, once the finger has been off for so long that its window is complete."""
        if t - offset < DRAFT_S:
            return None
        self._left = offset
        return self._cutter.draft(onset, offset)

    def _so_far(self, onset: float, offset: float) -> Segment | None:
        """The segment while the finger is down: at most 15 times a second, and with every frame at 15 Hz."""
        interval_s = self._pace.interval_s
        self._passed_over += 1
        if self._passed_over * interval_s < PREVIEW_S and interval_s < EACH_FRAME_S:
            return None
        self._passed_over = 0
        return self._whole(onset, offset)

    def _whole(self, onset: float, offset: float) -> Segment | None:
        """All that has come; None where nothing is left of it without its bad taxels."""
        segment = self._cutter.so_far(onset, offset)
        return segment if segment.frames.max() >= self._segmenter.off * segment.noise else None
