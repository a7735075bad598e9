"""A hub with the daemon's desk behind it, at times that are written down, for tests of parts."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import TypeVar

from gestured.core.events import Event
from gestured.core.hub import Hub
from gestured.daemon.asked import open_all, scene_of
from gestured.daemon.bound import bind_all
from gestured.daemon.cli import parser
from gestured.daemon.desk import Desk
from gestured.daemon.merge import load_settings
from gestured.daemon.metrics import Metrics
from gestured.daemon.own import OwnGestures
from gestured.daemon.service import Service
from gestured.daemon.settings import Settings
from gestured.daemon.shift import Shift
from gestured.daemon.tap import Taps
from gestured.daemon.views import Views
from gestured.model.ladder import ladder_for
from tests.daemon.harness import Frame, floats

SOURCE = ("10.0.0.1", 1)


def settings_of(*flags: object, env: Mapping[str, str] = {}) -> tuple[Settings, dict[str, str]]:
    """The settings that a command line and variables make, and where each comes from."""
    given = vars(parser().parse_args(list(map(str, flags))))
    given.pop("explain")
    return load_settings(given, env)


Found = TypeVar("Found")


def with_service(model: Path, folder: Path, act: Callable[[Service], Awaitable[Found]]) -> Found:
    """What `act` returns of a daemon in this process."""

    async def main() -> Found:
        settings = settings_of("--model", model, "--listen", "127.0.0.1:0", "--socket", folder / "events.sock")[0]
        metrics, bound = Metrics(), bind_all(settings)
        try:
            service = Service(open_all(settings, metrics), metrics, bound, lambda: settings)
            await service.start()
            return await act(service)
        finally:
            bound.close()

    return asyncio.run(main())


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
        self.desk = Desk(self.hub, self.metrics, Shift.of(ladder.model), OwnGestures(lambda: None), self.views)
        self.desk.sinks = (kept,)

    def feed(self, name: str, frames: list[Frame], t: float) -> float:
        """Frames of a sensor at 15 Hz, from `t` s on; when the last one came."""
        for frame in frames:
            t += 1 / 15
            self.desk.take(self.hub.receive([(floats(f"/{name}/pressure", frame, 0), SOURCE)], t))
        return t
