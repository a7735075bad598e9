"""A scene: all of a configuration that decides what is recognised, as one frozen value.

The daemon makes it from its settings, a replay from a tape. Two hubs with equal scenes, the same classifier and the
same packets at the same times give the same events, as long as nobody changes, restarts or tests one of them, and both
had room for every packet.
"""

import ipaddress
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from gestured.core.address import SIDES, is_sensor
from gestured.core.listening import Arming
from gestured.core.mounting import Mounting
from gestured.core.points import STRICTNESS, USUAL, Strictness
from gestured.core.timing import Timing
from gestured.core.where import Zone, zones_of
from gestured.core.wire import Addresses

ONE_TAP, DOUBLE_TAP = "one_tap", "double_tap"
TAP_GAP_S = (0.2, 0.6)  # least, most: no hand taps twice faster (at 15 Hz), and taps further apart are two
STALE_S = (0.2, 60.0)  # least, most: the slowest sensor pauses for the least, and nobody waits longer than the most
MOST_SENSORS = 4096  # the most that a scene may name or have places for

Clock = Literal["arrival", "sensor"]
Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(frozen=True, slots=True)
class Setup:
    """How one sensor is built, mounted and clocked; the scene's own value holds for a field that is None."""

    grid: tuple[int, int] | None = None  # rows and columns of its frames, as they are sent
    mounting: Mounting = Mounting()
    clock: Clock | None = None
    strictness: Strictness | None = None
    zones: Mapping[str, Zone] = field(default_factory=dict)
    arming: Arming | None = None


AS_SCENE = Setup()


