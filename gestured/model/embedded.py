"""The recogniser of one sensor in the caller's own process, which `gestured.open` returns."""

import logging
import math
import operator
import os
from collections.abc import Collection, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, NoReturn, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from gestured.core.address import is_sensor
from gestured.core.cutter import LARGEST
from gestured.core.errors import SettingsError
from gestured.core.events import Event
from gestured.core.facts import events_of
from gestured.core.frames import Frame, Touch
from gestured.core.listening import Arming
from gestured.core.mounting import Mounting
from gestured.core.points import USUAL, Strictness
from gestured.core.scene import Scene, Setup
from gestured.core.sensor import Sensor
from gestured.core.timing import Timing
from gestured.core.where import zones_of
from gestured.model import own_file
from gestured.model.ladder import Ladder, ladder_for, require_arming
from gestured.model.own import Own
from gestured.model.own_file import OwnFileError

# By argument of `open`: its type, and in words what was expected, if no later check says it better.
_TAKES: Mapping[str, tuple[Any, str]] = {
    "model": (str | os.PathLike, "a name or a path"), "own_gestures": (str | os.PathLike | None, "a path"),
    "rotate": (int | np.integer, "0, 90, 180 or 270"),
    "gestures": (Collection | None, "a list of names"), "zones": (Mapping | None, "four numbers for each name"),
    "thresholds": (Mapping | None, "a confidence for each name, such as {'one_tap': 0.8}"),
    **dict.fromkeys(("tap_gap_s", "arming.seconds"), (SupportsFloat, "a number of seconds")),
    **dict.fromkeys(("mirror", "invert", "provisional", "touch"), (bool | np.bool_, "true or false")),
}  # fmt: skip


class Embedded:
    """The recogniser of one sensor: frames in, and out the events that the daemon gives for the same frames.

    Times are seconds on any clock that goes forward from frame to frame, also across `flush` and `reset`. From the
    first second without a touch the recogniser learns the idle sensor; until then there are no events.
    """

    def __init__(self, sensor: Sensor, gestures: tuple[str, ...]) -> None:
        self.gestures = gestures  # the gestures in use, in the model's order, then the user's own
        self._sensor = sensor
        self._shape = sensor.front_end.grid_sent
        self._last = -math.inf  # s, the time of the last frame
        self._lost = 0  # frames that were lost or passed over since the one before
        self._closed: set[str] = set()  # names of the closed gates

    def __reduce_ex__(self, _: object) -> NoReturn:
        """Refuse a copy, which would share what is known of the sensor; besides, a model belongs to one process."""
        raise TypeError("a recogniser cannot be copied or pickled: use gestured.open where another one is needed")

    def push(self, t: float, values: ArrayLike, *, touches: Sequence[Touch] = (), lost: int = 0) -> list[Event]:
        """Take the frame of `t` s, (R, C) counts as the sensor sends them; return the events that it decides.

        `touches` are the finger positions that the sensor knows, and `lost` is how many frames went missing just
        before. A frame with a value that is not finite is passed over, as if it had been lost. Raises ValueError for a
        time not after the last frame's, `values` that are no frame of this sensor's grid, or a `lost` that is no count.
        """
        seconds = _seconds(t)
        if not self._last < seconds < math.inf:
            after = f"a time after the last frame's, {self._last} s" if self._last > -math.inf else "seconds"
            raise ValueError(f"t: expected {after}, found {t}")
        frame = _counts(values)
        if frame.shape != self._shape:
            raise ValueError(f"values: expected the grid {self._shape} of this sensor, found the shape {frame.shape}")
        if not hasattr(lost, "__index__") or lost < 0:
            raise ValueError(f"lost: expected a count of frames, found {lost!r}")
        self._last = seconds
        self._lost += lost
        if not np.all(np.abs(frame) <= np.float64(LARGEST)):  # NaN fails this, too; a float16 could not hold the bound
            self._lost += 1
            return []
        lost, self._lost = self._lost, 0
        return events_of(self._sensor.push(Frame(seconds, frame, tuple(touches), lost)))

    @property
    def due(self) -> float | None:
        """When `wait` will have an answer unless a frame comes before, in s; None if nothing waits."""
        return self._sensor.due

    def wait(self, t: float) -> list[Event]:
        """No frame has come until `t` s: answer a contact that is over.

        Without this call, the same answer comes with the next frame. Raises ValueError for a time before the last
        frame's.
        """
        return events_of(self._sensor.wait(self._now(t)))

    def flush(self, t: float) -> list[Event]:
        """The stream paused or ended at `t` s: decide what can be decided, and cancel the rest.

        A pause of more than a second does not need this call, since the next frame notices it. Raises ValueError for a
        time before the last frame's.
        """
        return events_of(self._sensor.flush(self._now(t)))

    def inhibit(self, t: float, gate: str) -> list[Event]:
        """Close a gate at `t` s: until it is opened every contact is unknown, and one that began before as well.

        Raises ValueError for a time before the last frame's, or a name that no gate has.
        """
        if not isinstance(gate, str) or not is_sensor(gate):
            raise ValueError(f"gate: expected 1 to 64 of A-Z, a-z, 0-9, _ and -, found {gate!r}")
        return self._gate(t, {*self._closed, gate})

    def allow(self, t: float, gate: str) -> list[Event]:
        """Open a gate at `t` s; while another one is closed the sensor stays silent. ValueError for an earlier time."""
        return self._gate(t, self._closed - {gate})

    def reset(self) -> list[Event]:
        """The sensor restarted: cancel the open contact, and learn the idle sensor anew."""
        return events_of(self._sensor.reset())

    def _gate(self, t: float, closed: set[str]) -> list[Event]:
        told = self._sensor.gate(dict.fromkeys(closed, math.inf), self._now(t))
        self._closed = closed
        return events_of(told)

    def _now(self, t: float) -> float:
        seconds = _seconds(t)
        if not self._last <= seconds < math.inf:
            raise ValueError(f"t: expected a time not before the last frame's, {self._last} s, found {t}")
        return seconds


