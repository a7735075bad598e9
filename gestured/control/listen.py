"""`gesturectl listen`: print events as they come."""

import argparse
import sys
import time
from datetime import datetime
from functools import partial
from typing import Any

from gestured.client.lines import Unsubscribed
from gestured.client.program import Commands
from gestured.client.say import say, say_drawn, say_json
from gestured.client.subscriber import Subscriber
from gestured.client.values import number, some_of
from gestured.control.address import add_sockets, event_path
from gestured.control.show import clock, said_when
from gestured.control.status import listens
from gestured.core.messages import EVENT_TYPES

TIMES = ("decided", "onset", "offset", "t", "time", "since")  # keys for the time of an event, the first found is shown


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "listen",
        help="print events as they come",
        description="Connect to the daemon's event socket and print events as they come.",
        epilog="examples:\n  gesturectl listen --types gesture,unknown\n"
        "  gesturectl listen --types gesture,provisional\n"
        "  gesturectl listen --json --gesture swipe_left --count 1",
    )
    add_sockets(parser)
    text = f"comma-separated, of {', '.join(EVENT_TYPES)} (default: gesture)"
    parser.add_argument("--types", type=some_of(EVENT_TYPES), help=text)
    parser.takes("--sensor", "NAME", "only this sensor; may be repeated", action="append")
    parser.takes("--gesture", "NAME", "only this gesture; may be repeated", action="append")
    parser.takes("--zone", "NAME", "only what began in this zone; may be repeated", action="append")
    parser.takes("--count", "N", "end after N events", type=number(1, 10**9, whole=True))
    parser.add_argument("--reconnect", action="store_true", help="wait for a daemon that is not there (any more)")
    parser.runs(run, "print the daemon's own lines, the hello among them")


def run(args: argparse.Namespace) -> int:
    """Print until the count is reached, the daemon ends, or Ctrl-C; returns 2 if the subscription is refused."""
    wanted = {"types": args.types, "sensors": args.sensor, "gestures": args.gesture, "zones": args.zone}
    left = args.count
    early: dict[str, dict[str, Any]] = {}  # by sensor: the provisional event before its answer, for `readable`
    told = partial(say, to=sys.stderr)
    try:
        with Subscriber(event_path(args), **wanted, reconnect=args.reconnect, say=told) as subscriber:
            for line, event in subscriber.lines():
                kind = event.get("type")
                if args.json:
                    _repeat(line, event)
                elif kind == "hello":
                    names = ", ".join(event["sensors"]) or "none yet"
                    told(f"gestured {event['version']}, model {event['model']}, sensors: {names}")
                elif kind == "gestures":
                    told(f"gestures: {', '.join(event['gestures'])}")
                else:
                    say(readable(event, early))
                if left is not None and kind not in ("hello", "lost", "gestures"):
                    left -= 1
                    if left <= 0:
                        return 0
    except Unsubscribed as error:
        told(f"gesturectl: {error}")
        return 2
    return 0


def readable(event: dict[str, Any], before: dict[str, dict[str, Any]]) -> str:
    """One event as a line for a person; each sensor's last provisional event is kept in `before` for its answer."""
    kind, sensor = event.get("type"), event.get("sensor", "-")
    early = before.pop(sensor, None)
    moment = next((event[key] for key in TIMES if event.get(key) is not None), time.time())
    head = f"{clock(moment):<12}  {sensor:<12} "
    if kind in ("gesture", "unknown"):
        number = f"#{event['sequence']}" if kind == "gesture" else ""
        waited = 1000 * (event["decided"] - event["offset"])
        tail = f"  {went(where)}" if (where := event.get("where")) else ""
        tail += f"  by {event['model']}, degraded" if event["degraded"] else ""
        if early is not None and event.get("provisional"):
            when = said_when(early["decided"], event["offset"])
            tail += f"  {event['provisional']}: {early['gesture']}, {when}"
        tail += "  (test)" if event.get("test") else ""
        gates = f": {', '.join(event['gates'])}" if event.get("gates") else ""
        why = f"unknown ({event['reason']}{gates})" if "reason" in event else "unknown"
        name = f"{event.get('gesture', why):<24} {event['confidence']:4.2f}"
        return f"{head}{name}  {number:<6} {waited:4.0f} ms{tail}"
    if kind == "provisional":
        before[sensor] = event
        return f"{head}{event['gesture'] + '?':<24} {event['confidence']:4.2f}  provisional"
    if kind == "touch":
        what = f"touch {event['touch']} {event['phase']}" + (f" ({event['reason']})" if event.get("reason") else "")
        return f"{head}{what:<24} {event['x']:.2f},{event['y']:.2f}  {event['pressure']:g} counts"
    if kind == "gate":
        until = datetime.fromtimestamp(event["until"]).strftime(", until %H:%M:%S") if event["until"] else ""
        return f"{head}{listens(event)}{until}"
    if kind == "status":
        sensors = ", ".join(f"{name} {state}" for name, state in sorted(event["sensors"].items()))
        return f"{head}status: {event['state']} ({sensors or 'no sensor'})"
    if kind == "cancelled":
        tail = f"  revoked: {early['gesture']}" if early is not None and event.get("provisional") else ""
        return f"{head}cancelled: {event['reason']}{tail}"
    if kind == "lost":
        return f"{head}{event['count']} events lost: this reader was too slow"
    if kind == "release":
        return f"{head}release (the finger left at this time)"
    return f"{head}{kind}"


def went(where: dict[str, Any]) -> str:
    """Where a contact began and ended, in words: x to the right and y upward, as fractions of the sensor."""
    start, end = (f"{where[key]['x']:.2f},{where[key]['y']:.2f}" for key in ("start", "end"))
    zone = f" ({where['zone']})" if where.get("zone") else ""
    return f"from {start}{zone} to {end}" if where["way"] else f"at {start}{zone}"


def _repeat(line: str, event: dict[str, Any]) -> None:
    """Print the daemon's line unchanged, or escaped if it is more than printable ASCII."""
    if line.isascii() and line.isprintable():
        say_drawn(line)
    else:
        say_json(event)
