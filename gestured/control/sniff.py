"""`gesturectl sniff`: which OSC messages arrive, and what to set for them."""

import argparse
import base64
import errno
import re
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby

from gestured.client.address import host_port
from gestured.client.holder import bind_failure
from gestured.client.lines import Unreachable
from gestured.client.say import say, shown, tell
from gestured.control.address import add_sockets, connect, finish_on_signals
from gestured.core import osc
from gestured.core.address import Address
from gestured.core.errors import GesturedError, ProtocolError
from gestured.core.wire import is_sensor

USUAL = "/{sensor}/pressure"
LEAST_TAXELS = 4  # 2 x 2
MOST_ADDRESSES = 256  # addresses; what comes after that is counted together
SHOWN_CHARACTERS = 80  # characters of an address or of type tags
LONGEST_ADDRESS = 255  # characters of an address that is proposed
TRAJECTORY = "/trajectory"


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "sniff",
        help="show which OSC messages arrive",
        description="Show the OSC messages that reach the daemon (or, with --listen, a port where no daemon is),\n"
        "with type tags and rates, and propose [addresses] and grid for them.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="examples:\n  gesturectl sniff --seconds 3\n  gesturectl sniff --listen 0.0.0.0:9000",
    )
    parser.add_argument("--seconds", type=float, default=5.0, metavar="S", help="how long (default: 5)")
    parser.add_argument("--listen", type=host_port, metavar="HOST:PORT", help="a UDP address that nobody has")
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print what was seen as JSON")
    parser.set_defaults(run=run)


@dataclass
class Seen:
    """What came to one address with one kind of arguments."""

    address: str
    types: str
    count: int = 0
    first: float = 0.0  # s
    last: float = 0.0
    sources: set[str] = field(default_factory=set)

    @property
    def rate_hz(self) -> float:
        """Messages a second, 0 for a single one."""
        return (self.count - 1) / (self.last - self.first) if self.last > self.first else 0.0


def run(args: argparse.Namespace) -> int:
    """Look, and say what was there; exit status 1 where nothing came."""
    if not 0 < args.seconds <= 86_400:
        raise GesturedError(f"--seconds {args.seconds:g}: expected more than 0, at most 86400")
    sight = Sight()
    try:
        for t, source, packet in _listen(args.listen, args.seconds) if args.listen else _tap(args):
            sight.packet(t, source, packet)
    except KeyboardInterrupt:
        pass
    rows = sight.rows()
    found = [
        {"address": s.address, "types": s.types, "count": s.count, "rate_hz": round(s.rate_hz, 2),
         "sources": sorted(s.sources)} for s in rows
    ]  # fmt: skip
    summary = {"packets": sight.packets, "messages": found, "errors": sight.errors, "proposed": propose(rows)}
    tell(args.json, summary, *lines(sight))
    return 0 if rows else 1


def lines(sight: "Sight") -> Iterator[str]:
    """What was seen, for a person, and what to set."""
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
        if _taxels(s.types) and len(s.sources) > 1:
            several = "has several senders: the daemon takes the first; give each sensor a name of its own"
            yield f"  {shown(s.address, SHOWN_CHARACTERS)} {several}"
        if _taxels(s.types) and _sensor(s.address) is None and not s.address.endswith(TRAJECTORY):
            unsafe = f"is not proposed: expected parts of A-Z a-z 0-9 _ - . and at most {LONGEST_ADDRESS} characters"
            yield f"  {shown(s.address, SHOWN_CHARACTERS)} {unsafe}"
    yield ""
    yield from propose(rows) or ["nothing that looks like a pressure frame"]


class Sight:
    """What was seen; bounded whatever arrives."""

    def __init__(self) -> None:
        self.packets = 0
        self.seen: dict[tuple[str, str], Seen] = {}
        self.errors: Counter[str] = Counter()

    def rows(self) -> list[Seen]:
        """Each address with each kind of arguments, the most frequent first."""
        return sorted(self.seen.values(), key=lambda seen: -seen.count)

    def packet(self, t: float, source: str, packet: bytes) -> None:
        """Take one packet, read at `t` s."""
        self.packets += 1
        errors: list[ProtocolError] = []
        try:
            messages = osc.decode(packet, errors)
        except ProtocolError as error:
            messages, errors = [], [error]
        self.errors.update(error.reason for error in errors)
        for message in messages:
            key = message.address, short_types(message)
            if key not in self.seen and len(self.seen) >= MOST_ADDRESSES:
                key = "(others)", ""
            seen = self.seen.setdefault(key, Seen(*key, first=t))
            seen.count += 1
            seen.last = t
            if len(seen.sources) < 4:
                seen.sources.add(source)


