"""The command line of gestured-bridge; each bus has a module of its own."""

from collections.abc import Sequence
from importlib import import_module

from gestured.client.program import Parser, program, run

BRIDGES = ("mqtt", "zenoh", "serial")


def parser() -> Parser:
    """The whole command line; each bridge adds itself and sets `run`."""
    top, bridges = program(
        "gestured-bridge",
        "BRIDGE",
        description="Connects gestured to other buses, and sensors on serial lines to gestured.",
        epilog="examples:\n  gestured-bridge mqtt --broker 192.168.7.2\n"
        "  gestured-bridge zenoh --connect tcp/192.168.7.2:7447 --site car7\n"
        "  gestured-bridge serial /dev/ttyUSB0 --protocol flexitac --sensor glove --grid 16x32",
    )
    for name in BRIDGES:
        import_module(f"gestured.bridge.{name}").add(bridges)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one bridge until it is ended; returns the exit status (0 ended, 1 cannot work, 2 wrong usage)."""
    return run(parser, argv, 0)
