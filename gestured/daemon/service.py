"""One daemon: sockets, pipeline, sinks, timers and signals, from start to end."""

import asyncio
import json
import os
import resource
import secrets
import signal
import socket
import time
from collections.abc import Callable
from typing import Any

from gestured import __version__
from gestured.core import wire
from gestured.core.errors import GesturedError, SettingsError
from gestured.core.events import Cancelled, Event, Gesture, Status, Unknown
from gestured.daemon import log as logging
from gestured.daemon import systemd
from gestured.daemon.clients import EventServer
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.pipeline import Pipeline
from gestured.daemon.settings import Settings, default_socket
from gestured.daemon.sinks import OscSink, Sink
from gestured.daemon.sockets import UnixListener, bind_tcp, bind_udp, make_default_directory, name_of
from gestured.daemon.udp import Receiver
from gestured.models import Ladder, ladder_for

TICK_S = 0.25
STATUS_S = 1.0
HANG_S = 2.0  # the loop counts as hanging after so long without a tick
DRAIN_S = 0.5
DESCRIPTORS = 4096  # for 1024 clients; the usual soft limit is 1024 in all

Loader = Callable[[], Settings]


def open_ladder(settings: Settings) -> Ladder:
    """The models of these settings, opened and tested. Raises ModelError, or SettingsError for unknown gestures."""
    early: (
        list[str] | None
    ) = []  # kept until it is clear that a model can be used; else the error says it all

    def report(sentence: str) -> None:
        if early is None:
            log.warning("model", what=sentence)
        else:
            early.append(sentence)

    ladder = ladder_for(settings.model, settings.fallback or None, report=report)
    heard, early = early, None
    for sentence in heard:
        report(sentence)
    for key, names in (("gestures", settings.gestures or ()), ("gestures", settings.per_gesture)):
        for name in names:
            if name not in ladder.gestures:
                known = ", ".join(ladder.gestures)
                raise SettingsError(
                    f"{key}: {name!r} is no gesture of {ladder.name}, expected some of {known}"
                )
    return ladder


def make_decoder(settings: Settings, pipeline: Pipeline) -> wire.Decoder:
    """Trajectories have no consumer yet: they are passed over at their address."""
    addresses = wire.Addresses(settings.addresses.pressure, settings.addresses.trajectory)
    return wire.Decoder(addresses, pipeline.grid, keep_touches=False)


