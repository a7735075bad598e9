"""The example configuration: every key of the settings, with its description and a valid value."""

import json
import textwrap
from dataclasses import dataclass
from typing import Any

from gestured.daemon.settings import (
    TABLES,
    AddressSettings,
    ArmingSettings,
    GatesSettings,
    GestureSettings,
    Part,
    SensorSettings,
    Settings,
    ZoneSettings,
)

# Values to show for keys without a default, or whose default explains nothing.
SHOWN: dict[str, Any] = {
    "fallback": ["lstm"],
    "publish": ["osc://127.0.0.1:9001"],
    "socket": "/run/gestured/events.sock",
    "control": "/run/gestured/events.ctl",
    "gates": "/run/gestured/gates.sock",
    "metrics": "127.0.0.1:9108",
    "grid": "9x9",
    "gestures": ["one_tap", "double_tap", "swipe_left", "swipe_right"],
    "allow": ["127.0.0.1", "192.168.7.0/24"],
    "own_gestures": "/var/lib/gestured/own-gestures.json",
    "sensors.grid": "27x15",
    "sensors.rotate": 90,
    "sensors.mirror": True,
    "sensors.clock": "sensor",
    "sensors.strictness": "strict",
    "zones.at": [0.0, 0.5, 1.0, 1.0],
    "zones.gestures": ["swipe_left", "swipe_right"],
    "arming.by": "double_tap",
    "gates.start": ["door"],
    "gestures.threshold": 0.8,
    "gestures.refractory_s": 0.5,
}
HEAD = """\
Configuration of gestured: every key there is, commented out, with its default or an example as its value.
Made from the program's settings by `python -m deploy.generate configuration`.
After a change: gestured --config FILE --explain, then systemctl reload gestured. Flags and GESTURED_* variables
win over this file. An unknown key or an invalid value is an error, and a reload then changes nothing."""


@dataclass(frozen=True)
class Key:
    """One key of the file."""

    written: str  # as in the file: model = "cnn_lstm"
    text: str


def literal(value: object) -> str:
    """A value in TOML."""
    return json.dumps(value if isinstance(value, bool | int | float | str | list) else str(value))


def keys(part: type[Part], prefix: str = "", leave_out: tuple[str, ...] = ()) -> list[Key]:
    """The keys of one table. Raises KeyError for a key without default, `examples` and a value in SHOWN."""
    found = []
    for name, field in part.model_fields.items():
        if name in leave_out:
            continue
        default = field.default
        unset = field.is_required() or default is None or default == ()
        shown = {prefix + name: field.examples[0]} if field.examples else SHOWN
        value = shown[prefix + name] if unset else shown.get(prefix + name, default)
        text = field.description or ""
        if not unset and value != default:
            text += f" (default: {literal(default)})"
        found.append(Key(f"{name} = {literal(value)}", text))
    return found


def words(name: str) -> str:
    """The description of a key of the settings."""
    return Settings.model_fields[name].description or ""


def tables() -> dict[str, list[Key]]:
    """By heading of a table ("" for the keys above all tables): its keys."""
    use = literal(SHOWN["gestures"])
    return {
        "": keys(Settings, leave_out=(*TABLES, "gestures", "gates")),
        "[gestures]": [Key(f"use = {use}", words("gestures"))],
        "[sensors.armrest]": keys(SensorSettings, "sensors.", leave_out=("zones", "arming")),
        "[sensors.armrest.arming]": keys(ArmingSettings, "arming."),
        "[sensors.armrest.zones.volume]": keys(ZoneSettings, "zones."),
        "[gestures.one_tap]": keys(GestureSettings, "gestures."),
        "[addresses]": keys(AddressSettings),
        "[arming]": keys(ArmingSettings, "arming."),
        "[gates]": [*keys(GatesSettings, "gates."), Key(f"socket = {literal(SHOWN['gates'])}", words("gates"))],
    }


def example() -> str:
    """The whole file. Keys and tables are commented out; without these marks the file is valid, too."""
    lines = ["# " + line for line in HEAD.splitlines()]
    for table, found in tables().items():
        lines += ["", f"#{table}"] if table else []
        for key in found:
            lines += ["", *textwrap.wrap(key.text, 110, initial_indent="# ", subsequent_indent="# "), f"#{key.written}"]
    return "\n".join(lines) + "\n"
