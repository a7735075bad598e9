"""`gesturectl replay`: play a recording to a daemon, or through the daemon's code in this process."""

import argparse
import json
import math
import socket
import sys
import time
from collections import Counter
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from gestured.client import osc_out
from gestured.client.program import Commands
from gestured.client.say import say, say_drawn, say_json, tell
from gestured.client.sensor import connected, sent_after_refusal
from gestured.client.values import host_port, number, sensor_name
from gestured.control.diff import Knew, Line, Recorded
from gestured.control.labelled import Labelled
from gestured.control.listen import readable
from gestured.core import messages
from gestured.core.address import Address
from gestured.core.errors import GesturedError, RecordingError
from gestured.core.events import Status
from gestured.core.scene import Scene
from gestured.model.ladder import Ladder, ladder_for
from gestured.model.own import Own
from gestured.model.shipped import shipped
from gestured.record.replay import Maker, Replay
from gestured.record.tape import Tape

DEFAULT_MODEL = "cnn_lstm"  # for an .npz, which names no model
BUNDLE = b"#bundle\0"
Playable = Recorded | Labelled


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "replay",
        help="play a recording again",
        description="Run a recording through the daemon's own code here and print the events, or send it to a\n"
        "daemon (--to). --diff compares the events with the recorded ones, those of a labelled .npz with\n"
        "its labels, and ends with status 1 where they differ. With another model than the recorded one it\n"
        "compares names alone, and counts which was called what. What was touched before the sensor was\n"
        "known again is not compared.\n"
        'At another speed than 1 the daemon must run with clock = "sensor" (gestured --clock sensor): by the\n'
        "time of arrival all would be too fast.",
        epilog="examples:\n  gesturectl replay drive.mcap --diff --model candidate.onnx\n"
        "  gesturectl replay 07.npz --to 127.0.0.1:9000 --speed 10",
    )
    parser.takes("file", "FILE", "what gesturectl record or flag wrote, or an .npz", type=Path)
    parser.takes("--to", "HOST:PORT", "send it to the daemon that listens there", type=host_port)
    parser.add_argument("--diff", action="store_true", help="compare with the recorded events, or the labels")
    parser.takes("--speed", "X", "with --to: so many times as fast", type=number(0.001, 1000), default=1.0)
    parser.takes("--model", "MODEL", "without --to: the model (default: the recorded one, if it is a shipped one)")
    parser.add_argument(
        "--provisional", action="store_true", help="without --to: also print what was said before the answers"
    )
    parser.takes("--sensor", "NAME", "the sensor's name, for an .npz", type=sensor_name, default="recording")
    parser.runs(run, "print events, or differences, as JSON lines")


def run(args: argparse.Namespace) -> int:
    """Send the recording, or play it here; returns 1 if a comparison finds differences."""
    _check(args)
    source: Playable = Labelled(args.file, args.sensor) if args.file.suffix == ".npz" else Recorded(args.file)
    if not source.tape.packets:
        raise RecordingError(f"{args.file}: holds no packets")
    if args.to is None:
        return _here(args, source)
    unheard, count = _send(source.tape, args.to, args.speed), len(source.tape.packets)
    if unheard:
        raise GesturedError(f"nobody listened on {args.to} for {unheard} of {count} packets")
    say(f"sent {count} packets to {args.to}", to=sys.stderr)
    return 0


def _check(args: argparse.Namespace) -> None:
    if args.to is None and args.speed != 1:
        raise GesturedError("--speed is for a daemon: name it with --to HOST:PORT")
    for flag in ("diff", "provisional", "model"):
        if args.to is not None and getattr(args, flag):
            raise GesturedError(f"--{flag} is for a replay here, without --to; a daemon has its own")