def open(  # noqa: PLR0913 - each is one setting of a sensor, by its name
    model: str | Path = "cnn_lstm",
    *,
    sensor: str = "sensor",
    grid: tuple[int, int] | None = None,
    rotate: int = 0,
    mirror: bool = False,
    invert: bool = False,
    gestures: Sequence[str] | None = None,
    strictness: Strictness = USUAL,
    thresholds: Mapping[str, float] | None = None,
    own_gestures: str | Path | None = None,
    tap_gap_s: float = Timing().tap_gap_s,
    provisional: bool = False,
    zones: Mapping[str, Any] | None = None,
    arming: Mapping[str, Any] | None = None,
    touch: bool = False,
) -> Embedded:
    """The recogniser of one sensor with a model: the name of one that ships, or the path of an .onnx file.

    `sensor` is the name in its events; `grid` its rows and columns as it sends them, the model's unless told; `rotate`
    (degrees clockwise: 0, 90, 180, 270) and `mirror` say how it is mounted, `invert` that its counts fall under
    pressure; `gestures` are those to use, all unless told; `strictness` ("eager", "normal", "strict") is how sure
    the model must be, by operating points of its own; `thresholds` are the confidences, 0 to 1, from which a gesture is
    one, before those of the strictness; `own_gestures` is a daemon's file of gestures that were enrolled; `tap_gap_s`
    is how long a tap waits for a second one, 0.2 to 0.6 s. With `provisional` a contact's most probable gesture is
    said before it is over, where the model was made for that. `zones` are parts of the sensor by name, each as its four
    edges `(left, bottom, right, top)` in fractions, or as a mapping with `at` and the `gestures` that may begin there.
    `arming`, such as `{"by": "double_tap", "seconds": 5}`, names the gesture before which no other counts.
    With `touch` each finger is told of while it touches.

    Recognisers of one model share it. Below a shipped model stand its fallbacks, as in the daemon; where one of them
    answers, the logger `gestured` gets a warning. Raises ModelError for a model that cannot be used, SettingsError or
    OwnFileError for another mistake.
    """
    given = locals() | {"arming.seconds": arming.get("seconds", 0) if isinstance(arming, Mapping) else 0}
    for name, (kind, words) in _TAKES.items():
        if not isinstance(given[name], kind):
            raise SettingsError(f"{name}: expected {words}, found {given[name]!r}")
    if not isinstance(sensor, str) or not is_sensor(sensor):
        raise SettingsError(f"sensor: expected 1 to 64 of A-Z, a-z, 0-9, _ and -, found {sensor!r}")
    for name in zones or ():
        if not isinstance(name, str):
            raise SettingsError(f"zones: expected a text as the name of each, found {name!r}")
    ladder = ladder_for(model, report=logging.getLogger("gestured").warning)
    used = ladder.gestures_in_use(gestures)
    if own_gestures is not None:
        ladder.own = _own(ladder, Path(own_gestures))
    try:
        rows, columns = map(operator.index, (ladder.rows, ladder.columns) if grid is None else grid)
    except (TypeError, ValueError):
        raise SettingsError(f"grid: expected rows and columns, such as (9, 9), found {grid!r}") from None
    try:
        scene = Scene(
            gestures=used,
            grid=(rows, columns),
            sensors={sensor: Setup(mounting=Mounting(rotate, mirror, invert), zones=zones_of(zones or {}))},
            tap_gap_s=float(tap_gap_s),
            touch=touch,
            strictness=strictness,
            arming=Arming.of(arming),
            thresholds=_thresholds(thresholds or {}),
        )
    except (TypeError, ValueError, OverflowError) as error:
        raise SettingsError(str(error)) from None
    ladder.report_missing_points((strictness,))
    named = {f"zones.{name}.gestures": zone.gestures or () for name, zone in scene.setup(sensor).zones.items()}
    for field, names in ({"thresholds": thresholds or ()} | named).items():
        unknown = [name for name in names if name not in ladder.own.gestures]
        ladder.require_gestures((name for name in unknown if not (own_gestures and ladder.may_be_own(name))), field)
    require_arming(scene, (*used, *ladder.own.gestures))
    found = Sensor(sensor, scene, ladder)
    found.foresee(asked=provisional)
    found.follow([], asked=touch)
    return Embedded(found, (*used, *ladder.own.gestures))


