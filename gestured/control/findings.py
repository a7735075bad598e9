"""The doctor's findings in a daemon's status: daemon, model, input, sensors and output."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import gestured
from gestured.control.status import RATES, own_faults, span
from gestured.core.errors import ModelError
from gestured.core.timing import outside as rate_is_outside
from gestured.model.opening import check

BUFFER_BYTES = 4 << 20  # the receive buffer that the daemon asks the kernel for
SLOW_S = 0.1  # the daemon is too slow if its loop lags by more
RECENT_S = 60.0  # a fault that has not happened again for so long is over


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at, and the remedy if it is not ok."""

    level: str  # "ok", "warn" (it works, but not as it should) or "bad"
    what: str
    remedy: str = ""
    sensor: str = ""  # name of the sensor that is meant; "" for a finding about none or several


DROPS = {  # by reason: what the dropped packets did, and what to do
    "address": "came to an address that no sensor has: gesturectl sniff proposes [addresses]",
    "size": "had another number of taxels than the grid: gesturectl sniff proposes one",
    "types": "had other type tags than f, i or one b: gesturectl sniff shows what arrives",
    "not_allowed": "came from a source that is not under allow",
    "second_source": "came from a second sender for one sensor's name (gesturectl sniff): give each its own name",
    "too_many_sensors": "were of more sensors than max_sensors: look for a sender that changes its name",
    "flood": "were more than the daemon can take: each sender is held to its share of the time",
    "not_osc": "were not OSC: something else is sent to this port",
    "not_finite": "held NaN or infinity: look at the sensor's firmware",
}


# By state of a sensor: level, words (used if the status gives no reason; its keys are filled in), remedy.
STATES = {
    "ok": ("ok", "{rate_hz:.1f} Hz from {source}", ""),
    "starting": ("warn", "is being learned", "leave it untouched for a second"),
    "degraded": (
        "warn",
        "{bad_taxels} bad taxels are bridged",
        "look at its lines, and at what lies on it; gesturectl recalibrate",
    ),
    "faulty": ("bad", "{bad_taxels} bad taxels", "replace it, or look at its connector"),
    "stale": ("bad", "was heard {heard} ago", "is it powered, and is the network up?"),
    "no_data": ("bad", "is configured, but was never heard", "gesturectl sniff; is its name right?"),
    "intermittent": (
        "bad",
        "falls silent between touches, so the idle sensor cannot be learned",
        "let it send idle frames, too: all the time, at one rate",
    ),
    "inverted": (
        "bad",
        "its counts fall when it is touched",
        "[sensors.{name}] invert = true in the file of gestured --config",
    ),
}


def examine_status(status: dict[str, Any], proposed: Sequence[str] = ()) -> Iterator[Finding]:
    """The findings in the daemon's answer to `status`; `proposed` has the lines of `propose` if packets do not fit."""
    for look in (_daemon, _ports, _models):
        yield from look(status)
    if proposed:
        what = "what arrives does not fit the settings, and is dropped"
        remedy = ["set in the file of gestured --config, then gesturectl reload:", *proposed]
        yield Finding("bad", what, "\n".join(remedy))
    yield from examine_sensors(status)
    for look in (_own, _shift, _output):
        yield from look(status)


def examine_sensors(status: dict[str, Any]) -> Iterator[Finding]:
    """The findings about input, sensors and gates in the daemon's answer to `status`."""
    for look in (_input, _sensors, _gates):
        yield from look(status)


def dropping(status: dict[str, Any]) -> bool:
    """Whether the daemon has dropped packets within RECENT_S."""
    ages = _ages(status, "dropped")
    return any(ages.get(reason, math.inf) <= RECENT_S for reason in status["input"]["dropped"])


def model_finding(name: str, sha256: str | None) -> Finding:
    """Whether a model can be used, and is the running one, whose checksum `sha256` is (None if none runs)."""
    try:
        report = check(name)
    except ModelError as error:
        if sha256 is not None and isinstance(getattr(error.__cause__, "__cause__", None), PermissionError):
            return Finding("warn", f"model {error}, but it runs", "ask as root, or as the daemon's account")
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
        late = f"the daemon runs {1000 * status['loop_lag_s']:.0f} ms late"
        remedy = "the machine is too busy, or too many sensors send: give gestured a processor, or run several daemons"
        yield Finding("warn", late, remedy)
    if status["internal_errors"]:
        bugs = f"{status['internal_errors']} bugs were caught"
        found = _dated(bugs, _ages(status, "internal_errors").get("all"), "")
        yield Finding("bad", found.what, "report them with the daemon's log")
    if status["reloads"].get("refused"):
        ages = _ages(status, "reloads")
        if ages.get("refused", 0.0) <= ages.get("done", math.inf):  # no reload has succeeded since
            refused = f"{status['reloads']['refused']} reloads were refused"
            yield Finding("warn", refused, "gesturectl reload says why")


def _ports(status: dict[str, Any]) -> Iterator[Finding]:
    where = {key: value for key, value in status["addresses"].items() if value}
    yield Finding("ok", ", ".join(f"{key} {value}" for key, value in where.items()))
    if not where["listen"].startswith(("127.", "[::1]:")):
        what = f"frames are taken from the network ({where['listen']}); OSC has no authentication"
        yield Finding("warn", what, "name the senders with --allow, and keep the network private")


def _models(status: dict[str, Any]) -> Iterator[Finding]:
    model = status["model"]
    if model["degraded"]:
        yield Finding("bad", f"{model['active']} stands in for {model['asked']}", "gesturectl check says what is wrong")
    for reason in model.get("refused", ()):  # an older daemon does not tell
        yield Finding("warn", reason, "mend the file or name another one, then gesturectl reload")
    yield model_finding(model["file"], model["sha256"])


