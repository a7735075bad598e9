"""`gesturectl simulate`: send the frames of a simulated sensor that a simulated person touches."""

import argparse
import sys
from collections.abc import Iterator
from itertools import chain

from gestured.client.lines import read_ahead
from gestured.client.program import Commands
from gestured.client.say import say, tell
from gestured.client.sensor import BLOBS, Form, Sensor
from gestured.client.values import host_port, number, sensor_name
from gestured.control.play import add_arguments, frames, takes
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.core.frames import Frame
from gestured.simulator import Act
from gestured.simulator.places import PLACES


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "simulate",
        help="simulate a sensor that somebody touches",
        description="Send the pressure frames of a simulated person on a simulated textile sensor,\n"
        "as OSC over UDP, in real time. Says what is performed as it ends, to be compared\n"
        "with what the daemon recognises.",
        epilog="examples:\n  gesturectl simulate --to 127.0.0.1:9000 --sensor armrest\n"
        "  gesturectl simulate --kinds swipe_left,double_tap --seconds 30 --blob\n"
        "  gesturectl simulate --everyday seat",
    )
    text = "where the daemon listens (default: 127.0.0.1:9000)"
    parser.takes("--to", "HOST:PORT", text, type=host_port, default=Address("127.0.0.1", 9000))
    parser.takes("--sensor", "NAME", "its name (default: simulated)", type=sensor_name, default="simulated")
    parser.takes("--seconds", "S", "end after so long (default: go on)", type=number(0.001, 1e9))
    text = "everyday contact at a place (default: armrest), in which few gestures are meant; --seed says whose"
    parser.add_argument("--everyday", nargs="?", const="armrest", choices=tuple(PLACES), help=text)
    add_arguments(parser)
    text = "send a blob instead of floats (default: uint16)"
    parser.add_argument("--blob", nargs="?", const="uint16", choices=tuple(BLOBS), help=text)
    parser.runs(run, "print what is performed as JSON lines")


def run(args: argparse.Namespace) -> int:
    """Send until the time is over, or Ctrl-C. Raises GesturedError if nobody listens from the first packet on."""
    if args.everyday and (args.kinds or args.speed):
        raise GesturedError("--everyday: expected neither --kinds nor --speed, a day has its own")
    rows, columns = args.grid
    what = f"{rows} x {columns} taxels at {args.rate:g} Hz"
    say(f"sending {what} to {args.to} as {args.sensor}; Ctrl-C ends", to=sys.stderr)
    parts = iter(read_ahead(takes(args, args.seconds), 1).get, None)
    first = next(parts)  # before `Sensor` starts its clock; each further part is simulated while another is sent
    sensor = Sensor(args.to, Form(args.sensor, args.blob or "floats"))
    try:
        for start, take in chain([first], parts):
            sensor.send(_telling(frames(start, take), start, take.events, sensor, args.json))
    finally:
        sensor.close()
        if 0 < sensor.unheard < sensor.sent - 1:  # the daemon ended, or was restarted
            lost = f"{sensor.unheard} of {sensor.sent} packets"
            say(f"nobody listened on {args.to} for {lost}", to=sys.stderr)
    return 0


def _telling(
    frames: Iterator[tuple[int, Frame]], start: float, events: tuple[Act, ...], sensor: Sensor, as_json: bool
) -> Iterator[tuple[int, Frame]]:
    """The frames unchanged; each performance is printed when it ends. Raises GesturedError if nobody listens."""
    left = sorted(events, key=lambda event: event.offset_s)  # acts overlap: what rests outlasts others
    for counter, frame in frames:
        if sensor.unheard and sensor.unheard >= sensor.sent - 1:  # a refusal is known at the next packet only
            raise GesturedError(f"nobody listens on {sensor.to}: start gestured, or name its address with --to")
        while left and start + left[0].offset_s < frame.t:
            event = left.pop(0)
            performed = {
                "type": "performed", "sensor": sensor.form.sensor, "gesture": event.label, "kind": event.kind,
                "onset": sensor.moment(start + event.onset_s), "offset": sensor.moment(start + event.offset_s),
                "speed": event.speed, "participant": event.participant,
            }  # fmt: skip
            name = event.label if event.label == event.kind else f"no gesture ({event.kind.replace('_', ' ')})"
            tell(as_json, performed, f"performed {name}, {event.speed}, {event.offset_s - event.onset_s:.2f} s")
        yield counter, frame
