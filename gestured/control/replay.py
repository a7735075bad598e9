"""`gesturectl replay`: a recording to a daemon, or through the same code without one."""

import argparse
import json
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from gestured import tape
from gestured.client.address import host_port
from gestured.control.diff import differences, recorded, replayed
from gestured.core import messages, osc
from gestured.core.errors import GesturedError, RecordingError
from gestured.core.events import Event
from gestured.ladder import ladder_for
from gestured.offline import Replay, Scene

BUNDLE = b"#bundle\0"


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "replay",
        help="play a recording again",
        description="Send the packets of a recording to a daemon (--to), or run them through the same code here and\n"
        "print the events. --diff compares these with the recorded ones, and ends with status 1 where\n"
        "they differ. What was being touched before the sensor was known again is not compared.\n"
        "At another speed than 1, packets without a time tag get one: the daemon needs clock = sensor.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="examples:\n  gesturectl replay drive.mcap --diff --model candidate.onnx\n"
        "  gesturectl replay drive.mcap --to 127.0.0.1:9000 --speed 10",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="what gesturectl record or flag wrote")
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--to", type=host_port, metavar="HOST:PORT", help="send it to the daemon that listens there")
    way.add_argument("--diff", action="store_true", help="compare with the recorded events")
    parser.add_argument("--speed", type=float, default=1.0, metavar="X", help="with --to: so many times as fast")
    parser.add_argument("--model", metavar="MODEL", help="here: another model than the recorded one")
    parser.add_argument("--json", action="store_true", help="print events, or differences, as JSON lines")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Send it, or play it here; 1 where a comparison finds differences."""
    if not 0 < args.speed <= 1000:
        raise GesturedError(f"--speed {args.speed:g}: expected more than 0, at most 1000")
    found = tape.read(args.file)
    if not found.whole:
        print(f"{args.file}: writing was cut off; what is there is played", file=sys.stderr)
    if not found.packets:
        raise RecordingError(f"{args.file}: holds no packets")
    if args.to is not None:
        return _send(found, args.to, args.speed)
    replay = _offline(found, args.model)
    if args.diff:
        return _compare(found, replay, args.json)
    for event in replay.events():
        line = messages.to_json(event, replay.epoch).decode().rstrip("\n")
        print(line if args.json else _words(event, replay.epoch), flush=True)
    return 0


def _words(event: Event, epoch: float) -> str:
    from gestured.control.listen import readable

    return readable(json.loads(messages.to_json(event, epoch)))


def _offline(found: tape.Tape, model: str | None) -> Replay:
    scene = Scene(found.scene)
    recorded_model, fallback = scene.ladder
    ladder = ladder_for(model or recorded_model, fallback or None)
    if model is None and getattr(ladder.model, "sha256", None) != scene.sha256:
        print(f"{ladder.name} is not the file that it was when this was recorded", file=sys.stderr)
    return Replay(found, scene, ladder)


def _compare(found: tape.Tape, replay: Replay, as_json: bool) -> int:
    after = replayed(replay.events(), replay.epoch)
    ready = {name: s.ready + replay.epoch for name, s in replay.streams.items() if s.ready is not None}
    before = recorded(found.events)
    usable = [a for a in before if a.onset >= ready.get(a.sensor, float("inf"))]
    found_different = differences(usable, after)
    for difference in found_different:
        if as_json:
            sides = {"recorded": difference.recorded, "replayed": difference.replayed}
            print(json.dumps({k: v and {"sensor": v.sensor, "onset": v.onset, "answer": v.name,
                                        "confidence": v.confidence} for k, v in sides.items()}))  # fmt: skip
        else:
            print(difference.words())
    skipped = f", {len(before) - len(usable)} before the sensor was known" if len(usable) < len(before) else ""
    print(f"{len(usable)} recorded answers{skipped}, {len(found_different)} differences", file=sys.stderr)
    return 1 if found_different else 0


def _send(found: tape.Tape, to: tuple[str, int], speed: float) -> int:
    """Each sender of the tape gets a socket of its own: a sensor belongs to its source."""
    try:
        family, kind, _, _, where = socket.getaddrinfo(*to, type=socket.SOCK_DGRAM)[0]
    except OSError as error:
        raise GesturedError(f"cannot send to {to[0]}:{to[1]}: {error.strerror or error}") from None
    senders: dict[tuple[str, int], socket.socket] = {}
    unheard = 0
    try:
        for packet, data in _paced(found, speed):
            if packet.source not in senders:
                senders[packet.source] = socket.socket(family, kind)
                senders[packet.source].connect(where)
            try:
                senders[packet.source].send(data)
            except ConnectionRefusedError:
                unheard += 1
    finally:
        for sender in senders.values():
            sender.close()
    lost = f"; nobody listened for {unheard} of them" if unheard else ""
    print(f"sent {len(found.packets)} packets to {to[0]}:{to[1]}{lost}", file=sys.stderr)
    return 1 if unheard else 0


def _paced(found: tape.Tape, speed: float) -> Iterator[tuple[tape.Packet, bytes]]:
    """Packets at their times; at another pace they say themselves when they were felt."""
    first, start = found.packets[0].t_ns, time.monotonic()
    for packet in found.packets:
        wait = start + (packet.t_ns - first) / 1e9 / speed - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        tagged = speed != 1 and not packet.data.startswith(BUNDLE)
        yield packet, osc.encode_bundle([packet.data], packet.t_ns / 1e9) if tagged else packet.data
