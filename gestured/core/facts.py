"""The facts that a hub returns: a plain union, for those who publish, count, compare or keep them."""

from collections.abc import Iterable
from typing import Literal, NamedTuple

from gestured.core.classifier import Scores
from gestured.core.events import Event
from gestured.core.frames import Frame, Segment
from gestured.core.owner import Source


class Decided(NamedTuple):
    """A segment that was classified, and whether the model was sure enough; it comes right after its event."""

    sensor: str
    segment: Segment
    scores: Scores
    known: bool


class Arrived(NamedTuple):
    """What became of the frames of sensors that were found waiting together; the counts are those of each name."""

    sensors: tuple[str, ...]  # one that several frames came of may stand here as often
    taken: int
    lost: int  # frames missing before these: by the sensor's counter, or as this machine had no room for packets
    duplicates: int
    late: int
    implausible: int  # time tags that were replaced by the arrival


class Taken(NamedTuple):
    """A frame that was used. A hub gives these only where its scene asks for `frames`."""

    sensor: str
    frame: Frame  # stamped, as it was sent
    new: bool  # whether the sensor came or restarted just before, so that what was learned of it does not hold
    ready: bool  # whether the idle sensor is known, this frame included


class Dropped(NamedTuple):
    """A packet, or a part of one, that was not used."""

    reason: str
    source: Source
    text: str = ""  # what was wrong, in words


class Changed(NamedTuple):
    """A sensor came, fell silent, or began anew."""

    sensor: str
    what: Literal["new", "silent", "restarted"]
    source: Source


class Fault(NamedTuple):
    """A bug: an exception where none may be. The contact of the sensor in whose path it was has been ended."""

    sensor: str | None  # None where a packet could not be taken apart
    error: Exception


Fact = Event | Decided | Arrived | Taken | Dropped | Changed | Fault


def events_of(found: Iterable[Event | Decided]) -> list[Event]:
    """The events among what a sensor told."""
    return [one for one in found if not isinstance(one, Decided)]
