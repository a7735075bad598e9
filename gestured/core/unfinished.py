"""What a front end shows of a contact that is not over: drafts of its segment, and previews of what has come so far."""

from gestured.core.cutter import Cutter
from gestured.core.found import Draft, Preview
from gestured.core.frames import Segment
from gestured.core.pace import Pace
from gestured.core.segmentation import Segmenter
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

    def begin(self) -> None:
        """Another contact begins."""
        self._passed_over = 0

    def show(self, number: int, t: float, *, previews: bool) -> list[Draft | Preview]:
        """What is to be shown with a frame at `t` s of the contact whose id is `number`; previews where asked for."""
        segmenter = self._segmenter
        let_go = segmenter.phase.let_go
        if not let_go and not previews:
            return []
        onset, offset = segmenter.onset, segmenter.last_touched
        if self._pace.longest_s(onset, offset) < self._glitch_s:
            return []
        if let_go:
            segment = self._draft(onset, offset, t)
            found: list[Draft | Preview] = [] if segment is None else [Draft(segment)]
        else:
            segment = self._so_far(onset, offset)
            found = []
        if previews and segment is not None:
            hole_s = self._cutter.hole(segment.onset, segment.offset, t)
            found.append(Preview(number, segment, t, not let_go, segmenter.second, hole_s))
        return found

    def _draft(self, onset: float, offset: float, t: float) -> Segment | None:
        """The segment as it would be cut, once the finger has been off for so long that its window is complete."""
        return self._cutter.draft(onset, offset) if t - offset >= DRAFT_S else None

    def _so_far(self, onset: float, offset: float) -> Segment | None:
        """The segment while the finger is down: at most 15 times a second, and with every frame at 15 Hz."""
        interval_s = self._pace.interval_s
        self._passed_over += 1
        if self._passed_over * interval_s < PREVIEW_S and interval_s < EACH_FRAME_S:
            return None
        self._passed_over = 0
        segment = self._cutter.so_far(onset, offset)
        if segment.frames.max() < self._segmenter.off * segment.noise:  # nothing is left without its bad taxels
            return None
        return segment