def _here(args: argparse.Namespace, source: Playable) -> int:
    scene, ladder = _opened(source, args.model)
    try:
        replay = Replay(source.tape, scene, ladder, provisional=args.provisional)
    except RecordingError as error:
        raise RecordingError(f"{args.file}: {error}") from error
    events = (event for event in replay.events() if not isinstance(event, Status))
    if args.diff:
        another = isinstance(source, Recorded) and ladder.model.sha256 != source.maker.sha256
        lines = [json.loads(messages.to_json(event, replay.epoch_of(event.sensor))) for event in tuple(events)]
        return _compare(args, source, lines, replay.knew, another=another)
    early: dict[str, dict[str, Any]] = {}  # for `readable`
    for event in events:
        line = json.loads(messages.to_json(event, replay.epoch_of(event.sensor)))
        tell(args.json, line, readable(line, early))
    return 0


def _opened(source: Playable, model: str | None) -> tuple[Scene, Ladder]:
    open_ladder = partial(ladder_for, slow_s=math.inf)  # a busy machine must not change answers
    if isinstance(source, Labelled):
        ladder = open_ladder(model or DEFAULT_MODEL)
        return source.scene(ladder.gestures), ladder
    maker = source.maker
    if model is None:
        first, *others = _recorded_models(source.path, maker)
        ladder = open_ladder(first, others or None)
    else:
        ladder = open_ladder(model)
    if model is None and ladder.model.sha256 != maker.sha256:
        say(f"{ladder.name} is not the file that it was when this was recorded", to=sys.stderr)
    ladder.own = Own(maker.own, ladder.gestures)
    return maker.scene, ladder


def _recorded_models(path: Path, maker: Maker) -> list[Path]:
    """The shipped models that a tape names, best first. RecordingError for others, which only the user may name."""
    names = [name.removesuffix(".onnx") for name in maker.models]
    foreign = [given for given, name in zip(maker.models, names, strict=True) if name not in shipped()]
    if foreign:
        raise RecordingError(
            f"{path}: was recorded with the model {foreign[0]!r}, which is not a shipped one; name it with --model"
        )
    return [shipped()[name] for name in names]


def _send(tape: Tape, to: Address, speed: float) -> int:
    """Send all packets, `speed` times as fast; returns how many a closed port refused. Raises GesturedError.

    Each sender of the tape gets a socket of its own, since a sensor belongs to its source. At another speed than 1 a
    packet is wrapped in a bundle with its recorded time, unless it is a bundle.
    """
    senders: dict[Address, socket.socket] = {}
    unheard, first, start = 0, tape.packets[0].t_ns, time.monotonic()
    try:
        for packet in tape.packets:
            time.sleep(max(start + (packet.t_ns - first) / 1e9 / speed - time.monotonic(), 0.0))
            tagged = speed != 1 and not packet.data.startswith(BUNDLE)
            if packet.source not in senders:
                senders[packet.source] = connected(to)
            data = osc_out.dated(packet.t_ns / 1e9, packet.data) if tagged else packet.data
            unheard += sent_after_refusal(senders[packet.source], data)
    except OSError as error:  # such as a packet that is longer than UDP allows
        raise GesturedError(f"a packet for {to} cannot be sent: {error.strerror}") from error
    finally:
        for sender in senders.values():
            sender.close()
    return unheard


def _compare(
    args: argparse.Namespace, source: Playable, lines: Iterable[Line], knew: Knew, *, another: bool = False
) -> int:
    """Print the differences; 1 if there are any. Of `another` model only names are compared, and counted by pair."""
    compared, skipped, differences = source.compare(lines, knew)
    if another:
        differences = [one for one in differences if one.names[0] != one.names[1]]
        for (before, after), count in Counter(one.names for one in differences).most_common():
            say(f"{count:5d} x {before} -> {after}", to=sys.stderr)
    for difference in differences:
        if args.json:
            say_json({side: answer and answer._asdict() for side, answer in difference._asdict().items()})
        else:
            say_drawn(difference.words())
    early = f", {skipped} before the sensor was known" if skipped else ""
    say(f"{compared}{early}, {len(differences)} differences", to=sys.stderr)
    return 1 if differences else 0
