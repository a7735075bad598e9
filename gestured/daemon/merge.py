"""The sources of settings, merged, and the errors for settings that are wrong.

Flags win over variables `GESTURED_*`, variables over the TOML file, and the file over the defaults. All are merged
first and validated once, as a whole; an error names the key, the value, its source and what was expected.
pydantic-settings would merge them as well, but take 105 ms more at every start.
"""

import errno
import re
from collections.abc import Mapping, Sequence
from typing import Any, get_args, get_origin

from pydantic import ValidationError

from gestured.core.errors import SettingsError
from gestured.daemon.settings import FLAGS, INSIDE, TITLES, Part, Settings, as_written
from gestured.daemon.values import expected
from gestured.record.files import open_regular

ENVIRONMENT = "GESTURED_"
KEYS = (*FLAGS, "config")  # settings that a variable can set
# Variables by which Kubernetes and Docker tell containers of a service, such as GESTURED_PORT_9000_UDP_ADDR.
SERVICE = re.compile(r"GESTURED_(\w+_)?(SERVICE_HOST|SERVICE_PORT(_\w+)?|PORT_\d+_(TCP|UDP|SCTP)(_(ADDR|PORT|PROTO))?)")
PORT = re.compile(r"GESTURED_(\w+_)?PORT")  # set by a platform if its value is a URL, such as tcp://10.96.0.17:9000
MAX_CONFIG_BYTES = 1 << 20  # of a configuration; one with the most sensors has a small part of these


def _from_file(path: str) -> dict[str, Any]:
    import tomllib

    try:
        with open_regular(path) as file:
            data = file.read(MAX_CONFIG_BYTES + 1)
        if len(data) > MAX_CONFIG_BYTES:
            raise OSError(errno.EFBIG, "is too large", path)
        found = tomllib.loads(data.decode("utf-8-sig"))  # some editors write a byte order mark
    except OSError as error:
        limit = f"{MAX_CONFIG_BYTES >> 20} MiB"
        raise SettingsError(f"config: {path}: {error.strerror}, expected a regular file of at most {limit}") from error
    except (ValueError, RecursionError) as error:  # bad bytes, syntax, or a number of thousands of digits
        raise SettingsError(f"config: {path} is not valid TOML: {error}{_twice(data)}") from error
    for name in TITLES.keys() & found.keys():  # our own names for tables are no keys of the file
        raise SettingsError(f"{name} ({path}): unknown key, expected [{TITLES[name]}]")
    if isinstance(found.get("gestures"), dict):
        tables = found.pop("gestures")
        if not isinstance(tables.get("use", {}), dict):
            found["gestures"] = tables.pop("use")
        found["per_gesture"] = tables
    if isinstance(found.get("gates"), dict):
        found["gate"] = tables = found.pop("gates")
        if "socket" in tables:
            found["gates"] = tables.pop("socket")
    return found


def _twice(data: bytes) -> str:
    """A hint for each key of a file that stands beside a table of that name, which TOML does not allow."""
    text, hint = data.decode("utf-8-sig", "replace"), ""
    for key, (_, inner) in INSIDE.items():
        if re.search(rf"^{key}\s*=", text, re.MULTILINE) and re.search(rf"^\[{key}[].]", text, re.MULTILINE):
            hint += f"; beside a table [{key}] the key {key} is called {inner}, and stands below [{key}]"
    return hint


def from_environment(environ: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """By key, the values of variables that are set and not empty; and the names of variables that are no settings.

    Variables of container platforms are ignored. Raises SettingsError for a name that is nearly that of a setting.
    """
    found: dict[str, str] = {}
    strange: list[str] = []
    for name, value in environ.items():
        key = name.removeprefix(ENVIRONMENT).lower()
        if not name.startswith(ENVIRONMENT) or not value:
            continue
        if key in KEYS:
            found[key] = value
        elif SERVICE.fullmatch(name) or (PORT.fullmatch(name) and "://" in value):
            continue  # a container platform sets it, for a service called gestured, or gestured-something
        elif near := _near(key, KEYS):
            variable = ENVIRONMENT + near.upper()
            raise SettingsError(f"{name} = {value!r} (environment): unknown key, did you mean {variable}?")
        else:
            strange.append(name)
    return found, strange


def _near(key: str, known: Sequence[str]) -> str | None:
    """The known key that is nearest to this one; None if none is near."""
    import difflib

    return next(iter(difflib.get_close_matches(key, known, 1)), None)


def _keys_at(place: tuple[Any, ...]) -> tuple[str, ...]:
    """The keys that may stand in the table of the last key of `place`, a path of keys in the file."""
    part: type[Part] = Settings
    names = iter(place[:-1])
    for name in names:
        kind = part.model_fields[name].annotation
        part = next(one for one in (kind, *get_args(kind)) if isinstance(one, type) and issubclass(one, Part))
        if get_origin(kind) is dict:
            next(names, None)  # the user's name of the table
    inside = [key for table, key in INSIDE.values() if place[:-1] == (table,)]
    return tuple(dict.fromkeys([*(TITLES.get(name, name) for name in part.model_fields), *inside]))


def _explain(problem: Mapping[str, Any], sources: Mapping[str, str]) -> str:
    place = tuple(part for part in problem["loc"] if part not in ("[key]",))
    source = sources.get(str(place[0]), "default")
    key = ".".join((as_written(str(place[0]), sources), *map(str, place[1:])))
    if problem["type"] == "missing":
        return f"{key} ({source}): is missing"
    if problem["type"] == "extra_forbidden":
        known, name = _keys_at(place), str(place[-1])
        near = _near(name, known)
        hint = f"did you mean {near}?" if near else f"expected one of {', '.join(known)}"
        if len(place) > 1 and name in FLAGS:  # in TOML all that stands below a table's title is part of the table
            hint = f"expected {name} above the first [table] of the file"
        said = f"unknown key, {hint}"
    elif problem["type"] in ("model_type", "dict_type"):
        said = f"expected a table [{key}]"
    else:
        said = expected(problem)
    return f"{key} = {problem['input']!r} ({source}): {said}"


def load_settings(flags: Mapping[str, Any], environ: Mapping[str, str]) -> tuple[Settings, dict[str, str]]:
    """Merge and validate the settings. `flags` holds only what was given on the command line, and `config`.

    Returns the settings, and the source of each key that was set. Raises SettingsError.
    """
    environment, _ = from_environment(environ)
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
        settings = Settings.model_validate(merged, context={*environment, *flags})
    except ValidationError as error:
        problems = error.errors(include_url=False, include_context=False)
        raise SettingsError("; ".join(dict.fromkeys(_explain(problem, sources) for problem in problems))) from error
    settings._sources = sources
    return settings, sources