def short_types(message: osc.Message) -> str:
    """Type tags with runs written as a number, such as `i f*81`; a blob with its size, as `b[162]`."""
    words = []
    sizes = iter([len(a) for a in message.args if isinstance(a, bytes)])
    for tag, run_of in groupby(message.types):
        count = len(list(run_of))
        if tag == "b":
            words += [f"b[{next(sizes)}]" for _ in range(count)]
        else:
            words.append(tag if count == 1 else f"{tag}*{count}")
    return " ".join(words)


def propose(rows: list[Seen]) -> list[str]:
    """Lines for the configuration file, from what looks like frames: many numbers, or one blob, again and again.

    Anybody may have sent them. So there is nothing in these lines but numbers and names that were checked, whose
    characters mean nothing in TOML.
    """
    patterns: Counter[str] = Counter()
    sizes: dict[tuple[str, str], tuple[int, ...]] = {}
    for seen in rows:
        taxels, split = _taxels(seen.types), _sensor(seen.address)
        if taxels and split is not None:
            patterns[split[0]] += seen.count
            sizes.setdefault(split, taxels)
    if not patterns:
        return []
    pressure, *others = [pattern for pattern, _ in patterns.most_common()]
    lines = [] if pressure == USUAL else ["[addresses]", f'pressure = "{pressure}"']
    for (pattern, name), taxels in sizes.items():
        if pattern != pressure:
            continue
        sides = [round(size**0.5) for size in taxels if round(size**0.5) ** 2 == size]
        if 9 not in sides:
            grid = f"{sides[0]}x{sides[0]}" if sides else f"ROWSxCOLUMNS, of {' or '.join(map(str, taxels))} in all"
            lines += [f"[sensors.{name}]", f'grid = "{grid}"']
    lines = lines or ["the defaults fit what arrives"]
    return lines + [f"# {other} looks like frames, too; a daemon takes one pattern" for other in others]


def _taxels(types: str) -> tuple[int, ...]:
    """How many taxels a message of these types may hold, the likeliest first; () where it is no frame."""
    if match := re.fullmatch(r"(?:i )?b\[(\d+)\]", types):  # of uint16, float32 or uint8
        size = int(match[1])
        return tuple(size // n for n in (2, 4, 1) if size % n == 0 and size // n >= LEAST_TAXELS)
    if match := re.fullmatch(r"(?:i )?[fi]\*(\d+)", types):
        size = int(match[1])
        found = (size, size - 1) if types.startswith("i*") else (size,)  # with a counter before them
        return tuple(n for n in found if n >= LEAST_TAXELS)
    return ()


def _sensor(address: str) -> tuple[str, str] | None:
    """(pattern, sensor) of an address: the last part but one that can be a name, else the last.

    None where there is none, or where a part could be more than a name.
    """
    if (
        address.endswith(TRAJECTORY)
        or len(address) > LONGEST_ADDRESS
        or not re.fullmatch(r"(/[A-Za-z0-9_.-]+)+", address)
    ):
        return None
    parts = address.split("/")[1:]
    places = [i for i, part in enumerate(parts) if is_sensor(part)]
    if not places:
        return None
    place = places[0] if len(places) == 1 else places[-2]
    pattern = "/".join(["", *parts[:place], "{sensor}", *parts[place + 1 :]])
    return pattern, parts[place]


def _tap(args: argparse.Namespace) -> Iterator[tuple[float, str, bytes]]:
    with connect(args) as control:
        finish_on_signals(control)
        control.ask("tap")
        timer = threading.Timer(args.seconds, control.finish)
        timer.daemon = True
        timer.start()
        for line in control.lines():
            if line["type"] == "packet":
                yield line["t_ns"] / 1e9, str(Address(*line["source"])), base64.b64decode(line["data"])
        if not control.finished:
            raise Unreachable("the daemon closed the connection")


def _listen(address: Address, seconds: float) -> Iterator[tuple[float, str, bytes]]:
    try:
        family, kind, _, _, where = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)[0]
        receiver = socket.socket(family, kind)
        receiver.bind(where)
    except OSError as error:
        hint = "; without --listen I ask the daemon that has it" if error.errno == errno.EADDRINUSE else ""
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
