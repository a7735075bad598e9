"""`gesturectl record`: write the packets and events of a running daemon into a tape."""

import argparse
import base64
import queue
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from gestured.client.control import Control
from gestured.client.lines import Unreachable, read_ahead
from gestured.client.program import Commands
from gestured.client.say import say, tell
from gestured.client.stop import on_stop
from gestured.client.values import number
from gestured.control.address import add_sockets, connect, finish, finish_after
from gestured.core.address import Address
from gestured.record.tape_writer import Writer

FLUSH_S = 1.0  # a crash or a power cut costs at most so much of a recording
WAITING_LINES = 50_000  # the most lines that wait here; the daemon counts those that find no room


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "record",
        help="record packets and events",
        description="Record what reaches the daemon, packet by packet as it came, and the events that it makes of\n"
        "it, as MCAP. The daemon hands both over (no second listener, nothing slips past); what a slow\n"
        "disk makes it lose is counted. The file is new, and good up to the last second whatever happens.",
        epilog="examples:\n  gesturectl record drive.mcap --seconds 60\n  gesturectl record night.mcap --max-mib 2048",
    )
    parser.takes("file", "FILE", "what to write; must not exist", type=Path)
    parser.takes("--seconds", "S", "end after so long (default: at Ctrl-C)", type=number(0.001, 1e9))
    most = number(1, 1 << 20, whole=True)
    parser.takes("--max-mib", "N", "end at this size (default: 1024)", type=most, default=1024)
    add_sockets(parser)
    parser.runs(run, "print the summary as JSON")


def run(args: argparse.Namespace) -> int:
    """Record until the time is over, the file is full, or Ctrl-C; 1 if lines were lost. Raises Unreachable."""
    with connect(args) as control:
        on_stop(partial(finish, control))  # what the daemon has sent by then is still recorded
        scene = control.ask("tap")
        with Writer(args.file, scene, args.max_mib << 20) as tape:
            say(f"recording into {args.file}; Ctrl-C ends", to=sys.stderr)
            if args.seconds:
                finish_after(control, args.seconds)
            with control.reading():
                keeper = Keeper(tape, scene)
                why = keeper.follow(control)
    summary = {"file": str(args.file), "packets": keeper.packets, "events": keeper.events, "lost": keeper.lost}
    lost = f", {keeper.lost} lost: this disk is too slow" if keeper.lost else ""
    words = f"{args.file}: {keeper.packets} packets, {keeper.events} events{lost}; ended: {why}"
    tell(args.json, summary | {"ended": why}, words)
    if why == GONE:
        raise Unreachable(f"the daemon closed the connection; {args.file} is good up to there")
    return 1 if keeper.lost else 0


GONE = "the daemon went"


class Keeper:
    """Puts the lines of a tap into a tape."""

    def __init__(self, tape: Writer, scene: Mapping[str, Any]) -> None:
        """`scene` is the daemon's answer to `tap` or `flight`."""
        self.scene = scene
        self._tape, self._epoch_ns = tape, scene["epoch_ns"]
        self._t_ns = time.time_ns()
        self.packets = self.events = self.lost = 0

    def keep(self, line: Mapping[str, Any]) -> None:
        """Put one line of the tap onto the tape."""
        if line["type"] == "packet":
            self._t_ns = line["t_ns"] + self._epoch_ns
            self._tape.packet(self._t_ns, str(Address(*line["source"])), base64.b64decode(line["data"]))
            self.packets += 1
        elif line["type"] == "lost":
            self.lost += line["count"]
        else:
            self._tape.event(self._t_ns, line)
            self.events += 1

    def follow(self, control: Control) -> str:
        """Keep the lines that come until the daemon hangs up or the file is full; returns the reason."""
        lines, flushed = read_ahead(control.lines(), WAITING_LINES), 0.0
        while not self._tape.full:
            with suppress(queue.Empty):
                line = lines.get(timeout=FLUSH_S / 4)
                if line is None:
                    return "as asked" if control.finished else GONE
                self.keep(line)
            if time.monotonic() > flushed + FLUSH_S:
                self._tape.flush()
                flushed = time.monotonic()
        return "the file is as large as it may be"
