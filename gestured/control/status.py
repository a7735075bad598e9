"""`gesturectl status`: print the state of the daemon and its sensors on one screen."""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from contextlib import nullcontext
from datetime import datetime
from pathlib import Path
from typing import Any

from gestured.client.address import SYSTEM, control_beside, running
from gestured.client.control import Control
from gestured.client.lines import Unreachable
from gestured.client.program import Commands
from gestured.client.say import say, say_drawn, tell
from gestured.control.address import add_sockets, connect
from gestured.core.beside.reading import SILENT
from gestured.core.errors import GesturedError
from gestured.core.timing import RANGE_HZ, outside

CLEAR = "\x1b[2J\x1b[H"
REFRESH_S = 1.0
SHIFT_NAMES = {"duration_s": "duration"}
RATES = f"{RANGE_HZ[0]:.0f} to {RANGE_HZ[1]:.0f} Hz"
SENSOR_LINES = 12  # the most sensors that get a line each; further ones are counted


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "status",
        help="show the state of the daemon and its sensors",
        description="Show sensors, rates, health, model and the last answers of a running daemon.\n"
        "Exit status 1 if it is not ready.",
        epilog="examples:\n  gesturectl status --watch\n  gesturectl status --all\n  gesturectl status --json",
    )
    parser.add_argument("--watch", action="store_true", help="repeat every second, until Ctrl-C")
    text = "show each daemon on this machine, a line each; exit status 1 if one is not ready"
    parser.add_argument("--all", action="store_true", help=text)
    add_sockets(parser)
    parser.runs(run, "print all that is known as JSON, one line each time")


def run(args: argparse.Namespace) -> int:
    """Print the state once, or every REFRESH_S with `--watch`; returns 1 if a daemon is not ready."""
    with nullcontext() if args.all else connect(args) as control:
        while True:
            status = every(args) if control is None else one(args, control)
            if not args.watch:
                return status
            time.sleep(REFRESH_S)


def one(args: argparse.Namespace, control: Control) -> int:
    """Print the state of one daemon; returns 1 if it is not ready."""
    status = control.ask("status")
    with control.reading():
        lines, ready = [] if args.json else list(screen(status)), status["ready"]["ready"]
    _clear(args)
    tell(args.json, status, *lines)
    return 0 if ready else 1


def every(args: argparse.Namespace) -> int:
    """Print a line for each daemon; returns 1 if one is not ready or is silent. Raises Unreachable if none runs."""
    installed = control_beside(SYSTEM)  # in a network of its own (systemd), so `running` does not find that daemon
    paths = sorted({*running(), *([installed] if os.path.exists(installed) else [])})
    if not paths:
        raise Unreachable("no daemon runs on this machine")
    _clear(args)
    bad = 0
    if not args.json:
        say("control socket                       state        sensors    frames/s  gestures   dropped  load")
    for path in paths:
        try:
            with Control(path) as control:
                status: dict[str, Any] = control.ask("status")
                with control.reading():
                    line, ready = "" if args.json else summary(path, status), status["ready"]["ready"]
        except GesturedError as error:
            bad += 1
            tell(args.json, {"control": str(path), "error": str(error)}, f"{path!s:<36} {error}")
            continue
        bad += not ready
        tell(args.json, {"control": str(path), **status}, line)
    return 1 if bad else 0


def _clear(args: argparse.Namespace) -> None:
    """Clear the terminal before the state is printed again."""
    if args.watch and not args.json and sys.stdout.isatty():
        say_drawn(CLEAR, end="")


def summary(path: Path, status: dict[str, Any]) -> str:
    """The state of one daemon in a line."""
    word = status["state"] if status["ready"]["ready"] else "not ready"
    sensors = status["sensors"].values()
    heard = [sensor for sensor in sensors if sensor["state"] not in SILENT]
    rate = sum(sensor["rate_hz"] for sensor in heard)
    dropped = sum(status["input"]["dropped"].values()) + status["input"]["kernel_drops"]
    gestures = sum(status["answers"]["gestures"].values())
    late = f"{1000 * status['loop_lag_s']:.0f} ms late"
    return f"{path!s:<36} {word:<10} {len(heard):5d}/{len(sensors):<5d} {rate:8.0f} {gestures:9d} {dropped:9d}  {late}"


