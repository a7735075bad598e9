"""The decision about a segment: which gesture its scores mean in a scene, and whether that is sure enough."""

import math
from collections.abc import Sequence

from gestured.core.classifier import NEAR, Match, Scores
from gestured.core.frames import Segment
from gestured.core.points import Point
from gestured.core.scene import Scene


class Decision:
    """The thresholds, strictness, gestures in use and refractory pauses of a scene, for one sensor.

    The scores of gestures that are not in use are dropped, and not shared out among the others. A segment of which
    the model is not sure enough, or with a hole in which the finger may have moved unseen, is unknown. A gesture of the
    user's own may take a segment that the model does not know, or one that is much nearer to it than to the model's.
    """

    def __init__(self, scene: Scene, sensor: str, before: "Decision | None" = None) -> None:
        """The decision for a sensor of a scene; refractory pauses that began `before` go on."""
        self._in_use = frozenset(scene.gestures)
        self._thresholds, self._refractory = scene.thresholds, scene.refractory
        self._strictness = scene.strictness_of(sensor)
        zones = scene.setup(sensor).zones.items()
        self.restricted = {name: frozenset(zone.gestures) for name, zone in zones if zone.gestures is not None}
        # By gesture: s, the offset of the last published one.
        self._last_offset: dict[str, float] = {} if before is None else before._last_offset

    def may(self, gesture: str, zone: str | None) -> bool:
        """Whether a contact that began in that zone of the sensor may be that gesture."""
        allowed = self.restricted.get(zone or "")
        return allowed is None or gesture in allowed

    def best(
        self, gestures: Sequence[str], answer: Scores, zone: str | None = None
    ) -> tuple[dict[str, float], str, float]:
        """The scores of the classifier's `gestures` that are in use, the best of them, and its confidence.

        A gesture that may not begin in `zone` cannot be the best; if none may begin there, the confidence is 0.
        """
        scores = {
            gesture: float(value)
            for gesture, value in zip(gestures, answer.values, strict=True)
            if gesture in self._in_use
        }
        possible = [name for name in scores if self.may(name, zone)]
        best = max(possible or scores, key=scores.__getitem__)
        return scores, best, scores[best] * (1.0 - answer.unknown) if possible else 0.0

    def threshold(self, gesture: str, answer: Scores, *, armed: bool) -> float:
        """The confidence from which an answer is that gesture: the scene's threshold, else the answering model's.

        An operating point is made for whole days, in which hardly a contact is meant. On an `armed` sensor most
        contacts are meant, so the model's one threshold is enough there.
        """
        point = self._point(answer)
        usual = answer.threshold if point is None else point.thresholds[gesture]
        return self._thresholds.get(gesture, min(usual, answer.threshold) if armed else usual)

    def early(self, gesture: str, answer: Scores, *, armed: bool) -> float:
        """The confidence from which a provisional event may be that gesture, besides what a `Certainty` asks for."""
        point = self._point(answer)
        return max(self.threshold(gesture, answer, armed=armed), 0.0 if point is None else point.provisional or 0.0)

    def _point(self, answer: Scores) -> Point | None:
        return None if answer.points is None else answer.points[self._strictness]

    def is_own(self, match: Match | None, zone: str | None = None, *, known: bool) -> bool:
        """Whether a segment is the user's own gesture `match`. `known`: the model alone is sure enough of its best."""
        if match is None or (known and not match.nearer) or not self.may(match.name, zone):
            return False
        return match.confidence >= self._thresholds.get(match.name, NEAR)

    def too_early(self, gesture: str, segment: Segment) -> bool:
        """Whether it is too early to publish that gesture again."""
        since = segment.onset - self._last_offset.get(gesture, -math.inf)
        return since < self._refractory.get(gesture, 0.0)

    def published(self, gesture: str, segment: Segment) -> None:
        """Note that a gesture is published: its refractory pause begins."""
        self._last_offset[gesture] = segment.offset
