"""`--control` and `--socket`: the daemon that an operator means."""

import argparse
import os
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

from gestured.client.address import SOCKET_PATH, control_beside, find_control, find_socket, running, setting
from gestured.client.control import Control
from gestured.client.lines import Forbidden, Unreachable
from gestured.client.program import Parser

LAST_S = 3.0  # how long the last lines of the daemon are waited for after `finish`


def add_sockets(parser: Parser) -> None:
    """Add `--control` and `--socket` to a subcommand: either is enough to find the daemon."""
    for flag, what in (("--control", "control"), ("--socket", "event")):
        text = f"the daemon's {what} socket; one of the two is enough (default: of your session, else the service)"
        parser.takes(flag, "PATH", text, type=_path)


def _path(text: str) -> Path:
    path = Path(text)
    if not path.name:  # such as the empty text of a shell variable that is not set
        raise argparse.ArgumentTypeError(f"{text!r}: expected {SOCKET_PATH}")
    return path


def control_path(args: argparse.Namespace) -> Path:
    """The control socket that `--control` or `--socket` means."""
    if args.control is None and args.socket is not None:
        return control_beside(args.socket)
    return args.control or find_control(os.environ)


def event_path(args: argparse.Namespace) -> Path:
    """The event socket of `--socket`, or of the daemon on `--control`. Raises SettingsError, Unreachable, Refused."""
    if args.socket is not None:
        return Path(args.socket)
    control = args.control
    if control is None and setting(os.environ, "socket") is None:
        control = setting(os.environ, "control")
    if control is None:
        return find_socket(os.environ)
    with Control(Path(control)) as daemon:
        status = daemon.ask("status")
        with daemon.reading():
            return Path(status["addresses"]["socket"])


def finish(control: Control) -> None:
    """Let `control.lines()` end after what the daemon has sent by now, or after LAST_S, since the daemon may hang."""
    control.finish()
    _later(LAST_S, control.close)


def finish_after(control: Control, seconds: float) -> None:
    """Let `control.lines()` end after so many seconds."""
    _later(seconds, partial(finish, control))


def _later(seconds: float, act: Callable[[], object]) -> None:
    timer = threading.Timer(seconds, act)
    timer.daemon = True
    timer.start()


def connect(args: argparse.Namespace) -> Control:
    """A connection to the daemon that `--control` or `--socket` names. Raises Unreachable."""
    path = control_path(args)
    try:
        return Control(path)
    except Forbidden:
        raise
    except Unreachable as error:
        others = running()
        if not others or path in others:
            raise
        named = ", ".join(str(other.with_suffix(".sock")) for other in others)
        said = f"one runs on {named}: if its socket or control setting was changed since its start, restart it"
        raise Unreachable(f"{error}; {said}") from None