class Service:
    """Everything that lives while the daemon runs. `run` returns when it was asked to end."""

    def __init__(self, settings: Settings, load: Loader) -> None:
        """`load` reads the configuration again, for SIGHUP. Binds nothing yet."""
        self._settings, self._load = settings, load
        self._metrics = Metrics()
        self._instance = secrets.token_hex(8)
        self._throttle = Throttle()
        self._sinks: list[Sink] = []
        self._osc: list[OscSink] = []
        self._beat = time.monotonic()
        self._stopping = False
        self._reloading = False
        self._models_failed = False

    async def run(self) -> None:
        """Serve until SIGTERM or SIGINT. Raises AddressError, ModelError, SettingsError."""
        loop = asyncio.get_running_loop()
        stop = asyncio.Event()
        reload = asyncio.Event()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, stop.set)
        loop.add_signal_handler(signal.SIGHUP, reload.set)
        _raise_descriptor_limit()
        settings = self._settings
        self._udp = bind_udp(settings.listen)
        path = settings.socket
        if path is None:
            path = default_socket(os.environ)
            make_default_directory(path.parent)
        self._listener = UnixListener(path)
        try:
            http = bind_tcp(settings.metrics) if settings.metrics else None
            self._ladder = await asyncio.to_thread(open_ladder, settings)
            self._start(http)
            self._announce(http)
            await self._serve(stop, reload)
            await self._finish()
        finally:
            self._listener.close()
            self._udp.close()

    def _start(self, http: socket.socket | None) -> None:
        self._pipeline = Pipeline(self._settings, self._ladder, self._metrics, self._emit)
        self._clients = EventServer(self._listener.sock, self._hello, self._metrics)
        self._sinks.append(self._clients)
        self._connect_osc(self._settings)
        decoder = make_decoder(self._settings, self._pipeline)
        self._receiver = Receiver(self._udp, self._pipeline, decoder, self._settings.allow)
        metrics = self._metrics
        metrics.active_model = lambda: self._ladder.active
        metrics.gauges = {
            "gestured_sensors": ("Sensors that were heard", lambda: len(self._pipeline.sensors)),
            "gestured_clients": ("Clients of the event socket", lambda: self._clients.count),
            "gestured_backlog_bytes": ("Bytes that wait for slow clients", lambda: self._clients.backlog),
            "gestured_start_time_seconds": ("When the daemon started", _constant(time.time())),
        }
        self._http = None
        if http is not None:
            from gestured.daemon.http import HttpThread

            routes = {"/metrics": self._metrics_page, "/healthz": self._healthz, "/readyz": self._readyz}
            self._http = HttpThread(http, routes)

    def _announce(self, http: socket.socket | None) -> None:
        ready: dict[str, Any] = {
            "type": "ready",
            "listen": name_of(self._udp),
            "socket": str(self._listener.path),
        }
        if http is not None:
            ready["metrics"] = name_of(http)
        ready["model"] = self._ladder.active
        log.info("ready", **{key: value for key, value in ready.items() if key != "type"})
        try:
            print(json.dumps(ready, separators=(",", ":")), flush=True)
        except OSError:
            pass  # nobody reads our standard output any more
        systemd.notify(f"READY=1\nSTATUS={self._ladder.active} on {ready['listen']}")

    async def _serve(self, stop: asyncio.Event, reload: asyncio.Event) -> None:
        watchdog = systemd.watchdog_period()
        period = min(TICK_S, watchdog or TICK_S)
        status_at = 0.0
        while not stop.is_set():
            now = self._beat = time.monotonic()
            self._pipeline.tick(now)
            if now >= status_at:
                status_at = now + STATUS_S
                self._clients.tick()
                self._emit(self._status(now))
            if watchdog:
                systemd.notify("WATCHDOG=1")
            if reload.is_set():
                reload.clear()
                await self._reload()
            try:
                async with asyncio.timeout(period):
                    await stop.wait()
            except TimeoutError:
                pass

    async def _finish(self) -> None:
        """Answer what is in flight, give clients a moment to read it, and say goodbye."""
        self._stopping = True
        systemd.notify("STOPPING=1")
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

    async def _reload(self) -> None:
        """Read everything anew, and only where all of it is valid, change anything."""
        systemd.notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
        try:
            settings = self._load()
            ladder = await asyncio.to_thread(open_ladder, settings)  # frames are served meanwhile
        except GesturedError as error:
            self._metrics.reloads.add("refused")
            log.error("reload refused, nothing has changed", reason=str(error))
        else:
            for key in ("listen", "socket", "metrics"):
                if getattr(settings, key) != getattr(self._settings, key):
                    log.warning("this setting changes at a restart only", key=key)
            self._settings, self._ladder = settings, ladder
            logging.configure(settings.log_level)
            self._pipeline.reload(settings, ladder)
            self._receiver.configure(make_decoder(settings, self._pipeline), settings.allow)
            self._connect_osc(settings)
            self._metrics.reloads.add("done")
            log.info("reloaded", model=ladder.active)
        systemd.notify("READY=1")

    def _connect_osc(self, settings: Settings) -> None:
        for sink in self._osc:
            self._sinks.remove(sink)
            sink.close()
        self._osc = [OscSink(destination, self._metrics) for destination in settings.publish]
        self._sinks += self._osc

    def _emit(self, event: Event) -> None:
        """Count an event and give it to every sink."""
        metrics = self._metrics
        if isinstance(event, Gesture | Unknown):
            metrics.inference.observe(self._ladder.last_run_s, event.model)
            metrics.latency.observe(event.decided - event.offset)
            if isinstance(event, Gesture):
                metrics.gestures.add(event.gesture)
            else:
                metrics.unknown.add()
            if event.degraded:
                metrics.degraded.add()
            self._models_failed = False
        elif isinstance(event, Cancelled):
            metrics.cancelled.add(event.reason)
            self._models_failed = self._models_failed or event.reason == "model"
        if not isinstance(event, Status):
            log.debug(
                wire.event_type(event),
                sensor=event.sensor,
                id=event.id,
                gesture=getattr(event, "gesture", None),
            )
        epoch = time.time() - time.monotonic()
        for sink in self._sinks:
            try:
                sink.publish(event, epoch)
            except Exception:  # a bug in one sink is not the others' business
                metrics.internal_errors.add()
                self._throttle.error("a bug in a sink", type(sink).__name__)

    def _status(self, now: float) -> Status:
        states = self._pipeline.states(now)
        if all(state == "stale" for state in states.values()):
            state = "no_data"
        else:
            state = "degraded" if self._ladder.degraded or self._models_failed else "ok"
        return Status(state, states, self._ladder.active, time.time())

    def _hello(self) -> bytes:
        sequences = {name: sensor.recognizer.sequence for name, sensor in self._pipeline.sensors.items()}
        return wire.hello_json(
            __version__, self._instance, self._ladder.active, self._pipeline.gestures, sequences
        )

    def _metrics_page(self) -> tuple[int, str, bytes]:
        return 200, "text/plain; version=0.0.4; charset=utf-8", self._metrics.exposition()

    def _healthz(self) -> tuple[int, str, bytes]:
        from gestured.daemon.http import as_json

        age = time.monotonic() - self._beat
        return as_json(200 if age < HANG_S else 503, healthy=age < HANG_S, loop_age_s=round(age, 3))

    def _readyz(self) -> tuple[int, str, bytes]:
        from gestured.daemon.http import as_json

        reasons = []
        if time.monotonic() - self._beat >= HANG_S:
            reasons.append("the event loop hangs")
        if self._stopping:
            reasons.append("the daemon is stopping")
        if self._models_failed:
            reasons.append("no model could classify the last segment")
        body = {"ready": not reasons, "reason": "; ".join(reasons) or None, "model": self._ladder.active}
        states = self._pipeline.states(time.monotonic())
        return as_json(503 if reasons else 200, **body, degraded=self._ladder.degraded, sensors=states)


def _constant(value: float) -> Callable[[], float]:
    return lambda: value


def _raise_descriptor_limit() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def run(settings: Settings, load: Loader) -> None:
    """Run a daemon in the foreground until it is asked to end."""
    import uvloop

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(Service(settings, load).run())
