"""What can be set, where it may come from, and what is said when it is wrong.

Flags win over `GESTURED_*` in the environment, that over the TOML file, that over the defaults. The three are
merged first and validated once, as a whole; an error names the key, the value, where it came from and what
was expected. pydantic-settings would do the merging for 105 ms more at every start.
"""

import difflib
import ipaddress
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from gestured.core.errors import SettingsError
from gestured.core.wire import Addresses

SENSOR_NAME = r"^[A-Za-z0-9_-]{1,64}$"
SOCKET_PATH_BYTES = 107  # sun_path on Linux, without its final NUL
ENVIRONMENT = "GESTURED_"


class Address(NamedTuple):
    """A host (name or literal) and a port; port 0 means any free one."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


class Grid(NamedTuple):
    """Rows and columns of a sensor's frames as they are sent, before rotation."""

    rows: int
    columns: int

    def __str__(self) -> str:
        return f"{self.rows}x{self.columns}"


def _address(value: object) -> Address:
    match = re.fullmatch(r"(?:\[([0-9A-Fa-f:.%\w]+)\]|([^\[\]:/\s]+)):(\d{1,5})", str(value))
    if not isinstance(value, str) or match is None or int(match[3]) > 65535:
        raise ValueError("HOST:PORT with a port from 0 to 65535, such as 127.0.0.1:9000 or [::1]:9000")
    return Address(match[1] or match[2], int(match[3]))


def _destination(value: object) -> Address:
    try:
        if not isinstance(value, str) or not value.startswith("osc://"):
            raise ValueError
        address = _address(value.removeprefix("osc://").rstrip("/"))
        if address.port == 0:
            raise ValueError
    except ValueError:
        raise ValueError(
            "osc://HOST:PORT with a port from 1 to 65535, such as osc://127.0.0.1:9001"
        ) from None
    return address


def _grid(value: object) -> Grid:
    match = re.fullmatch(r"(\d{1,3})x(\d{1,3})", str(value))
    if not isinstance(value, str) or match is None or not all(2 <= int(n) <= 64 for n in match.groups()):
        raise ValueError("ROWSxCOLUMNS, each from 2 to 64, such as 9x9 or 27x15")
    return Grid(int(match[1]), int(match[2]))


def _socket(value: object) -> Path:
    if not isinstance(value, str | Path) or not str(value) or len(os.fsencode(value)) > SOCKET_PATH_BYTES:
        raise ValueError(f"the path of a Unix socket, at most {SOCKET_PATH_BYTES} bytes long")
    return Path(value)


def _network(value: object) -> ipaddress.IPv4Network | ipaddress.IPv6Network:
    try:
        if isinstance(value, str):
            return ipaddress.ip_network(value, strict=False)
    except ValueError:
        pass
    raise ValueError("an address or a network, such as 127.0.0.1, 192.168.7.0/24 or fd00::/8")


def _listed(value: object) -> object:
    """A flag or a variable holds several values with commas between them; the file holds a list."""
    return [word.strip() for word in value.split(",") if word.strip()] if isinstance(value, str) else value


Listed = BeforeValidator(_listed)
AddressField = Annotated[Address, BeforeValidator(_address)]
GridField = Annotated[Grid, BeforeValidator(_grid)]
NetworkField = Annotated[ipaddress.IPv4Network | ipaddress.IPv6Network, BeforeValidator(_network)]


class Part(BaseModel):
    """Base of all settings: unknown keys are errors, nothing changes after it was read."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True)


class SensorSettings(Part):
    """`[sensors.NAME]`: how one sensor is built and mounted."""

    grid: GridField | None = Field(
        None, description="rows x columns of its frames; by default the general `grid`"
    )
    rotate: Literal[0, 90, 180, 270] = Field(0, description="how far it is turned, in degrees clockwise")
    mirror: bool = Field(False, description="whether left and right are exchanged")
    clock: Literal["arrival", "sensor"] | None = Field(None, description="by default the general `clock`")


class GestureSettings(Part):
    """`[gestures.NAME]`: when one gesture counts."""

    threshold: float | None = Field(None, ge=0, le=1, description="confidence below which it is unknown")
    refractory_s: float = Field(0, ge=0, le=3600, description="seconds after it in which it is not repeated")


class AddressSettings(Part):
    """`[addresses]`: the OSC addresses that the sensors' firmware uses."""

    pressure: str = Field("/{sensor}/pressure", description="address of a pressure frame")
    trajectory: str = Field("/{sensor}/trajectory", description="address of finger positions")

    @model_validator(mode="after")
    def _usable(self) -> "AddressSettings":
        Addresses(self.pressure, self.trajectory)  # raises ValueError naming the pattern
        return self