def _input(status: dict[str, Any]) -> Iterator[Finding]:
    ages = _ages(status, "dropped")
    for reason, count in status["input"]["dropped"].items():
        why = DROPS.get(reason, "were not what is expected: gesturectl sniff shows what arrives")
        what = f"{count} packets or messages dropped since the start: {reason}"
        yield _dated(what, ages.get(reason), f"they {why}")
    if status["input"]["kernel_drops"]:
        what = f"the kernel dropped {status['input']['kernel_drops']} packets"
        remedy = "the unit's IPAddressAllow= refuses their sender, or they found no room: look for a busy machine, "
        remedy += f"and sysctl -w net.core.rmem_max={BUFFER_BYTES}"
        yield _dated(what, _ages(status, "kernel_drops"), remedy)
    if undated := status["input"].get("implausible"):  # an older daemon does not tell
        what = f"{undated} frames were dated by their arrival, since their time tags are missing or impossible"
        remedy = 'let the sensor send each frame in a bundle with its time, or set its clock = "arrival"'
        yield _dated(what, _ages(status, "implausible").get("all"), remedy)


def _ages(status: dict[str, Any], key: str) -> Any:
    """How long ago something last happened, in s, by label if it has labels; an older daemon does not tell."""
    return status.get("last_s_ago", {}).get(key, {} if key != "kernel_drops" else None)


def _dated(what: str, seconds: float | None, remedy: str) -> Finding:
    """A finding about something that last happened so many `seconds` ago: "ok" after RECENT_S without it."""
    if seconds is None or seconds <= RECENT_S:
        when = "" if seconds is None else f", the last {seconds:.0f} s ago"
        return Finding("warn", what + when, remedy)
    return Finding("ok", f"{what}, the last {span(seconds)} ago: that is over")


def _sensors(status: dict[str, Any]) -> Iterator[Finding]:
    if not status["sensors"]:
        if dropping(status):
            yield Finding("bad", "no sensor was heard, since all that arrives is dropped", "mend what is said above")
        else:
            yield Finding("bad", "no sensor was heard", "gesturectl sniff shows whether anything arrives")
    for name, sensor in status["sensors"].items():
        for found in _sensor(name, sensor):
            yield Finding(found.level, f"sensor {name}: {found.what}", found.remedy, name)


def _sensor(name: str, sensor: dict[str, Any]) -> Iterator[Finding]:
    if found := STATES.get(sensor["state"]):  # a newer daemon may have other states
        level, what, remedy = found
        what = sensor.get("reason") or what.format(**sensor, heard=span(sensor.get("heard_s_ago", 0.0)))
        yield Finding(level, what, remedy.format(name=name))
    if sensor.get("closed"):
        remedy = "; ".join(f"gesturectl allow {name} --gate {gate}" for gate in sensor["closed"])
        yield Finding("warn", f"is silent, since gates are closed: {', '.join(sensor['closed'])}", remedy)
    if rate_is_outside(sensor["rate_hz"]):
        remedy = "let it send at another rate; gestures of slower or faster sensors are unreliable"
        yield Finding("warn", f"{sensor['rate_hz']:.1f} Hz, made for {RATES}", remedy)
    if sensor.get("exchanged"):
        rows, _, columns = sensor["grid"].partition("x")
        what = f"rows and columns are exchanged: with {columns}x{rows} its touches look like a finger's"
        yield Finding("bad", what, f'[sensors.{name}] grid = "{columns}x{rows}" in the file of gestured --config')
    if sensor.get("lost") and sensor["state"] != "intermittent":
        remedy = "look at the network, or at kernel drops"
        yield _dated(f"{sensor['lost']} frames lost on the way", sensor.get("lost_s_ago"), remedy)


def _gates(status: dict[str, Any]) -> Iterator[Finding]:
    for gate, seconds in status.get("overdue", {}).items():
        what = f"gate {gate} is closed, and the bridge that closed it has given no sign of life for {span(seconds)}"
        yield Finding(
            "bad", what, f"does the bridge run, and its bus? To open it: gesturectl allow --all --gate {gate}"
        )


def _own(status: dict[str, Any]) -> Iterator[Finding]:
    for said in own_faults(status):
        remedy = "gesturectl forget NAME, or another model"
        if said == status["own"]["fault"]:  # a fault of a file that cannot be written names its own remedy
            remedy = "" if "--own-gestures" in said else "mend or remove the file, then gesturectl reload"
        yield Finding("warn", f"own gestures: {said}", remedy)


def _shift(status: dict[str, Any]) -> Iterator[Finding]:
    for name in status["shift"]["unlike"]:
        share = 100 * status["shift"]["outside"][name]
        what = f"{name} of {share:.0f} % of the last gestures lies outside of what the model was trained on"
        yield Finding("warn", what, "check the mounting; record people here, and train with them")


def _output(status: dict[str, Any]) -> Iterator[Finding]:
    out = status["output"]
    if out["lines_lost"] or out["evicted"]:
        what = f"slow subscribers lost {out['lines_lost']} lines, {sum(out['evicted'].values())} were cut off"
        ages = [*_ages(status, "lines_lost").values(), *_ages(status, "evicted").values()]
        yield _dated(what, min(ages, default=None), "read in a thread of its own, and faster")
    for result, count in out["osc"].items():
        if result != "sent":
            remedy = "does anybody listen at the --publish addresses?"
            if result in ("unreachable", "unresolved"):
                remedy = "does a network lead to the --publish addresses? The installed service needs osc-output.conf"
            yield _dated(f"OSC output: {count} {result}", _ages(status, "osc").get(result), remedy)
