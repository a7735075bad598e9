"""`gesturectl doctor`: what is wrong, and what to do about it."""

import argparse
import platform
import socket
import stat
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import gestured
from gestured.client.control import Control
from gestured.client.holder import bind_failure
from gestured.client.lines import JOIN, Forbidden, Refused, Unreachable
from gestured.client.peer import Stranger
from gestured.client.say import say, say_json
from gestured.control.address import add_sockets, control_path
from gestured.core.address import Address
from gestured.core.errors import ModelError
from gestured.model.model import check

BUFFER_BYTES = 4 << 20  # what the daemon asks of the kernel
YEAR_S = 365 * 86_400
RELEASED = 1_750_000_000  # s since the epoch; a clock before that is wrong
SLOW_S = 0.1


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at: "ok", "warn" (it works, but) or "bad", and the remedy where it is not ok."""

    level: str
    what: str
    remedy: str = ""


DROPS = {  # why, and what to do
    "address": "came to an address that no sensor has: gesturectl sniff proposes [addresses]",
    "size": 'had another number of taxels than the grid: [sensors.NAME] grid = "ROWSxCOLUMNS" (gesturectl sniff)',
    "types": "held neither numbers nor one blob: wire.md says what a frame is, gesturectl sniff what arrives",
    "not_allowed": "came from a source that is not under allow",
    "second_source": "came from a second sender for one sensor's name (gesturectl sniff): give each its own name",
    "too_many_sensors": "were of more sensors than max_sensors: look for a sender that changes its name",
    "flood": "were more than the daemon can take: their source is held to half a megabyte a second",
    "not_osc": "were not OSC: something else is sent to this port",
    "not_finite": "held NaN or infinity: look at the sensor's firmware",
}


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "doctor",
        help="what is wrong, and what to do about it",
        description="Look at versions, clock, kernel buffer, sockets and permissions, and at the daemon, its model\n"
        "and its sensors. Each finding comes with its remedy. Exit status 1 where something is bad.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  gesturectl doctor",
    )
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the findings as JSON lines")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Look at everything, and say it."""
    bad = 0
    for finding in examine(control_path(args)):
        bad += finding.level == "bad"
        if args.json:
            say_json(asdict(finding))
        else:
            remedy = [f"        -> {finding.remedy}"] if finding.remedy else []
            say(f"{finding.level:<5}   {finding.what}", *remedy)
    return 1 if bad else 0


def examine(path: Path) -> Iterator[Finding]:
    """Everything, from the machine to the sensors."""
    yield _versions()
    yield _clock(time.time())
    yield _buffer(Path("/proc/sys/net/core/rmem_max"))
    try:
        with Control(path) as control:
            status = control.ask("status")
    except Forbidden as error:
        yield Finding("bad", str(error), JOIN)
        return
    except (Unreachable, Refused, Stranger) as error:
        remedy = "does it run? systemctl status gestured; its last words: journalctl --unit gestured --lines 20"
        if isinstance(error, Stranger):
            remedy = f"ls -ld {path.parent} shows whose folder it is"
        yield Finding("bad", str(error), remedy)
        yield _port(Address("127.0.0.1", 9000))
        yield _model("cnn_lstm", None)
        return
    yield _permissions(path)
    for look in (_daemon, _ports, _active_model, _input, _sensors, _shift, _output):
        yield from look(status)


def _versions() -> Finding:
    from importlib.metadata import PackageNotFoundError, version

    names = []
    for package in ("numpy", "onnxruntime", "uvloop", "pydantic", "mcap"):
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


def _port(address: Address) -> Finding:
    """Whether the daemon could have its usual port."""
    where = f"udp {address}"
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(address)
        except OSError as error:
            remedy = (
                f"sudo ss -ulpn 'sport = :{address.port}' shows whose it is. systemd holds it for the service: good; "
                "else end that program, or choose another --listen"
            )
            return Finding("warn", f"{where}: {bind_failure(error, address, socket.SOCK_DGRAM)}", remedy)
    return Finding("ok", f"{where} is free")


def _permissions(path: Path) -> Finding:
    mode = path.stat().st_mode
    if mode & 0o007:
        return Finding("warn", f"control socket {path}: open to everybody", f"chmod o= {path}")
    return Finding("ok", f"control socket {path}: mode {stat.S_IMODE(mode):04o}")


def _model(name: str, sha256: str | None) -> Finding:
    try:
        report = check(name)
    except ModelError as error:
        return Finding("bad", f"model {error}", "copy the file again, or choose another model")
    if sha256 is not None and report["sha256"] != sha256:
        return Finding("warn", f"model {report['file']} is not the one that runs", "gesturectl reload")
    return Finding("ok", f"model {report['file']}: passes its self-test, sha256 {report['sha256'][:12]}")


