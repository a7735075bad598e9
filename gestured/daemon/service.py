"""One daemon: sockets, pipeline, sinks, timers and signals, from start to end."""

import asyncio
import gc
import json
import os
import resource
import signal
import socket
import sys
import time
from collections.abc import Callable
from typing import Any

from gestured.core import messages, wire
from gestured.core.errors import GesturedError
from gestured.core.events import Event, Status
from gestured.daemon import log as logging
from gestured.daemon import systemd
from gestured.daemon.clients import EventServer
from gestured.daemon.health import Health
from gestured.daemon.ladder import open_ladder
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.pipeline import Pipeline
from gestured.daemon.settings import Settings, default_socket
from gestured.daemon.sinks import OscSink, Sink
from gestured.daemon.sockets import (
    UnixListener,
    bind_tcp,
    bind_udp,
    kernel_drops,
    make_default_directory,
    name_of,
)
from gestured.daemon.udp import Receiver
from gestured.ladder import Ladder

TICK_S = 0.25
STATUS_S = 1.0
DRAIN_S = 0.5
DESCRIPTORS = 4096  # for 1024 clients; the usual soft limit is 1024 in all

Loader = Callable[[], Settings]


def make_decoder(settings: Settings, pipeline: Pipeline) -> wire.Decoder:
    """Trajectories have no consumer yet: they are passed over at their address."""
    addresses = wire.Addresses(settings.addresses.pressure, settings.addresses.trajectory)
    return wire.Decoder(addresses, pipeline.grid, keep_touches=False)


class Service:
    """Everything that lives while the daemon runs."""

    def __init__(
        self, settings: Settings, ladder: Ladder, udp: socket.socket, listener: UnixListener, load: Loader
    ) -> None:
        """Serves from now on. `load` reads the configuration again, for SIGHUP."""
        self._settings, self._ladder, self._load = settings, ladder, load
        self._udp, self._listener = udp, listener
        self._throttle = Throttle()
        self._metrics = Metrics()
        self._pipeline = Pipeline(settings, ladder, self._metrics, self._emit)
        self._health = Health(self._pipeline, ladder)
        self._clients = EventServer(listener.sock, self._health.hello, self._metrics)
        self._osc = [OscSink(address, self._metrics) for address in settings.publish]
        self._receiver = Receiver(udp, self._pipeline, make_decoder(settings, self._pipeline), settings.allow)
        self._http: Any = None

    def serve_http(self, sock: socket.socket) -> None:
        """Answer HTTP on a listening socket, in a thread; imports prometheus_client with the first scrape."""
        from gestured.daemon.http import HttpThread, as_json

        started, metrics, health = time.time(), self._metrics, self._health
        metrics.active_model = lambda: self._ladder.active
        metrics.readings = {
            "gestured_sensors": ("Sensors that were heard", lambda: len(self._pipeline.sensors)),
            "gestured_clients": ("Clients of the event socket", lambda: self._clients.count),
            "gestured_backlog_bytes": ("Bytes that wait for slow clients", lambda: self._clients.backlog),
            "gestured_kernel_drops_total": ("Packets that found no room", lambda: kernel_drops(self._udp)),
            "gestured_start_time_seconds": ("When the daemon started", lambda: started),
        }
        routes = {
            "/metrics": lambda: (200, "text/plain; version=0.0.4; charset=utf-8", metrics.exposition()),
            "/healthz": lambda: as_json(*health.healthz()),
            "/readyz": lambda: as_json(*health.readyz()),
        }
        self._http = HttpThread(sock, routes)

    async def serve(self, stop: asyncio.Event, reload: asyncio.Event) -> None:
        """Look after timers, until `stop`; then finish what is in flight."""
        watchdog = systemd.watchdog_period()
        period = min(TICK_S, watchdog or TICK_S)
        status_at = time.monotonic()
        reloading: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        reloading.set_result(None)
        while not stop.is_set():
            self._receiver.read_all()  # a sensor whose frames wait for us is not silent
            now = self._health.beat = time.monotonic()
            self._pipeline.tick(now)
            if now >= status_at:
                status_at = max(status_at + STATUS_S, now)  # on time, but not all at once after a stall
                self._clients.tick()
                self._emit(self._health.status(now))
            if watchdog:
                systemd.notify("WATCHDOG=1")
            if reload.is_set() and reloading.done():
                reload.clear()
                reloading = asyncio.ensure_future(self._reload())  # a task: frames and timers go on
            try:
                async with asyncio.timeout(min(period, status_at - now)):
                    await stop.wait()
            except TimeoutError:
                pass
        reloading.cancel()
        await self._finish()

    async def _finish(self) -> None:
        """Answer what is in flight, give clients a moment to read it, and say goodbye."""
        self._health.stopping = True
        systemd.notify("STOPPING=1")
        self._receiver.read_all()
        self._receiver.close()
        now = time.monotonic()
        for sensor in tuple(self._pipeline.sensors.values()):
            self._pipeline.flush(sensor, now)
        await self._clients.close(DRAIN_S)
        for sink in self._osc:
            sink.close()
        if self._http is not None:
            self._http.close()
        log.info("ended")

    def _open(self, settings: Settings) -> tuple[Ladder, list[OscSink]]:
        """What may take long: models, and names of hosts."""
        return open_ladder(settings, insist=True), [OscSink(address, self._metrics) for address in settings.publish]

    async def _reload(self) -> None:
        """Read everything anew, and only where all of it is valid, change anything."""
        systemd.notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
        try:
            settings = self._load()
            ladder, osc = await asyncio.to_thread(self._open, settings)  # frames are served meanwhile
        except GesturedError as error:
            self._metrics.reloads.add("refused")
            log.error("reload refused, nothing has changed", reason=str(error))
        except Exception:
            self._metrics.reloads.add("refused")
            log.exception("reload refused because of a bug, nothing has changed")
        else:
            for key in ("listen", "socket", "metrics"):
                if getattr(settings, key) != getattr(self._settings, key):
                    log.warning("this setting changes at a restart only", key=key)
            logging.configure(settings.log_level)
            self._settings, self._ladder, self._health.ladder = settings, ladder, ladder
            self._pipeline.reload(settings, ladder)
            self._receiver.configure(make_decoder(settings, self._pipeline), settings.allow)
            for sink in self._osc:
                sink.close()
            self._osc = osc
            self._metrics.reloads.add("done")
            log.info("reloaded", model=ladder.active)
        systemd.notify("READY=1")

    def _emit(self, event: Event) -> None:
        """Count an event and give it to every sink."""
        self._metrics.event(event, self._ladder.last_run_s)
        self._health.note(event)
        if not isinstance(event, Status):
            name = getattr(event, "gesture", None)
            log.debug(messages.event_type(event), sensor=event.sensor, id=event.id, gesture=name)
        epoch = time.time() - time.monotonic()
        sinks: tuple[Sink, ...] = (self._clients, *self._osc)
        for sink in sinks:
            try:
                sink.publish(event, epoch)
            except Exception:  # a bug in one sink is not the others' business
                self._metrics.internal_errors.add()
                self._throttle.error("a bug in a sink", type(sink).__name__)


