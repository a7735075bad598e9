"""The types of settings: how a value is written, and what was expected if it is written otherwise."""

import ipaddress
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, ValidationInfo

from gestured.client.address import SOCKET_PATH, SOCKET_PATH_BYTES, named
from gestured.core.address import Address, Grid, is_sensor

SCHEMES = ("osc", "tuio")  # of destinations
SWITCH, NUMBER, COUNT = "true or false", "a number", "a whole number"
# What was expected, by pydantic's type of an error, for errors whose own message speaks of Python's types.
WORDS = {
    "tuple_type": "a list",
    "too_long": "four numbers",  # of a zone; no other list has a length of its own
    "string_too_short": "a text that is not empty",
    **dict.fromkeys(("string_type", "string_unicode"), "a text"),
    **dict.fromkeys(("bool_type", "bool_parsing"), SWITCH),
    **dict.fromkeys(("float_type", "float_parsing"), NUMBER),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), COUNT),
}


class Destination(NamedTuple):
    """Where events are sent, and how. As a text SCHEME://HOST:PORT."""

    scheme: str
    address: Address

    def __str__(self) -> str:
        return f"{self.scheme}://{self.address}"


def expected(problem: Mapping[str, Any]) -> str:
    """What was expected, in words that follow a comma or a colon; `problem` is from a ValidationError's `errors()`."""
    if words := WORDS.get(problem["type"]):
        return f"expected {words}"
    ours = problem["type"] == "value_error"
    message: str = problem["msg"].removeprefix("Value error, " if ours else "Input should be ")
    message = message if ours else message[0].lower() + message[1:]
    return message if "expected" in message else "expected " + message


def _text(value: object) -> str:
    """A text as it is; for any other value an empty text, which is never what was expected."""
    return value if isinstance(value, str) else ""


def _destination(value: object) -> Destination:
    scheme, _, rest = _text(value).partition("://")
    try:
        address = named(rest.rstrip("/"))
        if scheme not in SCHEMES or address.port == 0:
            raise ValueError
    except ValueError:
        expected = "osc://HOST:PORT or tuio://HOST:PORT with a port from 1 to 65535, such as osc://127.0.0.1:9001"
        raise ValueError(expected) from None
    return Destination(scheme, address)


def _name(of: str) -> BeforeValidator:
    def checked(value: object) -> str:
        if not is_sensor(name := _text(value)):
            raise ValueError(f"a {of}'s name, 1 to 64 of A-Z a-z 0-9 _ -")
        return name

    return BeforeValidator(checked)


def _socket(value: object) -> Path:
    path = _named(value, SOCKET_PATH)
    if len(os.fsencode(path)) > SOCKET_PATH_BYTES:
        raise ValueError(SOCKET_PATH)
    return path


def _named(value: object, expected: str) -> Path:
    """A path with a name at its end: `/` and `.` have none, and no name holds a NUL."""
    if not isinstance(value, str | Path) or not Path(value).name or "\0" in str(value):
        raise ValueError(expected)
    return Path(value)


def _network(value: object) -> ipaddress.IPv4Network | ipaddress.IPv6Network:
    """A network; that of IPv4 for `::ffff:a.b.c.d`, as a socket at [::] tells IPv4 senders."""
    try:
        network = ipaddress.ip_network(_text(value), strict=False)
        if getattr(network.network_address, "scope_id", None) is not None:
            raise ValueError  # no packet says its interface, so that this would let in nobody
    except ValueError:
        raise ValueError("an address or a network, such as 127.0.0.1, 192.168.7.0/24 or fd00::/8") from None
    mapped = getattr(network.network_address, "ipv4_mapped", None)
    return network if mapped is None else ipaddress.IPv4Network((mapped, network.prefixlen - 96))


def _typed(expected: str) -> BeforeValidator:
    """A check that refuses texts, and `true` for a number, both of which pydantic would convert.

    Flags and variables hold nothing but text; the context of a validation has the keys that they gave.
    """

    def checked(value: object, field: ValidationInfo) -> object:
        text = isinstance(value, str) and field.field_name not in (field.context or ())
        if text or (isinstance(value, bool) and expected != SWITCH):
            raise ValueError(expected)
        return value

    return BeforeValidator(checked)


def _listed(value: object) -> object:
    """A flag or a variable holds several values with commas between them; the file holds a list."""
    return [word.strip() for word in value.split(",") if word.strip()] if isinstance(value, str) else value


Listed = BeforeValidator(_listed)
Switch = Annotated[bool, _typed(SWITCH)]
Number = Annotated[float, _typed(NUMBER)]
Count = Annotated[int, _typed(COUNT)]
AddressField = Annotated[Address, BeforeValidator(lambda value: named(_text(value)))]
GridField = Annotated[Grid, BeforeValidator(lambda value: Grid.parse(_text(value)))]
NetworkField = Annotated[ipaddress.IPv4Network | ipaddress.IPv6Network, BeforeValidator(_network)]
DestinationField = Annotated[Destination, BeforeValidator(_destination)]
SensorName = Annotated[str, _name("sensor")]
GateName = Annotated[str, _name("gate")]
BridgeName = Annotated[str, _name("bridge")]
SocketField = Annotated[Path, BeforeValidator(_socket)]
FileField = Annotated[Path, BeforeValidator(lambda value: _named(value, "the path of a file"))]
