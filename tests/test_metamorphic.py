"""What must not change when the input changes, and what must change with it: the whole path, on simulated gestures.

In the front end the promise is exact: the same segments at the same frames, bit for bit, but for the change itself.
Where a learned net decides it is a share of labels.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gestured.core.classifier import Classifier, Scores
from gestured.core.frames import Segment
from gestured.core.mounting import Mounting
from gestured.lab.dataset import cuts
from gestured.lab.stability.extremes import Array, Series, events, labels, simulated_series
from gestured.model.model import Model
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped

COUNT = 50  # enough that LEAST lets one label differ
LEAST = 0.98  # of the labels, where a learned net decides
# Whether a gesture near the threshold is said or unknown is decided by the verifier, which has not learned from windows
# that are turned, and sees how far a contact stands out from the noise, which frames that come twice halve.
LEAST_SAID = 0.9
MIRRORED = {
    "swipe_left": "swipe_right",
    "swipe_right": "swipe_left",
    "circle_clockwise": "circle_counter_clockwise",
    "circle_counter_clockwise": "circle_clockwise",
}
TURNED = {
    "swipe_left": "swipe_right",
    "swipe_right": "swipe_left",
    "swipe_up": "swipe_down",
    "swipe_down": "swipe_up",
    "swipe_up_two_fingers": "swipe_down_two_fingers",
    "swipe_down_two_fingers": "swipe_up_two_fingers",
}
GRID_S = 1 / 4096  # times on it can be shifted without rounding


@dataclass(frozen=True, slots=True)
class Property:
    """A change of what comes in, and what it does to what goes out."""

    name: str
    times: Callable[[Array], Array] = field(default=lambda times: times)
    frames: Callable[[Array], Array] = field(default=lambda frames: frames)
    names: Mapping[str, str] = field(default_factory=dict)  # labels that become others
    picture: Callable[[Array], Array] = field(default=lambda frames: frames)  # the same change of counts above idle
    rounded: bool = False  # whether a constant takes away a baseline's last digits: one step of float32 at the peak

    def apply(self, stream: Series) -> Series:
        """The stream as this property changes it."""
        return Series(self.times(stream.times), self.frames(stream.frames))

    def holds(self, before: list[Segment], after: list[Segment]) -> bool:
        """Whether the front end's segments are the same ones, changed."""
        return len(before) == len(after) and all(map(self._same, before, after))

    def _same(self, one: Segment, two: Segment) -> bool:
        return (
            (one.first, one.last) == (two.first, two.last)
            and np.array_equal(self.times(one.times), two.times)
            and self._same_frames(self.picture(one.frames), two.frames)
        )

    def _same_frames(self, one: Array, two: Array) -> bool:
        if not self.rounded:
            return np.array_equal(one, two)
        step = np.spacing(np.float32(np.abs(one).max()))
        return one.shape == two.shape and bool((np.abs(one - two) <= step).all())


def postponed(seconds: float) -> Property:
    """The property that all times are later by so many seconds."""
    return Property(f"{seconds:g} s later", times=lambda times: times + seconds)


def scaled(gain: float) -> Property:
    """All counts times `gain`; exact in the front end for powers of two."""
    return Property(
        f"gain {gain:g}", frames=lambda frames: frames * gain, picture=lambda frames: frames * np.float32(gain)
    )


def raised(counts: float) -> Property:
    """A constant added to all counts; exact, but for rounding, unless it is much larger than they are."""
    return Property(f"{counts:g} counts added", frames=lambda frames: frames + counts, rounded=True)


def _doubled(times: Array) -> Array:
    middle = times[:-1] + np.diff(times) / 2
    return np.append(np.stack([times[:-1], middle], axis=1).reshape(-1), times[-1])


def mirrored() -> Property:
    """Left and right swapped."""

    def flip(frames: Array) -> Array:
        return frames[..., ::-1]

    return Property("mirrored", frames=flip, picture=flip, names=MIRRORED)


def upside_down() -> Property:
    """Turned by 180 degrees."""

    def turn(frames: Array) -> Array:
        return frames[..., ::-1, ::-1]

    return Property("turned by 180 degrees", frames=turn, picture=turn, names=TURNED)


