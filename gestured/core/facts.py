"""The facts that a hub returns, in a plain union: its callers publish, count, compare or keep them."""

from collections.abc import Iterable
from typing import Literal, NamedTuple

from gestured.core.classifier import Scores
from gestured.core.events import Event
from gestured.core.frames import Frame, Segment
from gestured.core.owner import Source


class Decided(NamedTuple):
    """A segment that was classified, and its scores. This fact comes right after the event about the segment."""

    sensor: str
    segment: Segment
    scores: Scores
    known: bool  # whether the model was sure enough of a gesture


class Arrived(NamedTuple):
    """What became of the frames that were found waiting together. The counts hold for each name in `sensors`."""

    sensors: tuple[str, ...]  # a sensor may stand here several times, with the counts as often
    taken: int
    lost: int  # frames missing before these, by the sensor's counter or because this machine had no room
    duplicates: int
    late: int
    implausible: int  # time tags in whose place the arrival was used


class Taken(NamedTuple):
    """A frame that was used. A hub gives these facts only if its scene asks for `frames`."""

    sensor: str
    frame: Frame  # stamped, as it was sent
    new: bool  # whether the sensor came or restarted just before, so that nothing learned before holds
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
    """A bug: an unexpected exception. The contact of the sensor in whose path it was has been ended."""

    sensor: str | None  # None if it was in no sensor's path, as in a decoder
    error: Exception


Fact = Event | Decided | Arrived | Taken | Dropped | Changed | Fault


def events_of(found: Iterable[Event | Decided]) -> list[Event]:
    """The events among what a sensor returns."""
    return [one for one in found if not isinstance(one, Decided)]