class Settings(Part):
    """Everything that can be set. Each key is a flag and a `GESTURED_*` variable too, but for the tables."""

    model: str = Field(
        "cnn_lstm", min_length=1, description="path of a model, or the name of one that ships with gestured"
    )
    fallback: Annotated[tuple[str, ...], Listed] = Field(
        (), description="models to fall back on, best first; the shipped models bring their own"
    )
    listen: AddressField = Field(
        Address("127.0.0.1", 9000), validate_default=False, description="UDP address where OSC frames arrive"
    )
    publish: Annotated[tuple[Annotated[Address, BeforeValidator(_destination)], ...], Listed] = Field(
        (), description="osc://HOST:PORT to which events are sent"
    )
    socket: Annotated[Path, BeforeValidator(_socket)] | None = Field(
        None,
        description="Unix socket of the event stream; by default $RUNTIME_DIRECTORY/events.sock, "
        "else $XDG_RUNTIME_DIR/gestured/events.sock, else /tmp/gestured-UID/events.sock",
    )
    metrics: AddressField | None = Field(
        None, description="HTTP address of /metrics, /healthz and /readyz; off unless set"
    )
    grid: GridField | None = Field(
        None, description="rows x columns of the sensors' frames; by default the model's"
    )
    gestures: Annotated[tuple[str, ...], Listed] | None = Field(
        None, description="the gestures to use, all of the model's unless set; `[gestures] use` beside tables"
    )
    clock: Literal["arrival", "sensor"] = Field(
        "arrival",
        description="what a frame's time is: its arrival, or the increments of the sensor's time tags",
    )
    stale_s: float = Field(
        1.0, ge=0.2, le=60, description="seconds of silence after which a sensor counts as gone"
    )
    max_sensors: int = Field(
        64, ge=1, le=4096, description="sensors at a time; further ones are dropped and counted"
    )
    allow: Annotated[tuple[NetworkField, ...], Listed] = Field(
        (), description="addresses or networks that may send frames; any unless set"
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field("info", description="how much is logged")
    sensors: dict[Annotated[str, Field(pattern=SENSOR_NAME)], SensorSettings] = Field(
        {}, description="tables `[sensors.NAME]`, in the file only"
    )
    per_gesture: dict[str, GestureSettings] = Field(
        {}, description="tables `[gestures.NAME]`, in the file only"
    )
    addresses: AddressSettings = Field(AddressSettings(), description="table `[addresses]`, in the file only")


TABLES = ("sensors", "per_gesture", "addresses")
FLAGS = tuple(name for name in Settings.model_fields if name not in TABLES)
REPEATED = ("fallback", "publish", "allow")


def _from_file(path: str) -> dict[str, Any]:
    try:
        found = tomllib.loads(Path(path).read_text("utf-8"))
    except OSError as error:
        raise SettingsError(f"config: cannot read {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"config: {path} is not valid TOML: {error}") from None
    if "per_gesture" in found:  # our own name for the tables of [gestures], no key of the file's
        raise SettingsError(f"per_gesture ({path}): unknown key, expected [gestures.NAME]")
    if isinstance(found.get("gestures"), dict):
        tables = found.pop("gestures")
        if isinstance(tables.get("use"), list):
            found["gestures"] = tables.pop("use")
        found["per_gesture"] = tables
    return found


def _from_environment(environ: Mapping[str, str]) -> dict[str, str]:
    found = {
        name.removeprefix(ENVIRONMENT).lower(): value
        for name, value in environ.items()
        if name.startswith(ENVIRONMENT)
    }
    for key in found:
        if key not in FLAGS and key != "config":
            name = ENVIRONMENT + key.upper()
            known = tuple(ENVIRONMENT + flag.upper() for flag in FLAGS)
            raise SettingsError(f"{name} = {found[key]!r} (environment): {_unknown(name, known)}")
    return found


def _unknown(key: str, known: tuple[str, ...]) -> str:
    near = difflib.get_close_matches(key, known, 1)
    return (
        f"unknown key, did you mean {near[0]}?"
        if near
        else f"unknown key, expected one of {', '.join(known)}"
    )


def _keys_at(place: tuple[Any, ...]) -> tuple[str, ...]:
    if len(place) < 2:
        return tuple("gestures" if name == "per_gesture" else name for name in Settings.model_fields)
    part = {"sensors": SensorSettings, "per_gesture": GestureSettings, "addresses": AddressSettings}[place[0]]
    return tuple(part.model_fields)


def _explain(problem: Mapping[str, Any], sources: Mapping[str, str]) -> str:
    place = tuple(part for part in problem["loc"] if part not in ("[key]",))
    source = sources.get(str(place[0]), "default")
    if problem["type"] == "extra_forbidden":
        expected = _unknown(str(place[-1]), _keys_at(place))
    else:
        ours = problem["type"] == "value_error"
        message = problem["msg"].removeprefix("Value error, " if ours else "Input should be ")
        message = message if ours else message[0].lower() + message[1:]
        expected = message if "expected" in message else "expected " + message
    key = ".".join("gestures" if part == "per_gesture" else str(part) for part in place)
    return f"{key} = {problem['input']!r} ({source}): {expected}"


def load(flags: Mapping[str, Any], environ: Mapping[str, str]) -> tuple[Settings, dict[str, str]]:
    """Merge and validate. `flags` holds only what was given on the command line, and `config`.

    Returns the settings and where each key that was set came from. Raises SettingsError.
    """
    environment = _from_environment(environ)
    path = flags.get("config") or environment.pop("config", None)
    environment.pop("config", None)
    file = _from_file(path) if path else {}
    merged: dict[str, Any] = {}
    sources: dict[str, str] = {}
    for values, source in (
        (file, str(path)),
        (environment, "environment"),
        ({key: value for key, value in flags.items() if key != "config"}, "command line"),
    ):
        merged |= values
        sources |= dict.fromkeys(values, source)
    try:
        return Settings.model_validate(merged), sources
    except ValidationError as error:
        problems = error.errors(include_url=False, include_context=False)
        raise SettingsError(
            "; ".join(dict.fromkeys(_explain(problem, sources) for problem in problems))
        ) from None


def default_socket(environ: Mapping[str, str]) -> Path:
    """Where the event socket stands when nobody says so: where systemd, then the session, then anyone keeps it."""
    if directory := environ.get("RUNTIME_DIRECTORY"):
        return Path(directory.split(":")[0]) / "events.sock"
    if directory := environ.get("XDG_RUNTIME_DIR"):
        return Path(directory) / "gestured" / "events.sock"
    return Path(f"/tmp/gestured-{os.getuid()}") / "events.sock"
