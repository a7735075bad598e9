"""`gestured --explain`: what a configuration loads, listens to, computes per frame, leaves out, and why."""

import os
from collections.abc import Iterator, Mapping

from gestured import __version__
from gestured.client.address import control_beside, default_socket
from gestured.core.errors import ModelError, SettingsError
from gestured.core.scene import DOUBLE_TAP
from gestured.core.timing import Timing
from gestured.daemon.asked import open_ladder
from gestured.daemon.client import BACKLOG_BYTES
from gestured.daemon.clients import CLIENTS
from gestured.daemon.settings import INSIDE, TABLES, TITLES, ArmingSettings, Part, Settings
from gestured.daemon.sockets import RECEIVE_BYTES
from gestured.daemon.tap import KEPT_S
from gestured.model import own_file
from gestured.model.ladder import Ladder, gestures_in_use


def _felt(wait_s: float, rate_hz: float) -> str:
    """Seconds from the last touched frame to the answer, in words: the wait begins with the first quiet frame."""
    return f"{1 / rate_hz + wait_s:.2g} s"


def explain(settings: Settings, sources: Mapping[str, str]) -> str:
    """What `--explain` prints. It opens the models and binds nothing. Raises ModelError or SettingsError."""
    ladder = open_ladder(settings)
    model = ladder.model
    window = model.metadata.window
    used = gestures_in_use(ladder, settings.gestures)
    path = settings.socket or default_socket(os.environ)
    grid = settings.grid or f"{ladder.rows}x{ladder.columns}"
    rungs = [f"{rung.name}{', in use' if rung.name == ladder.active else ''}" for rung in ladder.rungs[1:]]
    forest = model.metadata.features is not None
    timing = Timing(tap_gap_s=settings.tap_gap_s)
    waits, rate_hz = DOUBLE_TAP in used, model.metadata.rate_hz

    loads = [
        f"model {ladder.active}: {model.metadata.kind} {model.metadata.version}, {model.size:,} bytes, "
        f"sha256 {model.sha256[:12]}, {window.rows}x{window.columns} at {window.rate_hz:g} Hz",
        f"gestures {', '.join(used)}",
        "numpy, onnxruntime (one thread), uvloop, pydantic, structlog",
    ]
    own, not_own = _own(settings)
    loads += own
    if settings.metrics:
        loads.append("prometheus_client, and a thread that answers HTTP")
    if settings.publish:
        loads.append("python-osc, which writes what is published")
    listens = [
        f"udp {settings.listen} for {settings.addresses.pressure}",
        f"receive buffer {RECEIVE_BYTES >> 20} MiB, as far as the kernel grants it",
        f"frames of {grid}, clock {settings.clock}, up to {settings.max_sensors} sensors, "
        f"from {', '.join(map(str, settings.allow)) or 'any source'}",
        *(
            f"sensor {name}: {sensor.grid or grid}, rotated by {sensor.rotate}, "
            f"{'mirrored' if sensor.mirror else 'not mirrored'}, clock {sensor.clock or settings.clock}"
            + (f", zones {', '.join(sensor.zones)}" if sensor.zones else "")
            for name, sensor in settings.sensors.items()
        ),
    ]
    listens += _when(settings)
    if settings.metrics:
        listens.append(f"http {settings.metrics} for /metrics, /healthz, /readyz")
    what = "gestures and provisional events" if settings.publish_provisional else "gestures"
    publishes = [
        f"unix {path}, mode 0660, {CLIENTS} clients, {BACKLOG_BYTES >> 10} KiB waiting each",
        *(
            f"{one}: {'fingers while they touch' if one.scheme == 'tuio' else f'{what}, and the status once a second'}"
            for one in settings.publish
        ),
    ]
    publishes.append(f"control: unix {settings.control or control_beside(path)}, mode 0660, for owner and group")
    publishes += [f"gates: unix {gates}, mode 0660, for bridges" for gates in [settings.gates] if gates is not None]
    computes = [
        "decode, check, stamp; subtract the baseline, compare with the noise; no smoothing, no inference",
        f"after a contact: {'touch-pattern features' if forest else 'its frames as a window'}, one inference",
        f"at {rate_hz:g} Hz a contact is answered {_felt(timing.release_s, rate_hz)} after its last touched frame"
        + (f", a tap {_felt(timing.tap_gap_s, rate_hz)} after it, since a second one may come" if waits else ""),
    ]
    leaves = [
        "finger positions (trajectory): nothing uses them, they are passed over at their address",
        "fallback models: opened when the one above fails",
        "torch, scikit-learn: never loaded by the daemon",
    ]
    if settings.flight_recorder:
        computes.append(f"flight recorder: the last {KEPT_S:g} s of packets, at most {settings.flight_recorder} MiB")
    else:
        leaves.append("flight recorder: flight_recorder is 0")
    if not settings.metrics:
        leaves.append("prometheus_client, HTTP: no --metrics")
    if not settings.publish:
        leaves.append("python-osc, OSC output: no --publish")
    if not waits:
        leaves.append("waiting for a second tap: double_tap is not in use")
    if len(used) < len(ladder.gestures):
        leaves.append(f"gestures {', '.join(g for g in ladder.gestures if g not in used)}: their scores are dropped")
    parts = {
        "loads": loads,
        "falls back on": rungs or ["nothing"],
        "listens to": listens,
        "publishes on": publishes,
        "thresholds": list(_strictness(settings, ladder)),
        "computes per frame": [*computes, *_early(settings, ladder)],
        "leaves out": [*leaves, *not_own, *_not_early(settings, ladder)],
        "set by": list(_keys(settings, sources)) or ["nothing, all defaults"],
    }
    lines = [f"gestured {__version__}"]
    for title, items in parts.items():
        lines += ["", f"{title}:", *(f"  {item}" for item in items)]
    return "\n".join(lines)


