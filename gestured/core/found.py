"""What a front end finds: what happens to a contact, and what is shown of one that is not over."""

from dataclasses import dataclass

from gestured.core.events import Cancelled, Onset, Release
from gestured.core.frames import Segment


@dataclass(frozen=True, slots=True)
class Cut:
    """A segment that is complete and waits for its name."""

    id: int
    segment: Segment  # the same object as in the last draft, unless more has become known since
    decided: float  # s, when it was complete
    hole_s: float = 0.0  # the longest time until then in which the finger may have done anything unseen


@dataclass(frozen=True, slots=True)
class Draft:
    """A segment as it will be cut if the finger stays off; its name may be looked for meanwhile."""

    segment: Segment


@dataclass(frozen=True, slots=True)
class Preview:
    """A contact that is not over: what of it has come so far."""

    id: int
    segment: Segment  # of what has come so far
    t: float  # s, now
    down: bool  # whether the finger is on the sensor; else it has left, perhaps for good
    drafted: bool  # whether the segment is the one of the last draft
    second: bool  # whether the second contact of the segment has begun: the first was a tap
    hole_s: float  # the longest time from one frame to the next so far


Contact = Onset | Cut | Cancelled | Release  # what happens to a contact, in this order
Found = Contact | Draft | Preview