def screen(status: dict[str, Any]) -> Iterator[str]:
    """The state of one daemon in lines for a person."""
    model, out, ready = status["model"], status["output"], status["ready"]
    word = status["state"] if ready["ready"] else f"not ready: {ready['reason']}"
    yield f"gestured {status['version']}, {word}, up {span(status['uptime_s'])}, pid {status['pid']}"
    where = ", ".join(f"{key} {value}" for key, value in status["addresses"].items() if value)
    yield f"  {where}"
    fallback = f", a fallback for {model['asked']}" if model["degraded"] else ""
    failures = f", {model['failures']} failures" if model["failures"] else ""
    yield f"  model {model['active']} {model['version']} ({model['sha256'][:12]}){fallback}{failures}"
    yield ""
    yield from _sensors(status["sensors"])
    yield ""
    answers = status["answers"]
    total = sum(answers["gestures"].values())
    cancelled = ", ".join(f"{count} {reason}" for reason, count in answers["cancelled"].items()) or "none"
    suppressed = sum(answers.get("suppressed", {}).values())  # an older daemon has none
    silenced = f", {suppressed} while silent or not armed" if suppressed else ""
    yield f"answers: {total} gestures, {answers['unknown']} unknown{silenced}; cancelled: {cancelled}"
    for line in status["recent"][-5:]:
        at, mark = datetime.fromtimestamp(line["time"]).strftime("%H:%M:%S"), "  (test)" if line["test"] else ""
        confidence = "" if line["confidence"] is None else f"{line['confidence']:.2f}"
        yield f"  {at}  {line['sensor'][:16]:<16} {line['answer']:<24} {confidence}{mark}"
    yield ""
    dropped = ", ".join(f"{count} {reason}" for reason, count in status["input"]["dropped"].items()) or "none"
    yield f"dropped packets: {dropped}; by the kernel: {status['input']['kernel_drops']}"
    yield (
        f"subscribers: {out['subscribers']}, {out['backlog_bytes']} bytes waiting, {out['lines_lost']} lines lost, "
        f"{sum(out['evicted'].values())} cut off"
    )
    yield f"late: {1000 * status['loop_lag_s']:.0f} ms; {status['internal_errors']} bugs caught"
    yield f"shift: {_shift(status['shift'])}"
    yield from (f"own gestures: {said}" for said in own_faults(status))


def own_faults(status: dict[str, Any]) -> list[str]:
    """Why the user's own gestures are not recognised, or not told apart: a sentence for each reason."""
    own = status.get("own")  # an older daemon has none
    if own is None:
        return []
    return [said for said in (own["fault"], own["gestures"] and own["off"], *own["doubtful"]) if said]


def _sensors(sensors: dict[str, dict[str, Any]]) -> Iterator[str]:
    if not sensors:
        yield "no sensor was heard so far (gesturectl sniff shows what arrives)"
        return
    yield "sensor           state            Hz  jitter   lost  bad  drift gestures  grid"
    for name, s in sorted(sensors.items(), key=lambda one: one[1]["state"] == "ok")[:SENSOR_LINES]:
        numbers = f"{s['rate_hz']:6.1f} {1000 * s['jitter_s']:4.0f} ms {s.get('lost', 0):6d} {s['bad_taxels']:4d}"
        touched = "  touched" if s.get("touched") else ""
        touched += f"  {s['reason']}" if s.get("reason") else ""
        touched += f"  {listens(s)}" if s.get("closed") or s.get("armed") is not None else ""
        touched += f"  made for {RATES}" if outside(s["rate_hz"]) else ""
        touched += "  rows and columns are exchanged" if s.get("exchanged") else ""
        tail = f"{s['drift']:6.1f} {s.get('gestures', 0):8d}  {s['grid']}{touched}"
        yield f"{name[:16]:<16} {s['state']:<12} {numbers} {tail}"
    if len(sensors) > SENSOR_LINES:
        yield f"and {len(sensors) - SENSOR_LINES} more: gesturectl doctor"


def listens(told: dict[str, Any]) -> str:
    """Whether a sensor listens, in words, from a `gate` event or from the sensor's status."""
    if told.get("closed"):
        return f"silent, gates closed: {', '.join(told['closed'])}"
    return "armed" if told.get("armed") else "listens" if told.get("armed") is None else "not armed"


def _shift(shift: dict[str, Any]) -> str:
    if not shift["outside"].keys() - {"unknown"}:  # the share of unknown touches says nothing about gestures
        return f"nothing to say yet ({shift['gestures']} gestures)"
    seen = f"the last {shift['gestures']} gestures are"
    if not shift["unlike"]:
        return f"{seen} like those of the training"
    shares = ", ".join(
        f"{SHIFT_NAMES.get(name, name)} ({100 * shift['outside'][name]:.0f} %)" for name in shift["unlike"]
    )
    return f"{seen} unlike those of the training in {shares}: gesturectl doctor says more"


def span(seconds: float) -> str:
    """A duration in words."""
    hours, rest = divmod(int(seconds), 3600)
    return f"{hours} h {rest // 60} min" if hours else f"{rest // 60} min {rest % 60} s"