def _own(settings: Settings) -> tuple[list[str], list[str]]:
    """Which own gestures are loaded, and why none can be enrolled. Raises SettingsError for a path that cannot be."""
    own = own_file.load(own_file.where(settings.own_gestures, os.environ))
    if own.fault and settings.own_gestures:
        raise SettingsError(f"own_gestures: {own.fault}")
    if own.fault or own.path is None:
        return [], [f"enrolling: {own.fault or own_file.NO_FILE}"]
    # Folders that are missing are made when something is enrolled.
    folder = next(folder for folder in own.path.absolute().parents if os.path.exists(folder))
    may = os.access(folder, os.W_OK | os.X_OK)
    return (
        [f"own gestures {', '.join(own.gestures) or '(none yet)'}, in {own.path}"],
        [] if may else [f"enrolling: this account has no right to write in {folder}"],
    )


def _armed(settings: Settings) -> dict[str, ArmingSettings | None]:
    """By which sensors they are for: the settings of what arms them, None where nothing does."""
    return {"all sensors": settings.arming} | {f"sensor {name}": own.arming for name, own in settings.sensors.items()}


def _when(settings: Settings) -> Iterator[str]:
    """What must come before a gesture counts, and what is silent from the start."""
    for which, arming in _armed(settings).items():
        if arming is not None:
            yield f"{which}: no gesture counts but {arming.by}, and all for {arming.seconds:g} s after it"
    if settings.gate.start:
        yield f"nothing, until these gates are allowed: {', '.join(settings.gate.start)}"


def _keys(settings: Settings, sources: Mapping[str, str]) -> Iterator[str]:
    """What was set, each key as the file has it, and by what."""
    for key, source in sources.items():
        table = getattr(settings, key)
        title = TITLES.get(key, key)
        if isinstance(table, Part):
            yield from (f"{title}.{field}: {source}" for field in sorted(table.model_fields_set))
        elif key in TABLES:
            for name, part in table.items():
                yield from (f"{title}.{name}.{field}: {source}" for field in sorted(part.model_fields_set))
        else:
            table, inner = INSIDE.get(key, (key, ""))
            yield f"{f'{key}.{inner}' if inner and sources.get(table) == source else key}: {source}"


def _strictness(settings: Settings, ladder: Ladder) -> Iterator[str]:
    """Which operating points are taken, what each of them costs on each rung, and what holds before them."""
    own = (f", {name} {sensor.strictness}" for name, sensor in settings.sensors.items() if sensor.strictness)
    yield f"strictness {settings.strictness}{''.join(own)}"
    for rung in ladder.rungs:
        try:
            model = rung.open()
        except ModelError as error:
            yield f"{rung.name} could not be used: {error}"
            continue
        if model.points is None:
            yield f"{rung.name} has no operating points: {model.threshold:.2f} for all, whatever the strictness"
        for name, point in () if model.points is None else model.points.points.items():
            yield (
                f"{rung.name} {name}: {100 * point.missed:.1f} % missed, {point.false_per_hour:.2g} false an hour, "
                f"in {point.hours:g} hours that were judged"
            )
        if model.points is not None and any(_armed(settings).values()):
            yield f"{rung.name}, after a gesture that arms: {model.threshold:.2f} at most, whatever the strictness"
    told = [f"{name} {part.threshold:g}" for name, part in settings.per_gesture.items() if part.threshold is not None]
    if told:
        yield f"before these, thresholds of [gestures]: {', '.join(told)}"


def _early(settings: Settings, ladder: Ladder) -> Iterator[str]:
    """What is computed while a contact goes on."""
    if ladder.certainty is not None:
        yield "while touched, where somebody asks for provisional events: one inference a frame, at most 15 a second"
    if settings.touch:
        yield "while touched, where somebody asks for touch events: where its fingers are, at most 60 times a second"


def _not_early(settings: Settings, ladder: Ladder) -> Iterator[str]:
    """Which provisional and touch events there are not."""
    if ladder.certainty is None:
        yield f"provisional events: the model {ladder.active} was not made for them"
    elif not settings.provisional_taps:
        yield "one tap as a provisional event: provisional_taps is false"
    if not settings.touch:
        yield "touch events: touch is false"
