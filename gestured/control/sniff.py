"""`gesturectl sniff`: print which OSC messages arrive, and what to set for them."""

import argparse
import base64
import errno
import re
import socket
import sys
import time
from collections.abc import Iterator
from functools import partial

from gestured.client.address import bind_failure, look_up
from gestured.client.control import Control
from gestured.client.lines import Unreachable
from gestured.client.program import Commands
from gestured.client.say import say, shown, tell
from gestured.client.stop import on_stop
from gestured.client.values import host_port, number
from gestured.control.address import add_sockets, connect, finish, finish_after
from gestured.control.proposal import TRAJECTORY, propose, split_address
from gestured.control.sight import Seen, Sight
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.core.scene import Scene
from gestured.record.replay import maker

SHOWN_CHARACTERS = 80  # the most characters of an address, or of type tags, that are printed
NOT_TAKEN = {"d": "doubles", "h": "64-bit integers"}  # by type tag: numbers that the daemon does not take


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "sniff",
        help="show which OSC messages arrive",
        description="Show the OSC messages that reach the daemon (or, with --listen, a port where no daemon is),\n"
        "with type tags and rates, and propose [addresses] and grid for them.",
        epilog="examples:\n  gesturectl sniff --seconds 3\n  gesturectl sniff --listen 0.0.0.0:9000",
    )
    seconds = number(0.001, 86_400)
    parser.takes("--seconds", "S", "how long (default: 5)", type=seconds, default=5.0)
    parser.takes("--listen", "HOST:PORT", "listen at this UDP address itself; no daemon may have it", type=host_port)
    add_sockets(parser)
    parser.runs(run, "print what was seen as JSON")


def run(args: argparse.Namespace) -> int:
    """Listen, then print what arrived and what to set; returns 1 if no message looks like a frame."""
    sight, told = Sight(), None
    try:
        if args.listen:
            for t, source, packet in _listen(args.listen, args.seconds):
                sight.packet(t, source, packet)
        else:
            with connect(args) as control:
                on_stop(partial(finish, control))  # what the daemon has sent by then is still seen
                told = overhear(control, args.seconds, sight)
    except KeyboardInterrupt:
        pass
    rows = sight.rows()
    found = [
        {"address": s.address, "types": s.types, "count": s.count, "rate_hz": round(s.rate_hz, 2),
         "sources": sorted(s.sources)} for s in rows
    ]  # fmt: skip
    proposed = propose(rows, told)
    summary = {"packets": sight.packets, "messages": found, "errors": sight.errors, "proposed": proposed}
    tell(args.json, summary, *lines(sight, proposed))
    return 0 if proposed else 1


def overhear(control: Control, seconds: float, sight: Sight) -> Scene:
    """Give `sight` the packets that reach the daemon for so long; returns the daemon's scene. Raises GesturedError."""
    scene = maker(control.ask("tap")).scene
    finish_after(control, seconds)
    with control.reading():
        for line in control.lines():
            if line["type"] == "packet":
                sight.packet(line["t_ns"] / 1e9, str(Address(*line["source"])), base64.b64decode(line["data"]))
    if not control.finished:
        raise Unreachable("the daemon closed the connection")
    return scene


def lines(sight: Sight, proposed: list[str]) -> Iterator[str]:
    """What was seen and what to set, in lines for a person."""
    yield f"{sight.packets} packets"
    if not sight.packets:
        yield "nothing arrives: is the sensor powered, does it send to this address, does a firewall keep it out?"
        return
    rows = sight.rows()
    for s in rows:
        senders = ", ".join(sorted(s.sources))
        address, types = shown(s.address, SHOWN_CHARACTERS), shown(s.types, SHOWN_CHARACTERS)
        yield f"  {address:<32} ,{types:<16} {s.count:6d}  {s.rate_hz:7.1f} Hz  from {senders}"
    for reason, count in sight.errors.items():
        yield f"  {count} packets are no OSC: {reason}"
    for s in rows:
        yield from _remarks(s)
    if sight.arrays:
        yield "  arrays are not taken: send f, one after the other and without [ ]"
    yield ""
    yield from proposed or ["nothing that looks like a pressure frame"]


def _remarks(seen: Seen) -> Iterator[str]:
    """What may be wrong with the messages to one address, in lines for a person."""
    address = shown(seen.address, SHOWN_CHARACTERS)
    if (found := re.search(r"([dh])\*\d+", seen.types)) is not None:
        yield f"  {address}: {NOT_TAKEN[found[1]]} are not taken: send f"
    if not seen.taxels():
        return
    if seen.contested:
        several = "has several senders: the daemon takes the first; give each sensor a name of its own"
        yield f"  {address} {several}"
    if split_address(seen.address) is None and not seen.address.endswith(TRAJECTORY):
        yield f"  {address} is not proposed: expected parts of A-Z a-z 0-9 _ - ."


def _listen(address: Address, seconds: float) -> Iterator[tuple[float, str, bytes]]:
    try:
        family, where = look_up(address, socket.SOCK_DGRAM)
        receiver = socket.socket(family, socket.SOCK_DGRAM)
        receiver.bind(where)
    except OSError as error:
        hint = "; without --listen, sniff asks the daemon that listens there" if error.errno == errno.EADDRINUSE else ""
        reason = bind_failure(error, address, socket.SOCK_DGRAM)
        raise GesturedError(f"cannot listen on {address}: {reason}{hint}") from error
    with receiver:
        end = time.monotonic() + seconds
        say(f"listening on {address}", to=sys.stderr)
        while (left := end - time.monotonic()) > 0:
            receiver.settimeout(left)
            try:
                packet, source = receiver.recvfrom(65_536)
            except TimeoutError:
                return
            yield time.monotonic(), str(Address(*source[:2])), packet
