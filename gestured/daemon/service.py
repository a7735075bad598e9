"""One daemon: it puts the parts together, and runs timers and reloads from start to end."""

import asyncio
import os
import secrets
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gestured import __version__
from gestured.client.notify import notify
from gestured.core import messages
from gestured.core.errors import GesturedError
from gestured.core.events import Status
from gestured.core.hub import Hub
from gestured.core.own import Examples
from gestured.daemon import log as logging
from gestured.daemon import own_file, systemd
from gestured.daemon.bound import Bound
from gestured.daemon.canary import Canary
from gestured.daemon.clients import EventServer
from gestured.daemon.control import ControlServer
from gestured.daemon.desk import Desk
from gestured.daemon.health import TICK_S, Pulse
from gestured.daemon.ladder import open_ladder
from gestured.daemon.log import log
from gestured.daemon.metrics import Metrics
from gestured.daemon.operations import Operations
from gestured.daemon.own import OwnGestures
from gestured.daemon.publisher import Publisher
from gestured.daemon.scene import scene_of
from gestured.daemon.settings import Settings
from gestured.daemon.sinks import OscSink
from gestured.daemon.snapshot import Models, Snapshot
from gestured.daemon.sockets import kernel_drops
from gestured.daemon.tap import Taps
from gestured.daemon.udp import Receiver
from gestured.daemon.watch import Watch
from gestured.model.ladder import Ladder

STATUS_S = 1.0
DRAIN_S = 0.5
SHOWN = 4  # sensors in systemd's status line
AT_A_RESTART = ("listen", "socket", "control", "metrics", "flight_recorder")  # settings that a reload cannot change

Loader = Callable[[], Settings]
OwnFile = tuple[Path | None, tuple[Examples, str | None]]  # where it is, what is in it, and what is wrong with it


