"""The options and helpers that the bridges' command lines share."""

import argparse
import importlib
import os
import re
import socket
from collections.abc import Callable
from pathlib import Path

from gestured.client.address import find_socket
from gestured.client.program import Parser
from gestured.client.subscriber import Subscriber
from gestured.client.values import bind_address, host_port, some_of
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.core.messages import EVENT_TYPES

# s, from one attempt to reach a bus to the next; doubled each time up to a bound that finds a returning bus soon.
FIRST_S, LONGEST_S = 0.25, 2.0
STATUS = "status"  # the type of the line with the states of all sensors, which comes once a second


class BridgeError(GesturedError):
    """The bridge cannot do what it was asked, and waiting would not help."""


def need(module: str, package: str, extra: str) -> None:
    """Check that the library of a bus is installed, before anything else. Raises BridgeError."""
    try:
        importlib.import_module(module)
    except ImportError:
        remedy = f"pip install 'gestured[{extra}]', or make bridges"
        raise BridgeError(f"this bridge needs the package {package}: {remedy}") from None


def add_filters(parser: Parser) -> None:
    """Add the flags for the daemon's event socket and the subscription's filters."""
    parser.takes("--socket", "PATH", "the daemon's event socket (default: the daemon's own default)", type=Path)
    text = f"which events, with commas, of {', '.join(EVENT_TYPES)} (default: gesture)"
    parser.takes("--types", "A,B", text, type=some_of(EVENT_TYPES), default=["gesture"])
    parser.takes("--sensors", "A,B", "only these sensors (default: all)", type=names)
    parser.takes("--gestures", "A,B", "only these gestures (default: all)", type=names)


def add_metrics(parser: Parser) -> None:
    """Add the flag for the address of /metrics."""
    text = "HTTP address of /metrics; port 0 takes any free port (default: off)"
    parser.takes("--metrics", "HOST:PORT", text, type=bind_address)


def add_destination(parser: Parser) -> None:
    """Add the flag for the daemon that takes frames."""
    text = "where the daemon listens for frames (default: 127.0.0.1:9000)"
    parser.takes("--to", "HOST:PORT", text, type=host_port, default=Address("127.0.0.1", 9000))


def plain(name: str) -> str:
    """A name with _ in place of all but letters, digits, _ and -, as Home Assistant's discovery requires."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)


def host_name(named: str | None) -> str:
    """The plain name that was given, else this machine's."""
    return plain(named or socket.gethostname())


def names(text: str) -> list[str]:
    """The names between commas. Raises argparse.ArgumentTypeError if there are none."""
    found = [word.strip() for word in text.split(",") if word.strip()]
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r}: expected names with commas between them")
    return found


def peer_address(text: str, port: int) -> Address:
    """HOST or HOST:PORT of a peer, with `port` if none is named. Raises argparse.ArgumentTypeError."""
    return host_port(text if text.rpartition(":")[2].isdigit() and text.count(":") != 0 else f"{text}:{port}")


def subscriber(args: argparse.Namespace, timeout: float, wrong: Callable[[str], None]) -> Subscriber:
    """A subscription to the wanted events and to `status`; iterating raises TimeoutError after `timeout` s without one.

    `wrong` is called with a sentence about each line that no daemon sends.
    """
    types = [*args.types, *({STATUS} - set(args.types))]
    path = args.socket or find_socket(os.environ)
    return Subscriber(path, types=types, sensors=args.sensors, gestures=args.gestures, timeout=timeout, say=wrong)
