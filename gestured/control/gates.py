"""`gesturectl inhibit` and `allow`: gates that silence sensors are closed and opened."""

from typing import Any

from gestured.client.program import Commands, Parser
from gestured.control.operate import asks


def add(commands: Commands) -> None:
    """Add `inhibit` and `allow`."""
    parser = commands.add_parser(
        "inhibit",
        help="close a gate, so that a sensor is silent",
        description="Close a gate of a sensor, or of all. While any of its gates is closed, every contact on the\n"
        "sensor is unknown. A gate stays closed until somebody allows it, across reloads too, unless --for\n"
        "says how long.",
        epilog="examples:\n  gesturectl inhibit --all --gate door\n"
        "  gesturectl inhibit armrest --gate cleaning --for 600",
    )
    _which(parser)
    text = "seconds after which the gate opens by itself (default: it does not)"
    parser.add_argument("--for", dest="seconds", type=float, metavar="S", help=text)
    asks(parser, "inhibit", _said, "gate", "sensor", "seconds")
    parser = commands.add_parser(
        "allow",
        help="open a gate",
        description="Open a gate of a sensor, or of all. The sensor listens again once all its gates are open.",
        epilog="examples:\n  gesturectl allow --all --gate door\n  gesturectl allow armrest --gate cleaning",
    )
    _which(parser)
    asks(parser, "allow", _said, "gate", "sensor")


def _which(parser: Parser) -> None:
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("sensor", nargs="?", metavar="SENSOR", help="one sensor")
    which.add_argument("--all", action="store_true", help="all sensors, and all that come")
    parser.add_argument("--gate", required=True, metavar="NAME", help="the gate, by a name of your choice")


def _said(answer: dict[str, Any]) -> str:
    """Which sensors are silent now, and by which gates."""
    silent = [f"{name} ({', '.join(gates)})" for name, gates in answer["sensors"].items() if gates]
    listen = [name for name, gates in answer["sensors"].items() if not gates]
    parts = [f"{word}: {', '.join(names)}" for word, names in (("silent", silent), ("no gate closed", listen)) if names]
    return "; ".join(parts) or f"{answer['gate']}: noted for the sensors that come"