async def _run(settings: Settings, load: Loader) -> None:
    """Bind, open, serve. What cannot be had ends it before it says that it is ready."""
    loop = asyncio.get_running_loop()
    stop, reload = asyncio.Event(), asyncio.Event()
    throttle = Throttle()
    loop.set_exception_handler(
        lambda _, what: throttle.error("a bug in a callback", what["message"], exc_info=what.get("exception"))
    )
    loop.add_signal_handler(signal.SIGTERM, stop.set)
    loop.add_signal_handler(signal.SIGINT, stop.set)
    loop.add_signal_handler(signal.SIGHUP, reload.set)
    _raise_descriptor_limit()
    path = settings.socket
    if path is None:
        path = default_socket(os.environ)
        make_default_directory(path.parent)
    with bind_udp(settings.listen) as udp:
        http = bind_tcp(settings.metrics) if settings.metrics else None
        listener = UnixListener(path)
        try:
            ladder = open_ladder(settings)
            service = Service(settings, ladder, udp, listener, load)
            if http is not None:
                service.serve_http(http)
            gc.freeze()  # what the start has made stays: later collections need not walk through it
            _announce(udp, listener, http, ladder.active)
            await service.serve(stop, reload)
        finally:
            listener.close()


def _announce(udp: socket.socket, listener: UnixListener, http: socket.socket | None, model: str) -> None:
    ready: dict[str, Any] = {"type": "ready", "listen": name_of(udp), "socket": str(listener.path)}
    if http is not None:
        ready["metrics"] = name_of(http)
    ready["model"] = model
    log.info("ready", **{key: value for key, value in ready.items() if key != "type"})
    if sys.stdout is not None:
        logging.say(sys.stdout, json.dumps(ready, separators=(",", ":")))
    systemd.notify(f"READY=1\nSTATUS={model} on {ready['listen']}")


def _raise_descriptor_limit() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def run(settings: Settings, load: Loader) -> None:
    """Run a daemon until it is asked to end. Raises AddressError, ModelError, SettingsError."""
    import uvloop

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(_run(settings, load))
