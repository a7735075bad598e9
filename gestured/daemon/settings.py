"""The settings. Every key is described here and nowhere else, since help and documents are made from this module."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from gestured.core.address import Address
from gestured.core.listening import LONGEST_S, Arming
from gestured.core.points import USUAL, Strictness
from gestured.core.scene import MOST_SENSORS, STALE_S, TAP_GAP_S
from gestured.core.timing import Timing
from gestured.core.where import zones_of
from gestured.core.wire import Addresses
from gestured.daemon.values import (
    AddressField,
    Count,
    DestinationField,
    FileField,
    GateName,
    GridField,
    Listed,
    NetworkField,
    Number,
    SensorName,
    SocketField,
    Switch,
)


def setting(default: Any, description: str, **bounds: Any) -> Any:
    """A setting that need not be set: its default, what it is, and pydantic's bounds of its value."""
    return Field(default=default, description=description, **bounds)


class Part(BaseModel):
    """Base of all settings: unknown keys are errors, and no value changes once it was read."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True)


class ZoneSettings(Part):
    """`[sensors.NAME.zones.ZONE]`: one zone of a sensor."""

    at: tuple[Number, Number, Number, Number] = Field(
        description="left, bottom, right and top edge in fractions of the sensor as a person in front of it sees it"
    )
    gestures: Annotated[tuple[str, ...], Listed] | None = setting(
        None, "the gestures that may begin there; all in use unless set"
    )


class ArmingSettings(Part):
    """`[arming]`, `[sensors.NAME.arming]`: the gesture before which no other counts."""

    by: str = Field(description="the gesture that arms: one in use, or an own one that was enrolled")
    seconds: Number = setting(
        Arming("").seconds, "seconds that a sensor stays armed after its last gesture", gt=0, le=LONGEST_S
    )


class GatesSettings(Part):
    """`[gates]`: the gates that keep sensors silent."""

    start: tuple[GateName, ...] = setting((), "names of gates that are closed at every start, until they are allowed")


class SensorSettings(Part):
    """`[sensors.NAME]`: how one sensor is built and mounted."""

    grid: GridField | None = setting(None, "rows x columns of its frames; by default the general `grid`")
    rotate: Literal[0, 90, 180, 270] = setting(0, "how far it is turned, in degrees clockwise")
    mirror: Switch = setting(False, "whether left and right are exchanged")
    invert: Switch = setting(False, "whether its counts fall under pressure")
    clock: Literal["arrival", "sensor"] | None = setting(
        None, "where its frames' times come from; by default the general `clock`"
    )
    strictness: Strictness | None = setting(None, "eager, normal or strict; by default the general `strictness`")
    zones: dict[SensorName, ZoneSettings] = setting({}, "tables `[sensors.NAME.zones.ZONE]`, in the file only")
    arming: ArmingSettings | None = setting(None, "table `[sensors.NAME.arming]`; by default the general `[arming]`")

    @model_validator(mode="after")
    def _apart(self) -> "SensorSettings":
        zones_of({name: zone.model_dump() for name, zone in self.zones.items()})  # raises ValueError naming the zones
        return self


class GestureSettings(Part):
    """`[gestures.NAME]`: when one gesture counts."""

    threshold: Number | None = setting(
        None, "confidence below which it is unknown, whatever the `strictness`; by default the model's", ge=0, le=1
    )
    refractory_s: Number = setting(0, "seconds in which the same gesture is not published again", ge=0, le=3600)


class AddressSettings(Part):
    """`[addresses]`: the OSC addresses that the sensors' firmware uses."""

    pressure: str = setting("/{sensor}/pressure", "address of a pressure frame")
    trajectory: str = setting("/{sensor}/trajectory", "address of finger positions")

    @model_validator(mode="after")
    def _usable(self) -> "AddressSettings":
        Addresses(self.pressure, self.trajectory)  # raises ValueError naming the pattern
        return self


