"""Where the daemon is: the rules for its sockets."""

import argparse
import os
import signal
from collections.abc import Mapping
from pathlib import Path

from gestured.client.control import Control

SYSTEM = Path("/run/gestured/events.sock")  # of the installed service
SHARED = Path("/tmp")  # where a daemon without a session keeps its folder; anybody can make it first


def find_socket(environ: Mapping[str, str]) -> Path:
    """The event socket that is meant where none is named, the first of these.

    What the environment says, as the daemon reads it; that of a daemon in the session; the installed service's; the one
    where a daemon without a session would keep it. Who serves it, `client.peer` looks at.
    """
    if path := environ.get("GESTURED_SOCKET"):
        return Path(path)
    if directory := environ.get("RUNTIME_DIRECTORY"):
        return Path(directory.split(":")[0]) / "events.sock"
    session = environ.get("XDG_RUNTIME_DIR")
    own = (Path(session, "gestured") if session else SHARED / f"gestured-{os.getuid()}") / "events.sock"
    if session and os.path.exists(own):  # unlike Path.exists, no error where we may not look
        return own
    return SYSTEM if SYSTEM.parent.is_dir() else own


def find_control(environ: Mapping[str, str]) -> Path:
    """Where it keeps its control socket: beside the other."""
    if path := environ.get("GESTURED_CONTROL"):
        return Path(path)
    return find_socket(environ).with_suffix(".ctl")


def add_control(parser: argparse.ArgumentParser) -> None:
    """Add `--control` to a subcommand."""
    text = "the daemon's control socket (default: the daemon's own default)"
    parser.add_argument("--control", type=Path, metavar="PATH", help=text)


def finish_on_signals(control: Control) -> None:
    """From now on Ctrl-C and SIGTERM let `control.lines()` end, after what the daemon has said by then."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: control.finish())


def connect(args: argparse.Namespace) -> Control:
    """The daemon that `--control` names. Raises Unreachable."""
    return Control(args.control or find_control(os.environ))
