"""A hub with the daemon's desk behind it, at times that are written down, for tests of parts."""

from collections.abc import Mapping
from pathlib import Path

from gestured.core.beside.reading import Reading
from gestured.core.events import Event
from gestured.core.hub import Hub
from gestured.daemon.asked import scene_of
from gestured.daemon.cli import parser
from gestured.daemon.desk import Desk
from gestured.daemon.merge import load_settings
from gestured.daemon.metrics import Metrics
from gestured.daemon.own import OwnGestures
from gestured.daemon.publisher import Publisher
from gestured.daemon.settings import Settings
from gestured.daemon.shift import Shift
from gestured.daemon.snapshot import Models, Snapshot
from gestured.daemon.tap import Taps
from gestured.daemon.views import Views
from gestured.model.ladder import ladder_for
from tests.daemon.harness import Frame, floats

SOURCE = ("10.0.0.1", 1)
SNAPSHOT = Snapshot(
    instance="i", time=1.7e9, now=10.0, started=1.7e9, uptime_s=10.0, stopping=False, loop_age_s=0.1, loop_lag_s=0.0,
    models=Models("m", "m", 0, False, 0, "m.onnx", "1", "", (9, 9), False, 0, {}, ()), gestures=("one_tap",),
    own={"gestures": {}}, sensors={"arm": Reading("ok", (9, 9))}, listening={}, gates=(), overdue={}, recent=(),
    clients=0, backlog_bytes=0, kernel_drops=0, taps=0, flight_limit_bytes=0, flight_held_bytes=0, addresses={},
    settings=Settings(), awaiting_restart=[],
)  # fmt: skip


def settings_of(*flags: object, env: Mapping[str, str] = {}) -> tuple[Settings, dict[str, str]]:
    """The settings that a command line and variables make, and where each comes from."""
    given = vars(parser().parse_args(list(map(str, flags))))
    given.pop("explain")
    return load_settings(given, env)


class Kept:
    """A sink that keeps what it is given."""

    def __init__(self) -> None:
        self.events: list[Event] = []

    def publish(self, event: Event, epoch: float, *, test: bool = False) -> None:
        """Keep an event."""
        self.events.append(event)


class Parts:
    """What a daemon is made of, but for sockets, clocks and operators."""

    def __init__(self, model: Path, **given: str) -> None:
        ladder = ladder_for(model)
        self.metrics, self.taps, kept = Metrics(), Taps(0), Kept()
        self.events = kept.events
        self.hub = Hub(scene_of(load_settings({"model": str(model), **given}, {})[0], ladder), ladder)
        self.views = Views(self.hub, dict, lambda: None)
        publisher = Publisher(self.metrics, (kept,))
        self.desk = Desk(self.metrics, publisher, Shift.of(ladder.model), OwnGestures(lambda: None), self.views)

    def feed(self, name: str, frames: list[Frame], t: float) -> float:
        """Frames of a sensor at 15 Hz, from `t` s on; when the last one came."""
        for frame in frames:
            t += 1 / 15
            self.desk.take(self.hub.receive([(floats(f"/{name}/pressure", frame, 0), SOURCE)], t))
        return t
