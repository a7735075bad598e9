"""The command line of gestured-bridge: one file per bus."""

import argparse
import sys
from collections.abc import Sequence

import gestured
from gestured.bridge import mqtt, serial, zenoh
from gestured.client.lines import JOIN, Forbidden
from gestured.client.say import say
from gestured.core.errors import GesturedError

BRIDGES = (mqtt, zenoh, serial)


def parser() -> argparse.ArgumentParser:
    """The whole command line; each bridge adds itself and sets `run`."""
    top = argparse.ArgumentParser(
        prog="gestured-bridge",
        description="Connects gestured to other buses, and sensors on serial lines to gestured.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="examples:\n  gestured-bridge mqtt --broker 192.168.7.2\n"
        "  gestured-bridge zenoh --connect tcp/192.168.7.2:7447 --site car7\n"
        "  gestured-bridge serial /dev/ttyUSB0 --protocol flexitac --sensor glove --grid 16x32",
    )
    top.add_argument("--version", action="version", version=f"gestured-bridge {gestured.__version__}")
    commands = top.add_subparsers(metavar="BRIDGE", required=True)
    for module in BRIDGES:
        module.add(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one bridge until it is ended; returns the exit status (0 ended as asked, 1 it cannot work, 2 usage)."""
    args = parser().parse_args(argv)
    try:
        status: int = args.run(args)
        return status
    except GesturedError as error:
        remedy = f" ({JOIN})" if isinstance(error, Forbidden) else ""
        say(f"gestured-bridge: {error}{remedy}", to=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0