def doubled() -> Property:
    """Each frame sent twice, at twice the rate."""
    return Property(
        "each frame twice, twice the rate", times=_doubled, frames=lambda frames: np.repeat(frames, 2, axis=0)[:-1]
    )


def on_grid(stream: Series) -> Series:
    """The same with times that can be shifted exactly."""
    times = np.rint(stream.times / GRID_S) * GRID_S
    keep = np.append(True, np.diff(times) > 0)
    return Series(times[keep], stream.frames[keep])


def renamed(found: tuple[str, ...], names: Mapping[str, str]) -> tuple[str, ...]:
    """Labels as they must be after the change."""
    return tuple(names.get(label, label) for label in found)


numbers = st.integers(0, COUNT - 1)
changes = st.one_of(
    st.integers(-(2**40), 2**40).map(lambda n: postponed(n / 4096)),
    st.integers(-2, 10).map(lambda n: scaled(2.0**n)),  # much less, and a constant would be much larger than counts
    st.integers(-200, 10_000).map(raised),
    st.just(mirrored()),
    st.just(upside_down()),
)


@cache
def streams() -> list[Series]:
    return [on_grid(stream) for _, stream in simulated_series(COUNT)]


@cache
def model(name: str) -> Model:
    if not shipped()[name].exists():
        pytest.skip(f"{shipped()[name]} is not there")
    return open_model(name)


@cache
def net(name: str) -> Classifier:
    return model(name) if name == LADDER[0] else OneThreshold(model(name))


class OneThreshold:
    """A model that answers by its one threshold and not by its operating points.

    Near the points' higher thresholds the fallback answers 3 of 60 mirrored streams otherwise (a gesture is unknown).
    So what its network says is held to LEAST here; the default model keeps it at its operating points, too.
    """

    certainty = None

    def __init__(self, net: Model) -> None:
        self._net, self.gestures = net, net.gestures

    def classify(self, segment: Segment) -> Scores:
        return replace(self._net.classify(segment), points=None)

    def preview(self, segment: Segment) -> Scores | None:
        return None


@cache
def said(name: str) -> list[tuple[str, ...]]:
    return [labels(events(stream, net(name))) for stream in streams()]


@settings(max_examples=60, deadline=None)
@given(numbers, st.lists(changes, min_size=1, max_size=3))
def test_the_front_end_sees_the_same_segments(number: int, several: list[Property]) -> None:
    """One after the other, in any order."""
    stream = streams()[number]
    before = cuts(stream.frames, stream.times)
    assert len(before) == 1
    for change in several:
        stream = change.apply(stream)
        after = cuts(stream.frames, stream.times)
        assert change.holds(before, after), change.name
        before = after


@settings(max_examples=20, deadline=None)
@given(numbers, st.sampled_from([0, 90, 180, 270]), st.booleans())
def test_a_sensor_that_is_mounted_otherwise_and_says_so_gives_the_same_events(
    number: int, rotate: int, mirror: bool
) -> None:
    stream = streams()[number]
    sent = np.rot90(stream.frames, rotate // 90, axes=(1, 2))  # counter-clockwise: the mounting turns it back
    turned_back = Series(stream.times, sent[:, :, ::-1] if mirror else sent)
    default = model(LADDER[0])
    assert events(turned_back, default, Mounting(rotate, mirror)) == events(stream, default)


@pytest.mark.parametrize("name", LADDER[:2])
@pytest.mark.parametrize(
    "change",
    [postponed(86_400.0), scaled(1e-3), scaled(1e3), raised(-200.0), raised(6e6), mirrored(), upside_down(), doubled()],
    ids=lambda change: change.name,
)
def test_the_nets_say_the_same_or_what_it_became(name: str, change: Property) -> None:
    found = [
        (labels(events(change.apply(stream), net(name))), renamed(before, change.names))
        for stream, before in zip(streams(), said(name), strict=True)
    ]
    frames_differ = change.name in (mirrored().name, upside_down().name, doubled().name)
    assert sum(now == then for now, then in found) >= (LEAST_SAID if frames_differ else LEAST) * len(found)
    named = [(now, then) for now, then in found if "unknown" not in now + then]
    assert sum(now == then for now, then in named) >= LEAST * len(named)  # no gesture becomes another one
