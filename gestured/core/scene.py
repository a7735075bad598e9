"""Everything of a configuration that decides what is recognised: one frozen value.

The daemon makes it from its settings, a replay from a tape. Two hubs with equal scenes, the same classifier and the
same packets at the same times give the same events, as long as nobody changes, restarts or tests one of them, and both
had room for every packet.
"""

import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from gestured.core.mounting import SIDES, Mounting
from gestured.core.timing import Timing
from gestured.core.wire import Addresses

ONE_TAP, DOUBLE_TAP = "one_tap", "double_tap"
TAP_GAP_S = (0.2, 0.6)  # s: shorter no hand taps twice through 15 Hz, longer no two taps belong together

Clock = Literal["arrival", "sensor"]
Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(frozen=True, slots=True)
class Setup:
    """How one sensor is built, mounted and clocked; None stands for what holds in general."""

    grid: tuple[int, int] | None = None  # rows and columns of its frames, as they are sent
    mounting: Mounting = Mounting()
    clock: Clock | None = None


@dataclass(frozen=True, slots=True)
class Scene:
    """What decides. Raises ValueError, which names the field, for what cannot be."""

    gestures: tuple[str, ...]  # those in use, in the model's order
    grid: tuple[int, int]  # rows and columns of a sensor that has none of its own
    sensors: Mapping[str, Setup] = field(default_factory=dict)  # those that are named; they have a place for themselves
    addresses: Addresses = Addresses()
    clock: Clock = "arrival"
    stale_s: float = 1.0  # of silence, after which a sensor counts as gone
    tap_gap_s: float = Timing().tap_gap_s  # how long a tap waits for a second one
    max_sensors: int = 64
    allow: tuple[Network, ...] = ()  # who may send; anybody where it is empty
    thresholds: Mapping[str, float] = field(default_factory=dict)  # confidences, where not the model's own holds
    refractory: Mapping[str, float] = field(default_factory=dict)  # s in which a gesture is not repeated
    provisional_taps: bool = True  # whether one tap is said, where somebody asks, before a second one may come
    touches: bool = False  # whether finger positions are kept
    frames: bool = False  # whether the hub tells of each frame that it used

    def __post_init__(self) -> None:
        if not self.gestures:
            raise ValueError("gestures: expected at least one, found none")
        if not TAP_GAP_S[0] <= self.tap_gap_s <= TAP_GAP_S[1]:
            raise ValueError(f"tap_gap_s: expected {TAP_GAP_S[0]:g} to {TAP_GAP_S[1]:g} s, found {self.tap_gap_s!r}")
        for name in ("", *self.sensors):
            rows, columns = self.grid_of(name)
            if not (SIDES[0] <= rows <= SIDES[1] and SIDES[0] <= columns <= SIDES[1]):
                raise ValueError(f"grid: expected sides of {SIDES[0]} to {SIDES[1]} taxels, found {rows} x {columns}")
            if self.clock_of(name) not in ("arrival", "sensor"):
                raise ValueError(f"clock: expected arrival or sensor, found {self.clock_of(name)!r}")

    def setup(self, sensor: str) -> Setup:
        """What is set for a sensor."""
        return self.sensors.get(sensor, Setup())

    def grid_of(self, sensor: str) -> tuple[int, int]:
        """Rows and columns of a sensor's frames, as they are sent."""
        return self.setup(sensor).grid or self.grid

    def clock_of(self, sensor: str) -> Clock:
        """What a frame's time is."""
        return self.setup(sensor).clock or self.clock

    @property
    def waits_for_double_tap(self) -> bool:
        """Whether a tap has to wait for a second one."""
        return DOUBLE_TAP in self.gestures

    @property
    def timing(self) -> Timing:
        """Durations of the segmenter."""
        return Timing(stale_s=self.stale_s, tap_gap_s=self.tap_gap_s)

    def may_send(self, host: str) -> bool:
        """Whether a host's address lies in one of the networks of `allow`; any does where there are none."""
        if not self.allow:
            return True
        address = ipaddress.ip_address(host)
        mapped = getattr(address, "ipv4_mapped", None)
        return any((mapped or address) in network for network in self.allow)
