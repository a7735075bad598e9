"""One daemon: pipeline, sinks, timers and reloads, from start to end."""

import asyncio
import socket
import time
from collections.abc import Callable
from typing import Any

from gestured.core import messages
from gestured.core.errors import GesturedError
from gestured.core.events import Event, Gesture, Status
from gestured.daemon import log as logging
from gestured.daemon import systemd
from gestured.daemon.bound import Bound
from gestured.daemon.canary import Canary
from gestured.daemon.clients import EventServer
from gestured.daemon.control import Connection, ControlServer
from gestured.daemon.health import TICK_S, Health
from gestured.daemon.ladder import open_ladder
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.operations import verbs
from gestured.daemon.pipeline import Pipeline
from gestured.daemon.reading import by_label
from gestured.daemon.settings import Settings
from gestured.daemon.sinks import OscSink, Sink
from gestured.daemon.sockets import kernel_drops, name_of
from gestured.daemon.status import Recent
from gestured.daemon.tap import Taps
from gestured.daemon.udp import Receiver
from gestured.model.ladder import Ladder

STATUS_S = 1.0
DRAIN_S = 0.5
SHOWN = 4  # sensors in systemd's status line

Loader = Callable[[], Settings]


class Service:
    """Everything that lives while the daemon runs."""

    def __init__(self, settings: Settings, ladder: Ladder, bound: Bound, load: Loader) -> None:
        """Serves from now on. `load` reads the configuration again, for a reload."""
        self.settings, self._load, self._bound = settings, load, bound
        self.started = time.monotonic()
        self.tasks: set[asyncio.Future[Any]] = set()  # a task that nobody holds may be collected
        self._throttle = Throttle()
        self._said = ""  # to systemd
        self._reloading = asyncio.Lock()
        self.metrics = Metrics()
        for name in settings.sensors:
            self.metrics.sensor_label(name)  # those in the file are named first
        self.pipeline = Pipeline(settings, ladder, self.metrics, self.emit)
        self.health = Health(self.pipeline)
        self.recent = Recent()
        self.taps = Taps(settings.flight_recorder << 20)
        self.clients = EventServer(bound.events.sock, self.health.hello, self.metrics)
        self._osc = [OscSink(address, self.metrics) for address in settings.publish]
        self._receiver = Receiver(bound.udp, self.pipeline)
        self._control = ControlServer(bound.control.sock, verbs(self))
        self._http: Any = None
        if bound.http is not None:
            self._serve_http(bound.http)
        self._listen_in()

    def addresses(self) -> dict[str, str | None]:
        """Where it can be reached."""
        bound = self._bound
        return {
            "listen": name_of(bound.udp),
            "socket": str(bound.events.path),
            "control": str(bound.control.path),
            "metrics": name_of(bound.http) if bound.http else None,
        }

    def kernel_drops(self) -> int:
        """Packets that found no room in the socket's buffer."""
        return kernel_drops(self._bound.udp)

    def tap(self, connection: Connection) -> None:
        """Stream packets and events to an operator."""
        self.taps.join(connection)
        self._listen_in()

    def _listen_in(self) -> None:
        self._receiver.tap = self.taps.packets if self.taps.active else None

    def _serve_http(self, sock: socket.socket) -> None:
        """Answer HTTP on a listening socket, in a thread; imports prometheus_client with the first scrape."""
        from gestured.daemon.http import HttpThread, as_json

        started, metrics, health, pipeline = time.time(), self.metrics, self.health, self.pipeline

        def ladder() -> Ladder:
            return pipeline.watched.ladder

        metrics.active_model = lambda: ladder().active
        metrics.shift = lambda: pipeline.watched.shift.shares()
        metrics.sensors = lambda: by_label(pipeline.readings(time.monotonic()), metrics.sensor_label)
        metrics.readings = {
            "gestured_sensors": ("Sensors that were heard", lambda: len(pipeline.sensors)),
            "gestured_clients": ("Clients of the event socket", lambda: self.clients.count),
            "gestured_backlog_bytes": ("Bytes that wait for slow clients", lambda: self.clients.backlog),
            "gestured_kernel_drops_total": ("Packets that found no room", self.kernel_drops),
            "gestured_loop_lag_seconds": ("How late the event loop is", lambda: health.lag_s),
            "gestured_model_rung": ("How far down the ladder stands what answers", lambda: ladder().rung),
            "gestured_model_failures_total": ("Models put aside since the last reload", lambda: ladder().failures),
            "gestured_start_time_seconds": ("When the daemon started", lambda: started),
        }
        routes = {
            "/metrics": lambda: (200, "text/plain; version=0.0.4; charset=utf-8", metrics.exposition()),
            "/healthz": lambda: as_json(*health.healthz()),
            "/readyz": lambda: as_json(*health.readyz()),
        }
        self._http = HttpThread(sock, routes)

    async def start(self) -> None:
        """Take what needs a loop that turns: the operators' connections."""
        await self._control.start()

    async def serve(self, stop: asyncio.Event, reload: asyncio.Event) -> None:
        """Look after timers, until `stop`; then finish what is in flight."""
        watchdog = systemd.watchdog_period()
        canary = Canary(self.pipeline)
        period = min(TICK_S, watchdog or TICK_S)
        status_at = time.monotonic()
        due = status_at
        while not stop.is_set():
            self.health.woke(time.monotonic() - due)
            self._receiver.read()
            now = time.monotonic()
            self.pipeline.tick(now)
            if now >= status_at:
                status_at = max(status_at + STATUS_S, now)  # on time, but not all at once after a stall
                self._every_second(now)
            if watchdog and canary.sings():
                systemd.notify("WATCHDOG=1")
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
        for task in tuple(self.tasks):
            task.cancel()
        await self._finish()

    def _spawn(self, work: Any) -> None:
        task = asyncio.ensure_future(work)
        self.tasks.add(task)
        task.add_done_callback(self.tasks.discard)

    def _every_second(self, now: float) -> None:
        self.clients.tick()
        self.pipeline.review()
        self.taps.tick()
        self._listen_in()
        status = self.health.status(now)
        self.emit(status)
        self._tell_systemd(status)

    def _tell_systemd(self, status: Status) -> None:
        states = ", ".join(f"{name} {state}" for name, state in list(status.sensors.items())[:SHOWN])
        words = f"{status.state}: {status.model} answers; sensors: {states or 'none yet'}"
        if words != self._said:
            self._said = words
            systemd.notify(f"STATUS={words}")

    async def _finish(self) -> None:
        """Answer what is in flight, give clients a moment to read it, and say goodbye."""
        self.health.stopping = True
        systemd.notify("STOPPING=1")
        self._receiver.drain()
        self._receiver.close()
        self._control.close()
        now = time.monotonic()
        for sensor in tuple(self.pipeline.sensors.values()):
            self.pipeline.flush(sensor, now)
        await self.clients.close(DRAIN_S)
        for sink in self._osc:
            sink.close()
        if self._http is not None:
            self._http.close()
        log.info("ended")

    def _open(self, settings: Settings) -> tuple[Ladder, list[OscSink]]:
        """What may take long: models, and names of hosts."""
        return open_ladder(settings, insist=True), [OscSink(address, self.metrics) for address in settings.publish]

    async def reload(self) -> str | None:
        """Read everything anew, and only where all of it is valid, change anything; else the reason."""
        async with self._reloading:
            systemd.notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
            try:
                settings = await asyncio.to_thread(self._load)  # a long file, or a slow disk
                ladder, osc = await asyncio.to_thread(self._open, settings)  # frames are served meanwhile
            except Exception as error:
                bug = not isinstance(error, GesturedError)
                said = log.exception if bug else log.error
                said("reload refused, nothing has changed", reason=str(error))
                self.metrics.reloads.add("refused")
                return f"a bug: {error!r}" if bug else str(error)
            else:
                self._swap(settings, ladder, osc)
                return None
            finally:
                systemd.notify("READY=1")

    def _swap(self, settings: Settings, ladder: Ladder, osc: list[OscSink]) -> None:
        for key in ("listen", "socket", "control", "metrics", "flight_recorder"):
            if getattr(settings, key) != getattr(self.settings, key):
                log.warning("this setting changes at a restart only", key=key)
        logging.configure(settings.log_level)
        self.settings = settings
        self.pipeline.reload(settings, ladder)
        for sink in self._osc:
            sink.close()
        self._osc = osc
        self.metrics.reloads.add("done")
        log.info("reloaded", model=ladder.active)

    def emit(self, event: Event, *, test: bool = False) -> None:
        """Give an event to every sink, then count it; a test's is no answer of a model."""
        epoch = time.time() - time.monotonic()
        sinks: tuple[Sink, ...] = (self.clients, self.taps, *self._osc)
        for sink in sinks:
            try:
                sink.publish(event, epoch, test=test)
            except Exception:  # a bug in one sink is not the others' business
                self.metrics.internal_errors.add()
                self._throttle.error("a bug in a sink", type(sink).__name__)
        if not test:
            self.metrics.event(event)
            self.health.note(event)
        elif isinstance(event, Gesture):
            self.metrics.tests.add()
        self.recent.note(event, epoch, test)
        if not isinstance(event, Status):
            name = getattr(event, "gesture", None)
            log.debug(messages.event_type(event), sensor=event.sensor, id=event.id, gesture=name)