def _own(ladder: Ladder, path: Path) -> Own:
    """The gestures of a file, for a model that can compare them."""
    found = own_file.load(path)
    if found.fault is not None:
        raise OwnFileError(found.fault)
    if not found.sha256:  # a daemon makes the file at the first enrolment
        ladder.report(f"{path}: no such file, so there are no gestures of your own yet")
    if ladder.model.space is None and not ladder.degraded:
        raise SettingsError(f"own_gestures: {ladder.name} has no embedding, expected a model that was made for them")
    return ladder.compared(found.gestures)


def _thresholds(told: Mapping[str, float]) -> Mapping[str, float]:
    """Confidences by name."""
    for name, least in told.items():
        if isinstance(least, bool) or not isinstance(least, Real) or not 0 <= least <= 1:
            raise SettingsError(f"thresholds: {name}: expected 0 to 1, found {least!r}")
    return {name: float(least) for name, least in told.items()}


def _seconds(t: Any) -> float:
    """A time as a float, since times are added to others; NaN for what is no number."""
    try:
        return float(t) if hasattr(t, "__float__") else math.nan
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _counts(values: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.generic]]:
    """An array of numbers; raises ValueError for anything else."""
    try:
        frame = np.asarray(values)
    except ValueError:  # rows of different lengths
        frame = np.asarray(None)
    if frame.dtype.kind not in "biuf":
        raise ValueError("values: expected an array of numbers, rows of equal length")
    return frame
