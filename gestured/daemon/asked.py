"""What a configuration asks for: its opened models, its destinations and its scene."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from gestured.core.errors import ModelError, SettingsError
from gestured.core.scene import Scene
from gestured.daemon.log import log
from gestured.daemon.metrics import Metrics
from gestured.daemon.settings import Settings
from gestured.daemon.sinks import OscSink, UdpOut
from gestured.daemon.tuio import TUIO, TuioSink
from gestured.model import own_file
from gestured.model.ladder import Ladder, ladder_for, require_arming
from gestured.model.rung import OtherGestures


class Output(NamedTuple):
    """A destination that the settings name, not opened yet."""

    where: str  # the destination as the settings write it
    tells: str  # what is sent there, in words
    open: Callable[[Metrics], UdpOut]


@dataclass(frozen=True, slots=True)
class Asked:
    """What a configuration asks for, opened and not yet used."""

    settings: Settings
    ladder: Ladder
    outputs: list[UdpOut]
    own: Path | None  # the file of the user's own gestures


def open_all(settings: Settings, metrics: Metrics, *, insist: bool = False) -> Asked:
    """Open the models and the destinations, which may take long. Raises ModelError or SettingsError."""
    ladder = open_ladder(settings, insist=insist)
    outputs = [output.open(metrics) for output in outputs_of(settings)]
    return Asked(settings, ladder, outputs, own_file.where(settings.own_gestures, os.environ))


def outputs_of(settings: Settings) -> Iterator[Output]:
    """The destinations of events besides the sockets; a daemon opens them, and `--explain` names them."""
    early = settings.publish_provisional
    osc = f"gestures{' and provisional events' if early else ''}, and the status once a second"
    for one in settings.publish:
        if one.scheme == TUIO:
            yield Output(str(one), "fingers while they touch", partial(TuioSink, one.address))
        else:
            yield Output(str(one), osc, partial(OscSink, one.address, provisional=early))


def open_ladder(settings: Settings, *, insist: bool = False) -> Ladder:
    """Open and test the models, and check the settings that depend on them. Raises ModelError or SettingsError.

    With `insist` no fallback may answer or know other gestures, since at a reload what already runs is better.
    """
    early: list[str] = []  # sentences that are logged only if opening succeeds, since else the error says them
    ladder = ladder_for(settings.model, settings.fallback or None, report=early.append)
    refused = [rung.refused for rung in ladder.rungs]
    bad = [one for n, one in enumerate(refused) if n < ladder.rung or isinstance(one, OtherGestures)]
    if insist and bad:
        raise ModelError("; ".join(map(str, bad)))
    ladder.report = lambda sentence: log.warning("model", what=sentence)
    for sentence in early:
        ladder.report(sentence)
    ladder.report_missing_points((settings.strictness, *(own.strictness for own in settings.sensors.values())))
    try:
        _check(settings, ladder)
    except SettingsError as error:
        raise SettingsError(settings.with_source(str(error))) from error
    return ladder


def _check(settings: Settings, ladder: Ladder) -> None:
    """Check settings that depend on others, or on the models. Raises SettingsError, which begins with a setting."""
    for one in settings.publish:
        if one.scheme == TUIO and not settings.touch:
            raise SettingsError(f"publish = {one}: it tells where fingers are, expected `touch = true` as well")
    ladder.gestures_in_use(settings.gestures)
    named: dict[str, Iterable[str]] = {"gestures": settings.per_gesture}
    for name, sensor in settings.sensors.items():
        named |= {f"sensors.{name}.zones.{zone}.gestures": one.gestures or () for zone, one in sensor.zones.items()}
    keeps = own_file.where(settings.own_gestures, os.environ) is not None  # so that a gesture may be enrolled
    for field, names in named.items():
        ladder.require_gestures((name for name in names if not (keeps and ladder.may_be_own(name))), field)
    _require_arming(settings, ladder)


def _require_arming(settings: Settings, ladder: Ladder) -> None:
    """Raises SettingsError for an arming gesture that can never come. A broken file of own gestures is not judged."""
    scene = scene_of(settings, ladder)
    if not set(scene.arming_gestures.values()) <= set(scene.gestures):
        own = own_file.load(own_file.where(settings.own_gestures, os.environ))
        if own.fault is None:
            require_arming(scene, (*scene.gestures, *own.gestures))


def scene_of(settings: Settings, ladder: Ladder) -> Scene:
    """The scene of these settings, with a `ladder` that knows all gestures they name."""
    used = ladder.gestures_in_use(settings.gestures)
    return Scene.from_dict(settings.model_dump(), used, (ladder.rows, ladder.columns))