class Settings(Part):
    """Everything that can be set. Each key is a flag and a `GESTURED_*` variable too, but for the tables."""

    model: str = setting("cnn_lstm", "path of a model, or the name of one that ships with gestured", min_length=1)
    fallback: Annotated[tuple[str, ...], Listed] = setting(
        (), "models to fall back on, best first; the shipped models bring their own"
    )
    listen: AddressField = setting(
        Address("127.0.0.1", 9000), "UDP address where OSC frames arrive", validate_default=False
    )
    publish: Annotated[tuple[DestinationField, ...], Listed] = setting(
        (), "osc://HOST:PORT to which events are sent, or tuio://HOST:PORT, fingers while they touch"
    )
    socket: SocketField | None = setting(
        None,
        "Unix socket of the event stream; by default $RUNTIME_DIRECTORY/events.sock, "
        "else $XDG_RUNTIME_DIR/gestured/events.sock, for root /run/gestured/events.sock",
    )
    control: SocketField | None = setting(
        None,
        "Unix socket for the requests of gesturectl; by default the event socket's path, with .ctl in place of .sock",
    )
    gates: SocketField | None = setting(
        None,
        "Unix socket on which bridges close and open gates, and can do nothing else; off unless set. "
        "A file names it as `socket` under [gates]",
    )
    metrics: AddressField | None = setting(None, "HTTP address of /metrics, /healthz and /readyz; off unless set")
    grid: GridField | None = setting(None, "rows x columns of the sensors' frames; by default the model's")
    gestures: Annotated[tuple[str, ...], Listed] | None = setting(
        None,
        "the gestures in use; all of the model's unless set. A file with tables [gestures.NAME] "
        "names them as `use` under [gestures]",
    )
    strictness: Strictness = setting(
        USUAL,
        "eager, normal or strict: how sure the model must be. The stricter, the fewer gestures that nobody "
        "made, and the more that must be repeated",
    )
    clock: Literal["arrival", "sensor"] = setting(
        "arrival", "where a frame's time comes from: its arrival, or the increments of the sensor's time tags"
    )
    stale_s: Number = setting(
        Timing().stale_s, "seconds of silence after which a sensor counts as gone", ge=STALE_S[0], le=STALE_S[1]
    )
    tap_gap_s: Number = setting(
        Timing().tap_gap_s, "seconds that a tap waits for a second one", ge=TAP_GAP_S[0], le=TAP_GAP_S[1]
    )
    provisional_taps: Switch = setting(
        True, "whether a single tap gets a provisional event before it is sure that no second one follows"
    )
    publish_provisional: Switch = setting(
        False, "whether provisional events and their revocations are also sent to `publish`"
    )
    touch: Switch = setting(
        False,
        "whether clients may follow fingers while they touch, by events of the type touch; they tell who "
        "presses what, and when",
    )
    max_sensors: Count = setting(
        64, "how many sensors at a time; further ones are dropped and counted", ge=1, le=MOST_SENSORS
    )
    allow: Annotated[tuple[NetworkField, ...], Listed] = setting(
        (), "addresses or networks that may send frames; any unless set"
    )
    flight_recorder: Count = setting(
        0, "MiB of memory in which the last 30 s of packets are kept; 0: none are kept", ge=0, le=1024
    )
    own_gestures: FileField | None = setting(
        None,
        "file in which the daemon keeps gestures of your own; by default "
        "$STATE_DIRECTORY/own-gestures.json, else $XDG_STATE_HOME/gestured/own-gestures.json, "
        "else ~/.local/state/gestured/own-gestures.json",
    )
    log_level: Literal["debug", "info", "warning", "error"] = setting("info", "how much is logged")
    sensors: dict[SensorName, SensorSettings] = setting({}, "tables `[sensors.NAME]`, in the file only")
    per_gesture: dict[str, GestureSettings] = setting({}, "tables `[gestures.NAME]`, in the file only")
    addresses: AddressSettings = setting(AddressSettings(), "table `[addresses]`, in the file only")
    arming: ArmingSettings | None = setting(None, "table `[arming]`, in the file only")
    gate: GatesSettings = setting(GatesSettings(), "table `[gates]`, in the file only")
    _sources: Mapping[str, str] = PrivateAttr({})  # of each key that was set

    def with_source(self, mistake: str) -> str:
        """The sentence about a mistake, which begins with a setting, and before it the source of that setting."""
        title = re.split(r"\W", mistake, maxsplit=1)[0]
        sources = [self._sources[key] for key in self._sources if TITLES.get(key, key) == title]
        return f"{' or '.join(dict.fromkeys(sources))}: {mistake}" if sources else mistake


TABLES = ("sensors", "per_gesture", "addresses", "arming", "gate")  # settings that are tables, in the file only
# The titles in the file of tables that have another name here, since a setting has the title as its name.
TITLES = {"per_gesture": "gestures", "gate": "gates"}
INSIDE = {"gestures": ("per_gesture", "use"), "gates": ("gate", "socket")}  # such a setting's place in that table
FLAGS = tuple(name for name in Settings.model_fields if name not in TABLES)
REPEATED = ("fallback", "publish", "allow")


def as_written(key: str, sources: Mapping[str, str]) -> str:
    """A setting's name as its source has it: `gestures` is `gestures.use` in a file with a table [gestures]."""
    table, inner = INSIDE.get(key, ("", ""))
    return f"{key}.{inner}" if inner and sources.get(table) == sources.get(key) else TITLES.get(key, key)
