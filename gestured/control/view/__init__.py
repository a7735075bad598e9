"""`gesturectl view`: a running daemon as one page in a browser on this machine."""

import argparse
import os
import sys
from pathlib import Path

from gestured.client.program import Commands
from gestured.client.say import say, tell
from gestured.client.stop import stop_as_by_ctrl_c
from gestured.client.values import bind_address
from gestured.control.address import add_sockets, connect, control_path
from gestured.core.address import Address
from gestured.core.errors import GesturedError

NICE = 10  # lowers the priority, since the daemon and programs that send to it come first
DEFAULT = Address("127.0.0.1", 9109)


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "view",
        help="show a sensor in a browser, live",
        description="Serve one page on this machine that shows the matrix as it is felt, the activity and its\n"
        "thresholds, and every answer with its scores. Prints the page's address: it works once, for the\n"
        "browser that opens it. Nothing is opened by itself.",
        epilog="examples:\n  gesturectl view\n  gesturectl view --listen 127.0.0.1:0 --folder flagged",
    )
    text = f"where the page is served, a loopback address (default: {DEFAULT}; port 0: any)"
    parser.takes("--listen", "HOST:PORT", text, type=bind_address, default=DEFAULT)
    text = "folder for flagged recordings, made where there is none (default: .)"
    parser.takes("--folder", "FOLDER", text, type=Path, default=Path())
    add_sockets(parser)
    parser.runs(run, "print the address as JSON")


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C or SIGTERM."""
    from gestured.client.web.door import Door, is_loopback
    from gestured.control.view.server import ViewServer
    from gestured.control.view.source import Source

    stop_as_by_ctrl_c()
    if not is_loopback(args.listen.host):
        raise GesturedError(f"--listen {args.listen}: expected a loopback address, such as {DEFAULT}")
    connect(args).close()  # raises at once if no daemon runs
    try:
        args.folder.mkdir(parents=True, exist_ok=True)  # a fault is shown now, not when a recording is flagged
    except OSError as error:
        raise GesturedError(f"--folder {args.folder}: cannot be made: {error.strerror}") from error
    os.nice(NICE)
    source = Source(control_path(args), args.folder)
    door = Door("gesturectl view")
    with ViewServer(args.listen, source, door) as server:
        tell(args.json, {"type": "view", "address": server.page}, server.page)
        say("Open this address in a browser on this machine; it works once. Ctrl-C ends the view.", to=sys.stderr)
        try:
            server.serve_forever()
        finally:
            source.close()
    return 0