@dataclass(frozen=True, slots=True)
class Scene:
    """All that decides what is recognised. Raises ValueError, which names the field, for a value out of range."""

    gestures: tuple[str, ...]  # the gestures in use, in the model's order
    grid: tuple[int, int]  # rows and columns of a sensor that has none of its own
    sensors: Mapping[str, Setup] = field(default_factory=dict)  # by name; a place is kept free for each of these
    addresses: Addresses = Addresses()
    clock: Clock = "arrival"
    stale_s: float = Timing().stale_s  # after so long a silence a sensor counts as gone
    tap_gap_s: float = Timing().tap_gap_s  # how long a tap waits for a second one
    max_sensors: int = 64
    allow: tuple[Network, ...] = ()  # networks whose hosts may send; all hosts may if it is empty
    thresholds: Mapping[str, float] = field(default_factory=dict)  # by gesture: confidences in place of the model's own
    strictness: Strictness = USUAL  # the operating point of the answering model, for gestures without `thresholds`
    refractory: Mapping[str, float] = field(default_factory=dict)  # by gesture: s for which it is not published again
    arming: Arming | None = None  # the gesture before which no other counts
    gates: tuple[str, ...] = ()  # the gates that are closed for every sensor when a hub begins
    provisional_taps: bool = True  # whether a tap may be a provisional event while a second tap may follow
    touch: bool = False  # whether there may be touch events; they are personal data, since they show what is pressed
    touches: bool = False  # whether the finger positions that sensors send are kept
    frames: bool = False  # whether the hub gives a fact `Taken` for each frame that it used

    def __post_init__(self) -> None:
        if not self.gestures:
            raise ValueError("gestures: expected at least one, found none")
        for key, (least, most) in (("tap_gap_s", TAP_GAP_S), ("stale_s", STALE_S)):
            if not least <= getattr(self, key) <= most:
                raise ValueError(f"{key}: expected {least:g} to {most:g} s, found {getattr(self, key)!r}")
        if not 0 < self.max_sensors <= MOST_SENSORS or len(self.sensors) > MOST_SENSORS:
            raise ValueError(
                f"sensors: expected at most {MOST_SENSORS}, found {self.max_sensors}, {len(self.sensors)} named"
            )
        for value in (*self.thresholds.values(), *self.refractory.values()):
            if not math.isfinite(value):
                raise ValueError(f"gestures: expected thresholds and seconds that are finite, found {value!r}")
        if wrong := [name for name in self.gates if not is_sensor(name)]:
            raise ValueError(f"gates.start: expected names of A-Z a-z 0-9 _ -, found {wrong[0]!r}")
        for name in ("", *self.sensors):
            self._check_sensor(name)

    def _check_sensor(self, name: str) -> None:
        rows, columns = self.grid_of(name)
        if not (SIDES[0] <= rows <= SIDES[1] and SIDES[0] <= columns <= SIDES[1]):
            raise ValueError(f"grid: expected sides of {SIDES[0]} to {SIDES[1]} taxels, found {rows} x {columns}")
        for key, found, expected in (
            ("clock", self.clock_of(name), get_args(Clock)),
            ("strictness", self.strictness_of(name), STRICTNESS),
        ):
            if found not in expected:
                raise ValueError(f"{key}: expected {' or '.join(expected)}, found {found!r}")

    @classmethod
    def from_dict(cls, told: Mapping[str, Any], gestures: tuple[str, ...], grid: tuple[int, int]) -> "Scene":
        """The scene of a daemon's settings `told`, as values or as JSON holds them. Other keys are passed over.

        `gestures` are those in use; `grid` is used if the settings name none. What is missing has its default.
        Raises ValueError, KeyError, TypeError, AttributeError or OverflowError for what no daemon's settings can be.
        """
        parts = told.get("per_gesture", {}).items()
        plain: tuple[tuple[str, type], ...] = (
            ("clock", str), ("strictness", str), ("stale_s", float), ("tap_gap_s", float), ("provisional_taps", bool),
            ("touch", bool), ("max_sensors", int),
        )  # fmt: skip
        return cls(
            gestures=gestures,
            grid=_grid(told.get("grid") or grid),
            sensors={name: _setup(own) for name, own in told.get("sensors", {}).items()},
            addresses=Addresses(**told.get("addresses", {})),
            allow=tuple(ipaddress.ip_network(str(network)) for network in told.get("allow", ())),
            thresholds={name: float(own["threshold"]) for name, own in parts if own["threshold"] is not None},
            refractory={name: float(own["refractory_s"]) for name, own in parts},
            arming=Arming.of(told.get("arming")),
            gates=tuple(told.get("gate", {}).get("start", ())),
            **{key: kind(told[key]) for key, kind in plain if key in told},
        )

    def setup(self, sensor: str) -> Setup:
        """The setup of a sensor; the defaults if the scene does not name it."""
        return self.sensors.get(sensor, AS_SCENE)

    def grid_of(self, sensor: str) -> tuple[int, int]:
        """Rows and columns of a sensor's frames, as they are sent."""
        return self.setup(sensor).grid or self.grid

    def clock_of(self, sensor: str) -> Clock:
        """The clock from which a sensor's frames have their times."""
        return self.setup(sensor).clock or self.clock

    def strictness_of(self, sensor: str) -> Strictness:
        """How sure a model must be of what a sensor felt."""
        return self.setup(sensor).strictness or self.strictness

    def arming_of(self, sensor: str) -> Arming | None:
        """The arming of a sensor; None if it always listens."""
        return self.setup(sensor).arming or self.arming

    @property
    def arming_gestures(self) -> dict[str, str]:
        """The gestures that arm sensors, by the field that names them."""
        own = {f"sensors.{name}.arming.by": setup.arming for name, setup in self.sensors.items()}
        every = {"arming.by": self.arming, **own}
        return {field: arming.by for field, arming in every.items() if arming is not None}

    @property
    def waits_for_double_tap(self) -> bool:
        """Whether a tap has to wait for a second one."""
        return DOUBLE_TAP in self.gestures

    @property
    def timing(self) -> Timing:
        """The waits of segmenter and front end."""
        return Timing(stale_s=self.stale_s, tap_gap_s=self.tap_gap_s)

    def may_send(self, host: str) -> bool:
        """Whether a host's address lies in one of the networks of `allow`; true if there are none.

        A host name, which a tape may hold, lies in no network.
        """
        if not self.allow:
            return True
        try:
            address = ipaddress.ip_address(host)
        except ValueError:
            return False
        mapped = getattr(address, "ipv4_mapped", None)
        return any((mapped or address) in network for network in self.allow)


def _grid(value: Any) -> tuple[int, int]:
    rows, columns = value
    return int(rows), int(columns)


def _setup(own: Mapping[str, Any]) -> Setup:
    grid = own.get("grid")
    mounting = Mounting(own.get("rotate", 0), own.get("mirror", False), own.get("invert", False))
    return Setup(
        grid and _grid(grid), mounting, own.get("clock"), own.get("strictness"), zones_of(own.get("zones", {})),
        Arming.of(own.get("arming")),
    )  # fmt: skip
