"""`gestured --explain`: what a configuration loads, listens to, computes, leaves out, and why."""

import os
from collections.abc import Iterator, Mapping

from gestured import __version__
from gestured.client.address import control_beside, default_socket
from gestured.core.errors import ModelError
from gestured.core.scene import DOUBLE_TAP
from gestured.daemon.asked import open_ladder, outputs_of, scene_of
from gestured.daemon.client import BACKLOG_BYTES
from gestured.daemon.clients import CLIENTS
from gestured.daemon.settings import TABLES, TITLES, Part, Settings, as_written
from gestured.daemon.tap import KEPT_S
from gestured.model import own_file
from gestured.model.ladder import Ladder

LOADS, FALLBACKS, INPUT, OUTPUT, THRESHOLDS, COMPUTES, LEAVES, SET_BY = TITLED = (
    "loads", "falls back on", "listens to", "publishes on", "thresholds", "computes", "leaves out", "set by",
)  # fmt: skip
Said = Iterator[tuple[str, str]]  # the title under which a line stands, and the line


def explain(settings: Settings, sources: Mapping[str, str]) -> str:
    """What `--explain` prints. It opens the models and binds nothing. Raises ModelError or SettingsError."""
    ladder = open_ladder(settings)
    parts: dict[str, list[str]] = {title: [] for title in TITLED}
    for said in (_models, _own, _input, _output, _answers, _strictness):
        for title, line in said(settings, ladder):
            parts[title].append(line)
    parts[SET_BY] = list(_keys(settings, sources)) or ["nothing, all defaults"]
    lines = [f"gestured {__version__}"]
    for title, items in parts.items():
        lines += ["", f"{title}:", *(f"  {item}" for item in items or ["nothing"])]
    return "\n".join(lines)


def _models(settings: Settings, ladder: Ladder) -> Said:
    model, window = ladder.model, ladder.model.metadata.window
    what = f"{model.metadata.kind} {model.metadata.version}, {model.size:,} bytes, sha256 {model.sha256[:12]}"
    made_for = f"{window.rows}x{window.columns} at {window.rate_hz:g} Hz"
    yield LOADS, f"model {ladder.active}: {what}, {made_for}"
    used = ladder.gestures_in_use(settings.gestures)
    yield LOADS, f"gestures {', '.join(used)}"
    if unused := [name for name in ladder.gestures if name not in used]:
        yield LEAVES, f"gestures {', '.join(unused)}: their scores are dropped"
    for n, rung in enumerate(ladder.rungs[1:], 1):
        if rung.refused is None:
            yield FALLBACKS, f"{rung.name}{', in use' if n == ladder.rung else ''}"


