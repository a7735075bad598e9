"""`gesturectl doctor`: what is wrong, and what to do about it."""

import argparse
import platform
import shlex
import socket
import stat
import subprocess
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import gestured
from gestured.client.address import bind_failure, running
from gestured.client.control import Control
from gestured.client.lines import JOIN, Forbidden, Refused, Unreachable
from gestured.client.peer import Stranger
from gestured.client.program import Commands
from gestured.client.say import say, say_json
from gestured.control.address import add_sockets, control_path
from gestured.control.findings import BUFFER_BYTES, Finding, dropping, examine_status, model_finding
from gestured.control.proposal import propose
from gestured.control.sight import Sight
from gestured.control.sniff import overhear
from gestured.core.address import Address
from gestured.core.errors import GesturedError

YEAR_S = 365 * 86_400
RELEASED = 1_750_000_000  # s since the epoch; a clock before that is wrong
BRIDGES = ("gestured-bridge@*", "gestured-serial@*")  # units of systemd
SYSTEMD_S = 5.0  # the longest wait for systemctl, which takes milliseconds
LOOK_S = 1.5  # how long packets are looked at if the daemon drops some: 22 frames at 15 Hz


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "doctor",
        help="say what is wrong, and what to do about it",
        description="Look at versions, clock, kernel buffer, sockets and permissions, and at the daemon, its model\n"
        "and its sensors. Each finding comes with its remedy. Exit status 1 where something is bad.",
        epilog="example:\n  gesturectl doctor",
    )
    add_sockets(parser)
    parser.runs(run, "print the findings as JSON lines")


def run(args: argparse.Namespace) -> int:
    """Print all findings; returns 1 if any is bad."""
    bad = 0
    for finding in examine(control_path(args)):
        bad += finding.level == "bad"
        if args.json:
            say_json(asdict(finding))
        else:
            remedy = enumerate(finding.remedy.splitlines())
            say(f"{finding.level:<5}   {finding.what}", *(f"{'   ' if n else '-> ':>11}{line}" for n, line in remedy))
    return 1 if bad else 0


def examine(path: Path) -> Iterator[Finding]:
    """All findings, from the machine to the sensors of the daemon whose control socket is at `path`."""
    yield _versions()
    yield _clock(time.time())
    yield _buffer(Path("/proc/sys/net/core/rmem_max"))
    yield from _bridges()
    try:
        with Control(path) as control:
            status = control.ask("status")
            with control.reading():
                proposed = _proposed(control) if dropping(status) else []
                found = list(examine_status(status, proposed))
    except Forbidden as error:
        yield Finding("bad", str(error), JOIN)
        return
    except (Unreachable, Refused, Stranger) as error:
        others = running() if isinstance(error, Unreachable) else []
        if others and path not in others:
            sockets = [shlex.quote(str(other.with_suffix(".sock"))) for other in others]
            remedy = f"export GESTURED_SOCKET={sockets[0]} names it to all commands, --socket {sockets[0]} to one"
            found_at = ", ".join(sockets)
            yield Finding("bad", f"no daemon on {path}, but one whose event socket is {found_at}", remedy)
            return
        remedy = "does it run? systemctl status gestured; its last words: journalctl --unit gestured --lines 20"
        if path in others and not path.exists():
            remedy = f"one runs whose sockets in {path.parent} somebody has removed: end it, and start it again"
        elif isinstance(error, Stranger):
            remedy = f"ls -ld {path.parent} shows whose folder it is"
        yield Finding("bad", str(error), remedy)
        yield _port(Address("127.0.0.1", 9000))
        yield model_finding("cnn_lstm", None)
        return
    yield _permissions(path)
    yield from found


def _proposed(control: Control) -> list[str]:
    """Lines for the configuration file, from the packets that arrive now; none if these fit the settings."""
    sight = Sight()
    try:
        told = overhear(control, LOOK_S, sight)
    except GesturedError:
        return []  # the daemon has ended meanwhile, or cannot show its packets
    lines = propose(sight.rows(), told)
    return lines if lines and lines[0].startswith(("[", "#")) else []


def _versions() -> Finding:
    from importlib.metadata import PackageNotFoundError, version

    names = []
    for package in ("numpy", "onnxruntime", "uvloop", "pydantic", "mcap", "paho-mqtt", "eclipse-zenoh", "pyserial"):
        try:
            names.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            names.append(f"{package} not installed")
    return Finding("ok", f"gesturectl {gestured.__version__}, Python {platform.python_version()}, {', '.join(names)}")


def _clock(now: float) -> Finding:
    if not RELEASED < now < RELEASED + 50 * YEAR_S:
        return Finding("bad", f"the clock says {time.strftime('%Y-%m-%d', time.gmtime(now))}", "set it: timedatectl")
    return Finding("ok", f"the clock says {time.strftime('%Y-%m-%d %H:%M:%S', time.gmtime(now))} UTC")


def _buffer(path: Path) -> Finding:
    try:
        most = int(path.read_text())
    except (OSError, ValueError):
        return Finding("warn", f"the kernel's limit of receive buffers is not known ({path})")
    if most < BUFFER_BYTES:
        return Finding(
            "warn",
            f"the kernel grants receive buffers of {most >> 10} KiB, the daemon asks for {BUFFER_BYTES >> 10}",
            f"sysctl -w net.core.rmem_max={BUFFER_BYTES}",
        )
    return Finding("ok", f"the kernel grants receive buffers of {most >> 10} KiB")


def _bridges() -> Iterator[Finding]:
    """A finding for each bridge that systemd runs, from the bridge's status line."""
    command = ["systemctl", "show", "--property=Id,ActiveState,StatusText", *BRIDGES]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=SYSTEMD_S)
    except (OSError, subprocess.TimeoutExpired):
        return  # no systemd here, or none that answers
    for block in done.stdout.split("\n\n"):
        unit = dict(line.partition("=")[::2] for line in block.splitlines())
        if not unit.get("Id"):
            continue
        said = unit.get("StatusText") or unit.get("ActiveState", "")
        remedy = f"journalctl --unit {unit['Id']} --lines 20 says why"
        if unit.get("ActiveState") != "active":
            yield Finding("bad", f"{unit['Id']} is {unit.get('ActiveState')}", remedy)
        elif said.startswith("connected"):
            yield Finding("ok", f"{unit['Id']} is {said}")
        else:
            yield Finding("warn", f"{unit['Id']} is {said}", remedy)


def _port(address: Address) -> Finding:
    """Whether the daemon could listen at its default address."""
    where = f"udp {address}"
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(address)
        except OSError as error:
            remedy = "systemd holds it for the service: good; else end that program, or choose another --listen"
            return Finding("warn", f"{where}: {bind_failure(error, address, socket.SOCK_DGRAM)}", remedy)
    return Finding("ok", f"{where} is free")


def _permissions(path: Path) -> Finding:
    try:
        mode = path.stat().st_mode
    except OSError as error:
        return Finding("bad", f"control socket {path}: {error.strerror}, since it answered", "restart the daemon")
    if mode & 0o007:
        return Finding("warn", f"control socket {path}: open to everybody", f"chmod o= {path}")
    return Finding("ok", f"control socket {path}: mode {stat.S_IMODE(mode):04o}")