class Service:
    """Everything that lives while the daemon runs."""

    def __init__(self, settings: Settings, ladder: Ladder, bound: Bound, load: Loader) -> None:
        """Serves from now on. `load` reads the configuration again, for a reload."""
        self._settings, self._ladder, self._bound, self._load = settings, ladder, bound, load
        self._instance, self._started, self._stopping = secrets.token_hex(8), time.time(), False
        self._begun = time.monotonic()
        self._tasks: set[asyncio.Future[Any]] = set()  # a task that nobody holds may be collected
        self._said = ""  # to systemd
        self._reloading = asyncio.Lock()
        self._pulse, self._metrics = Pulse(), Metrics()
        for name in settings.sensors:
            self._metrics.sensor_label(name)  # those in the file are named first
        self._own = OwnGestures(self._own_changed)
        self._own.follow(ladder, *_own_file(settings))
        self._hub = Hub(scene_of(settings, ladder), ladder)
        self._watch, self._taps = Watch(ladder), Taps(settings.flight_recorder << 20)
        self._clients = EventServer(
            bound.events.sock,
            self._hello,
            self._metrics,
            gestures=self._gestures,
            changed=self._foresee,
        )
        self._osc = self._destinations(settings)
        self._foresee()
        self._publisher = Publisher(self._metrics, (self._clients, self._taps, *self._osc))
        self._desk = Desk(self._metrics, self._publisher, self._watch, self._own)
        self._receiver = Receiver(bound.udp, self._hub, self._desk, self._taps)
        operations = Operations(
            self._hub, self._desk, self._publisher, self._watch, self._taps, self._metrics, self._own,
            self.snapshot, self.reload,
        )  # fmt: skip
        self._control = ControlServer(bound.control.sock, operations.verbs())
        self._http: Any = None
        if bound.http is not None:
            from gestured.daemon.http import serve_pages

            self._http = serve_pages(bound.http, self.snapshot, self._metrics)

    def snapshot(self) -> Snapshot:
        """How the daemon is now. Any thread may ask."""
        now = time.monotonic()
        shadow = self._watch.shadow
        return Snapshot(
            instance=self._instance,
            time=time.time(),
            now=now,
            started=self._started,
            uptime_s=now - self._begun,
            stopping=self._stopping,
            loop_age_s=self._pulse.age_s,
            loop_lag_s=self._pulse.lag_s,
            models=Models.of(self._ladder, self._watch.shift, self._publisher.models_failed),
            gestures=self._hub.scene.gestures,
            own=self._own.report(),
            sensors=self._hub.readings(self._receiver.served(now)),
            recent=self._publisher.recent(),
            shadow=shadow.report() if shadow else None,
            clients=self._clients.count,
            backlog_bytes=self._clients.backlog,
            kernel_drops=kernel_drops(self._bound.udp),
            taps=self._taps.count,
            flight_limit_bytes=self._taps.ring_bytes,
            flight_held_bytes=self._taps.held_bytes,
            addresses=self._bound.addresses(),
            settings=self._settings.model_dump(mode="json"),
        )

    def _hello(self) -> bytes:
        """The first line to a client."""
        sequences = self._hub.sequences()
        return messages.hello_json(__version__, self._instance, self._ladder.active, self._gestures(), sequences)

    def _gestures(self) -> tuple[str, ...]:
        """Those that a client may hear of: the model's in use, and the user's own."""
        return (*self._hub.scene.gestures, *self._own.gestures)

    def _own_changed(self) -> None:
        """One of the user's own gestures came or went: whatever was asked about a contact is asked again."""
        self._desk.take(self._hub.change(self._hub.scene, self._ladder, time.monotonic()))
        self._clients.tell(messages.gestures_json(self._gestures()))

    def _foresee(self) -> None:
        """Have the hub give provisional events where somebody asks for them now."""
        named, every = self._clients.foresees()
        every = every or bool(self._settings.publish_provisional and self._osc)
        self._hub.foresee(lambda sensor: every or sensor in named)

    def _destinations(self, settings: Settings) -> list[OscSink]:
        """Where OSC is sent."""
        provisional = settings.publish_provisional
        return [OscSink(address, self._metrics, provisional=provisional) for address in settings.publish]

    async def start(self) -> None:
        """Take what needs a loop that turns: the operators' connections."""
        await self._control.start()

    async def serve(self, stop: asyncio.Event, reload: asyncio.Event) -> None:
        """Look after timers, until `stop`; then finish what is in flight."""
        watchdog = systemd.watchdog_period()
        canary = Canary(self._desk)
        period = min(TICK_S, watchdog or TICK_S)
        status_at = time.monotonic()
        due = status_at
        while not stop.is_set():
            self._pulse.woke(time.monotonic() - due)
            self._receiver.read()
            now = time.monotonic()
            self._desk.take(self._hub.tick(self._receiver.served(now)))
            if now >= status_at:
                status_at = max(status_at + STATUS_S, now)  # on time, but not all at once after a stall
                self._every_second(now)
            if watchdog and canary.sings():
                notify("WATCHDOG=1")
            if reload.is_set() and not self._reloading.locked():
                reload.clear()
                self._spawn(self.reload())  # a task: frames and timers go on
            wait = min(period, status_at - now)
            due = time.monotonic() + wait
            try:
                async with asyncio.timeout(wait):
                    await stop.wait()
            except TimeoutError:
                pass
        for task in tuple(self._tasks):
            task.cancel()
        await self._finish()

    def _spawn(self, work: Any) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _every_second(self, now: float) -> None:
        self._clients.tick()
        self._taps.tick()
        self._own.tick()
        snapshot = self.snapshot()
        self._metrics.kernel(snapshot.kernel_drops)
        self._publisher.publish(Status(snapshot.state, snapshot.states, snapshot.models.active, snapshot.time))
        states = ", ".join(f"{name} {state}" for name, state in list(snapshot.states.items())[:SHOWN])
        words = f"{snapshot.state}: {snapshot.models.active} answers; sensors: {states or 'none yet'}"
        if words != self._said:
            self._said = words
            notify(f"STATUS={words}")

    async def _finish(self) -> None:
        """Answer what is in flight, give clients a moment to read it, and say goodbye."""
        self._stopping = True
        notify("STOPPING=1")
        self._receiver.drain()
        self._receiver.close()
        self._control.close()
        self._desk.take(self._hub.flush(time.monotonic()))
        await self._clients.close(DRAIN_S)
        for sink in self._osc:
            sink.close()
        if self._http is not None:
            self._http.close()
        log.info("ended")

    def _open(self, settings: Settings) -> tuple[Ladder, list[OscSink], OwnFile]:
        """What may take long: models, names of hosts, and the file of own gestures."""
        return open_ladder(settings, insist=True), self._destinations(settings), _own_file(settings)

    async def reload(self) -> str | None:
        """Read everything anew, and only where all of it is valid, change anything; else the reason."""
        async with self._reloading:
            notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
            try:
                settings = await asyncio.to_thread(self._load)  # a long file, or a slow disk
                ladder, osc, own = await asyncio.to_thread(self._open, settings)  # frames are served meanwhile
            except Exception as error:
                bug = not isinstance(error, GesturedError)
                said = log.exception if bug else log.error
                said("reload refused, nothing has changed", reason=str(error))
                self._metrics.reloads.add("refused")
                return f"a bug: {error!r}" if bug else str(error)
            else:
                self._swap(settings, ladder, osc, own)
                return None
            finally:
                notify("READY=1")

    def _swap(self, settings: Settings, ladder: Ladder, osc: list[OscSink], own: OwnFile) -> None:
        for key in AT_A_RESTART:
            if getattr(settings, key) != getattr(self._settings, key):
                log.warning("this setting changes at a restart only", key=key)
        logging.configure(settings.log_level)
        self._settings, self._ladder = settings, ladder
        self._watch.follow(ladder)
        before = self._gestures()
        self._own.follow(ladder, *own)
        self._desk.take(self._hub.change(scene_of(settings, ladder), ladder, time.monotonic()))
        if self._gestures() != before:
            self._clients.tell(messages.gestures_json(self._gestures()))
        for sink in self._osc:
            sink.close()
        self._osc = osc
        self._publisher.sinks = (self._clients, self._taps, *osc)
        self._foresee()
        self._metrics.reloads.add("done")
        log.info("reloaded", model=ladder.active)


def _own_file(settings: Settings) -> OwnFile:
    """Find the file of own gestures, and read it."""
    path = own_file.where(settings.own_gestures, os.environ)
    return path, own_file.load(path)