def _own(settings: Settings, ladder: Ladder) -> Said:
    """The own gestures that are loaded, or why there are none, and why none can be enrolled."""
    own = own_file.load(own_file.where(settings.own_gestures, os.environ))
    if own.fault or own.path is None:
        yield LEAVES, f"own gestures: {own.fault or own_file.NO_FILE}"
        return
    if ladder.model.space is None:
        yield LEAVES, f"own gestures: {ladder.active} has no embedding"
        return
    yield LOADS, f"own gestures {', '.join(own.gestures) or '(none yet)'}, in {own.path}"
    # Folders that are missing are made when something is enrolled.
    folder = next(folder for folder in own.path.absolute().parents if os.path.exists(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        yield LEAVES, f"enrolling: this account has no right to write in {folder}"


def _input(settings: Settings, ladder: Ladder) -> Said:
    grid = settings.grid or f"{ladder.rows}x{ladder.columns}"
    yield INPUT, f"udp {settings.listen} for {settings.addresses.pressure}"
    allowed = ", ".join(map(str, settings.allow)) or "any source"
    yield INPUT, f"frames of {grid}, clock {settings.clock}, up to {settings.max_sensors} sensors, from {allowed}"
    armed = {"all sensors": settings.arming}
    for name, sensor in settings.sensors.items():
        armed[f"sensor {name}"] = sensor.arming
        mirrored = "mirrored" if sensor.mirror else "not mirrored"
        zones = f", zones {', '.join(sensor.zones)}" if sensor.zones else ""
        mounted = f"rotated by {sensor.rotate}, {mirrored}, clock {sensor.clock or settings.clock}"
        yield INPUT, f"sensor {name}: {sensor.grid or grid}, {mounted}{zones}"
    for which, arming in armed.items():
        if arming is not None:
            yield INPUT, f"{which}: no gesture counts but {arming.by}, and all for {arming.seconds:g} s after it"
    if settings.gate.start:
        yield INPUT, f"nothing, until these gates are allowed: {', '.join(settings.gate.start)}"


def _output(settings: Settings, ladder: Ladder) -> Said:
    path = settings.socket or default_socket(os.environ)
    yield OUTPUT, f"unix {path}, mode 0660, {CLIENTS} clients, {BACKLOG_BYTES >> 10} KiB waiting each"
    outputs = [*outputs_of(settings)]
    for one in outputs:
        yield OUTPUT, f"{one.where}: {one.tells}"
    yield OUTPUT, f"control: unix {settings.control or control_beside(path)}, mode 0660, for owner and group"
    if settings.gates is not None:
        yield OUTPUT, f"gates: unix {settings.gates}, mode 0660, for bridges"
    if not outputs:
        yield LEAVES, "OSC output: no --publish"
    if settings.metrics:
        yield INPUT, f"http {settings.metrics} for /metrics, /healthz, /readyz"
    else:
        yield LEAVES, "HTTP: no --metrics"


def _answers(settings: Settings, ladder: Ladder) -> Said:
    """What is computed for an answer, how long it takes, and which events come before it."""
    timing, metadata = scene_of(settings, ladder).timing, ladder.model.metadata
    rate_hz = metadata.window.rate_hz

    def felt(wait_s: float) -> str:
        """From the last touched frame to the answer, in words: the wait begins with the first quiet frame."""
        return f"{1 / rate_hz + wait_s:.2g} s"

    made = "its frames as a window" if metadata.features is None else "touch-pattern features"
    yield COMPUTES, f"after a contact: {made}, one inference"
    answered = f"at {rate_hz:g} Hz a contact is answered {felt(timing.release_s)} after its last touched frame"
    if DOUBLE_TAP in ladder.gestures_in_use(settings.gestures):
        yield COMPUTES, f"{answered}, a tap {felt(timing.tap_gap_s)} after it, since a second one may come"
    else:
        yield COMPUTES, answered
        yield LEAVES, "waiting for a second tap: double_tap is not in use"
    if settings.flight_recorder:
        held = f"the last {KEPT_S:g} s of packets, at most {settings.flight_recorder} MiB"
        yield COMPUTES, f"flight recorder: {held}"
    else:
        yield LEAVES, "flight recorder: flight_recorder is 0"
    asked = "while touched, where somebody asks for"
    if ladder.certainty is None:
        yield LEAVES, f"provisional events: the model {ladder.active} was not made for them"
    else:
        yield COMPUTES, f"{asked} provisional events: one inference a frame, at most 15 a second"
        if not settings.provisional_taps:
            yield LEAVES, "one tap as a provisional event: provisional_taps is false"
    if settings.touch:
        yield COMPUTES, f"{asked} touch events: where its fingers are, at most 60 times a second"
    else:
        yield LEAVES, "touch events: touch is false"


def _strictness(settings: Settings, ladder: Ladder) -> Said:
    """The strictness, what each operating point costs on each rung, and the thresholds that take precedence."""
    own = (f", {name} {sensor.strictness}" for name, sensor in settings.sensors.items() if sensor.strictness)
    yield THRESHOLDS, f"strictness {settings.strictness}{''.join(own)}"
    arms = settings.arming or any(sensor.arming for sensor in settings.sensors.values())
    for rung in ladder.rungs:
        try:
            model = rung.open()
        except ModelError as error:
            yield THRESHOLDS, f"{rung.name} could not be used: {error}"
            continue
        if model.points is None:
            one = f"{model.threshold:.2f} for all, whatever the strictness"
            yield THRESHOLDS, f"{rung.name} has no operating points: {one}"
            continue
        for name, point in model.points.items():
            cost = f"{100 * point.missed:.1f} % missed, {point.false_per_hour:.2g} false an hour"
            yield THRESHOLDS, f"{rung.name} {name}: {cost}, in the {point.hours:g} hours on which it was chosen"
        if arms:
            most = f"{model.threshold:.2f} at most, whatever the strictness"
            yield THRESHOLDS, f"{rung.name}, after a gesture that arms: {most}"
    told = [f"{name} {part.threshold:g}" for name, part in settings.per_gesture.items() if part.threshold is not None]
    if told:
        yield THRESHOLDS, f"before these, thresholds of [gestures]: {', '.join(told)}"


def _keys(settings: Settings, sources: Mapping[str, str]) -> Iterator[str]:
    """Each key that was set, as its source writes it, and that source."""
    for key, source in sources.items():
        table = getattr(settings, key)
        title = TITLES.get(key, key)
        if isinstance(table, Part):
            yield from (f"{title}.{field}: {source}" for field in sorted(table.model_fields_set))
        elif key in TABLES:
            for name, part in table.items():
                yield from (f"{title}.{name}.{field}: {source}" for field in sorted(part.model_fields_set))
        else:
            yield f"{as_written(key, sources)}: {source}"
