"""Where the daemon is: the rules for its sockets."""

import argparse
import os
import signal
import tomllib
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
    if path := _setting(environ, "socket"):
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
    if path := _setting(environ, "control"):
        return Path(path)
    return find_socket(environ).with_suffix(".ctl")


def _setting(environ: Mapping[str, str], key: str) -> str | None:
    """A setting of the daemon's that a variable, or the file that a variable names, has; None where neither does."""
    if value := environ.get(f"GESTURED_{key.upper()}"):
        return value
    try:
        with open(environ.get("GESTURED_CONFIG") or os.devnull, "rb") as file:
            value = tomllib.load(file).get(key)
    except (OSError, ValueError):  # what is wrong with the file, the daemon says
        return None
    return value if isinstance(value, str) else None


def add_sockets(parser: argparse.ArgumentParser) -> None:
    """Add `--control` and `--socket` to a subcommand: either is enough to find the daemon."""
    for flag, what in (("--control", "control"), ("--socket", "event")):
        text = f"the daemon's {what} socket (default: the daemon's own default; the other one will do, too)"
        parser.add_argument(flag, type=Path, metavar="PATH", help=text)


def control_path(args: argparse.Namespace) -> Path:
    """The control socket that `--control` or `--socket` means."""
    if args.control is None and args.socket is not None:
        return Path(args.socket).with_suffix(".ctl")  # beside it, as the daemon has it unless told otherwise
    return args.control or find_control(os.environ)


def event_path(args: argparse.Namespace) -> Path:
    """The event socket that `--socket` or `--control` means; of the latter the daemon is asked. Raises Unreachable."""
    if args.socket is not None:
        return Path(args.socket)
    control = args.control
    if control is None and _setting(os.environ, "socket") is None:
        control = _setting(os.environ, "control")
    if control is None:
        return find_socket(os.environ)
    with Control(Path(control)) as daemon:
        return Path(daemon.ask("status")["addresses"]["socket"])


def finish_on_signals(control: Control) -> None:
    """From now on Ctrl-C and SIGTERM let `control.lines()` end, after what the daemon has said by then."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: control.finish())


def connect(args: argparse.Namespace) -> Control:
    """The daemon that `--control` or `--socket` names. Raises Unreachable."""
    return Control(control_path(args))