def _daemon(status: dict[str, Any]) -> Iterator[Finding]:
    if status["version"] != gestured.__version__:
        what = f"the daemon is {status['version']}, gesturectl {gestured.__version__}"
        yield Finding("warn", what, "restart the daemon: systemctl restart gestured")
    if not status["ready"]["ready"]:
        yield Finding("bad", f"not ready: {status['ready']['reason']}", "see the daemon's log: journalctl -u gestured")
    else:
        yield Finding("ok", f"the daemon serves, {status['state']}, pid {status['pid']}")
    if status["loop_lag_s"] > SLOW_S:
        late = f"its loop is {1000 * status['loop_lag_s']:.0f} ms late"
        yield Finding("warn", late, "the machine is too busy: give gestured a processor, or a higher priority")
    if status["internal_errors"]:
        yield Finding("bad", f"{status['internal_errors']} bugs were caught", "report them with the daemon's log")
    if status["reloads"].get("refused"):
        yield Finding("warn", f"{status['reloads']['refused']} reloads were refused", "gesturectl reload says why")


def _ports(status: dict[str, Any]) -> Iterator[Finding]:
    where = {key: value for key, value in status["addresses"].items() if value}
    yield Finding("ok", ", ".join(f"{key} {value}" for key, value in where.items()))
    if not where["listen"].startswith(("127.", "[::1]:")):
        what = f"frames are taken from the network ({where['listen']}); OSC has no authentication"
        yield Finding("warn", what, "name the senders with --allow, and keep the network private")


def _active_model(status: dict[str, Any]) -> Iterator[Finding]:
    model = status["model"]
    if model["degraded"]:
        yield Finding("bad", f"{model['active']} stands in for {model['asked']}", "gesturectl check says what is wrong")
    yield _model(status["model"]["file"], model["sha256"])


def _input(status: dict[str, Any]) -> Iterator[Finding]:
    for reason, count in status["input"]["dropped"].items():
        why = DROPS.get(reason, "were not what is expected: gesturectl sniff shows what arrives")
        yield Finding("warn", f"{count} packets or messages dropped since the start: {reason}", f"they {why}")
    if status["input"]["kernel_drops"]:
        what = f"the kernel dropped {status['input']['kernel_drops']} packets that found no room"
        yield Finding("warn", what, f"sysctl -w net.core.rmem_max={BUFFER_BYTES}, and look for a busy machine")


def _sensors(status: dict[str, Any]) -> Iterator[Finding]:
    if not status["sensors"]:
        yield Finding("bad", "no sensor was heard", "gesturectl sniff shows whether anything arrives")
    words: dict[str, Callable[[dict[str, Any]], Finding]] = {
        "ok": lambda s: Finding("ok", f"{s['rate_hz']:.1f} Hz from {s['source']}"),
        "starting": lambda s: Finding("warn", "is being learned", "leave it untouched for a second"),
        "degraded": lambda s: Finding(
            "warn", f"{s['bad_taxels']} bad taxels are bridged", "look at its lines; gesturectl recalibrate"
        ),
        "faulty": lambda s: Finding("bad", f"{s['bad_taxels']} bad taxels", "replace it, or look at its connector"),
        "stale": lambda s: Finding(
            "bad", f"was heard {s['heard_s_ago']:.0f} s ago", "is it powered, and is the network up?"
        ),
        "no_data": lambda s: Finding(
            "bad", "is configured, but was never heard", "gesturectl sniff; is its name right?"
        ),
    }
    for name, sensor in status["sensors"].items():
        found = words[sensor["state"]](sensor)
        yield Finding(found.level, f"sensor {name}: {found.what}", found.remedy)
        if sensor.get("lost"):
            what = f"sensor {name}: {sensor['lost']} frames lost on the way"
            yield Finding("warn", what, "look at the network, or at kernel drops")


def _shift(status: dict[str, Any]) -> Iterator[Finding]:
    for name in status["shift"]["unlike"]:
        share = 100 * status["shift"]["outside"][name]
        what = f"{name} of {share:.0f} % of the last gestures lies outside of what the model was trained on"
        if name == "unknown":
            what = f"{share:.0f} % of the last touches were answered by unknown"
        yield Finding("warn", what, "check the mounting; record people here, and train with them")


def _output(status: dict[str, Any]) -> Iterator[Finding]:
    out = status["output"]
    if out["lines_lost"] or out["evicted"]:
        what = f"slow subscribers lost {out['lines_lost']} lines, {sum(out['evicted'].values())} were cut off"
        yield Finding("warn", what, "read in a thread of its own, and faster")
    failed = {result: count for result, count in out["osc"].items() if result != "sent"}
    if failed:
        what = "OSC output failed: " + ", ".join(f"{count} {result}" for result, count in failed.items())
        yield Finding("warn", what, "does anybody listen at the --publish addresses?")
