"""`gesturectl pad`: a mouse, a touchscreen or a telephone as a sensor."""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path

from gestured.client.engine import Engine
from gestured.client.pad.invitation import invite
from gestured.client.pad.pad import Pad
from gestured.client.pad.server import DEFAULT, PadServer
from gestured.client.program import Commands
from gestured.client.say import say, tell
from gestured.client.stop import stop_as_by_ctrl_c
from gestured.client.values import bind_address, host_port, number, rows_by_columns, sensor_name
from gestured.control.address import add_sockets, event_path
from gestured.core.errors import GesturedError, SettingsError


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "pad",
        help="make a sensor of a mouse, a touchscreen or a telephone",
        description="Serve a page with a pad: what touches it becomes the frames of a simulated textile, and the page\n"
        "says what gestured makes of them. They go to a daemon of its own, or with --to to another one as OSC.\n"
        "Prints the page's address: it works once, and ends after ten minutes without a touch.",
        epilog="examples:\n  gesturectl pad\n  gesturectl pad --to 127.0.0.1:9000 --sensor armrest\n"
        "  gesturectl pad --listen 192.168.1.5:9110",
    )
    text = f"the one address at which the page is served (default: {DEFAULT}; port 0: any)"
    parser.takes("--listen", "HOST:PORT", text, type=bind_address, default=DEFAULT)
    parser.takes("--to", "HOST:PORT", "a daemon that takes the frames (default: one of its own)", type=host_port)
    parser.takes("--sensor", "NAME", "its name (default: pad)", type=sensor_name, default="pad")
    parser.takes("--grid", "RxC", "taxels (default: 9x9)", type=rows_by_columns, default=(9, 9))
    parser.takes("--rate", "HZ", "frames a second (default: 15)", type=number(5, 200), default=15.0)
    parser.add_argument("--model", default="cnn_lstm", help="of its own daemon (default: cnn_lstm)")
    add_sockets(parser)
    parser.runs(run, "print the address as JSON")


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C, SIGTERM, or ten minutes without a touch."""
    stop_as_by_ctrl_c()
    with ExitStack() as held:
        if args.to is None:
            engine = held.enter_context(Engine(args.model, *args.grid))
            to, sockets = engine.listen, [engine.socket]
        else:
            to, sockets = args.to, _sockets(args)
        server = held.enter_context(
            PadServer(args.listen, Pad(to, args.sensor, args.grid, args.rate), "gesturectl pad")
        )
        server.serve(*sockets)
        tell(args.json, {"type": "pad", "address": server.page}, server.page)
        invite(server)
        say("Ctrl-C ends it.", to=sys.stderr)
        server.ended.wait()
    raise GesturedError("nobody touched the pad for ten minutes: its address has ended")


def _sockets(args: argparse.Namespace) -> list[Path]:
    """The event socket on which the daemon tells its answers; none if none is named and there is no default."""
    try:
        return [event_path(args)]
    except SettingsError:
        return []
