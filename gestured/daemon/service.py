"""One daemon: it puts the parts together, and runs their timers from start to end."""

import asyncio
import secrets
import time
from collections.abc import Sequence
from typing import Any

from gestured import __version__
from gestured.client.notify import notify
from gestured.core import messages
from gestured.core.events import Status
from gestured.core.hub import Hub
from gestured.daemon import log as logging
from gestured.daemon.asked import Asked, scene_of
from gestured.daemon.bound import Bound
from gestured.daemon.clients import EventServer
from gestured.daemon.control import ControlServer
from gestured.daemon.desk import Desk
from gestured.daemon.health import TICK_S, Canary, Pulse, watchdog_period
from gestured.daemon.log import log
from gestured.daemon.metrics import Metrics
from gestured.daemon.operations import Operations
from gestured.daemon.own import OwnGestures, Ready
from gestured.daemon.publisher import Publisher
from gestured.daemon.reload import Loader, Reload
from gestured.daemon.settings import TITLES
from gestured.daemon.shift import Shift
from gestured.daemon.sinks import Sink
from gestured.daemon.snapshot import Models, Snapshot, overall
from gestured.daemon.sockets import kernel_drops
from gestured.daemon.status import status
from gestured.daemon.tap import Taps
from gestured.daemon.udp import Receiver
from gestured.daemon.views import Views

STATUS_S = 1.0  # from one status to the next
DRAIN_S = 0.5  # for clients to read what waits for them, when the daemon ends
SHOWN = 4  # sensors in systemd's status line
# Settings that a reload cannot change.
AT_A_RESTART = ("listen", "socket", "control", "gates", "gate", "metrics", "flight_recorder")


class Service:
    """All parts of a running daemon."""

    def __init__(self, asked: Asked, metrics: Metrics, bound: Bound, load: Loader) -> None:
        """Serve packets from now on. `load` reads the configuration again, for a reload."""
        settings, ladder = asked.settings, asked.ladder
        self._settings, self._ladder, self._bound = settings, ladder, bound
        self._started_with = settings
        self._instance, self._started, self._stopping = secrets.token_hex(8), time.time(), False
        self._begun = time.monotonic()
        self._reloading: asyncio.Task[str | None] | None = None  # a task that nobody holds may be collected
        self._said = ""  # the last STATUS= that systemd was told
        self._pulse, self._metrics = Pulse(), metrics
        self._reload = Reload(load, self._swap, self._metrics)
        for name in settings.sensors:
            self._metrics.sensor_label(name)  # the sensors of the configuration get the first labels
        self._own = OwnGestures(self._own_changed)
        self._own.follow(ladder, self._own.read(asked.own, ladder))
        self._hub = Hub(scene_of(settings, ladder), ladder, later=True)
        self._taps = Taps(settings.flight_recorder << 20)
        self._clients = EventServer(
            bound.events.sock,
            self._hello,
            self._metrics,
            known=self._known,
            changed=self._foresee,
        )
        self._outputs = asked.outputs
        self._views = Views(self._hub, self._state, self._foresee)
        self._publisher = Publisher(self._metrics, self._sinks())
        self._desk = Desk(self._metrics, self._publisher, Shift.of(ladder.model), self._own, self._views)
        self._foresee()
        self._follow()
        self._receiver = Receiver(bound.udp, bound.since, self._hub, self._desk, self._taps)
        operations = Operations(
            self._hub, self._desk, self._publisher, self._taps, self._own,
            self._views, self.snapshot, self._state, self._reload.run,
        )  # fmt: skip
        self._gates = operations.gates
        self._servers = [ControlServer(bound.control.sock, operations.verbs())]
        if bound.gates is not None:
            self._servers.append(ControlServer(bound.gates.sock, self._gates.of_bridges(), guarded=False))
        self._http: Any = None
        if bound.http is not None:
            from gestured.daemon.http import serve_pages

            self._http = serve_pages(bound.http, self.snapshot, self._metrics)

    def snapshot(self) -> Snapshot:
        """How the daemon is now. Any thread may ask."""
        now = time.monotonic()
        return Snapshot(
            instance=self._instance,
            time=time.time(),
            now=now,
            started=self._started,
            uptime_s=now - self._begun,
            stopping=self._stopping,
            loop_age_s=self._pulse.age_s,
            loop_lag_s=self._pulse.lag_s,
            models=Models.of(self._ladder, self._desk.shift, self._publisher.models_failed),
            gestures=self._hub.scene.gestures,
            own=self._own.report(),
            sensors=self._hub.readings(now - self._receiver.behind_s),
            listening=self._listening(now),
            gates=tuple(sorted(self._hub.gates.of(None))),
            overdue=self._gates.overdue(now),
            recent=self._publisher.recent(),
            clients=self._clients.count,
            backlog_bytes=self._clients.backlog,
            kernel_drops=kernel_drops(self._bound.udp),
            taps=self._taps.count,
            flight_limit_bytes=self._taps.ring_bytes,
            flight_held_bytes=self._taps.held_bytes,
            addresses=self._bound.addresses(),
            settings=self._settings,
            awaiting_restart=self._awaiting_restart(),
        )

    def _awaiting_restart(self) -> list[str]:
        """Settings that a reload has read, but that a restart alone can put to use."""
        new, old = self._settings, self._started_with
        return [TITLES.get(key, key) for key in AT_A_RESTART if getattr(new, key) != getattr(old, key)]

    def _state(self) -> dict[str, Any]:
        """Everything that an operator may see of the daemon now."""
        return status(self.snapshot(), self._metrics)

    def _sinks(self) -> tuple[Sink, ...]:
        """The sinks of events: those who act on them before those who look on."""
        return (self._clients, *self._outputs, self._taps, self._views)

    def _hello(self) -> bytes:
        """The first line to a client."""
        names = self._ladder.active, self._gestures(), self._hub.sequences(), self._listening(time.monotonic())
        return messages.hello_json(__version__, self._instance, *names)

    def _listening(self, now: float) -> dict[str, dict[str, Any]]:
        return messages.listening(self._hub.listening(now), time.time() - now)

    def _gestures(self) -> tuple[str, ...]:
        """The gestures that a client may hear of: the model's in use, and the user's own."""
        return (*self._hub.scene.gestures, *self._own.gestures)

    def _known(self) -> dict[str, Sequence[str]]:
        """What a client may name in a subscription."""
        zones = dict.fromkeys(name for setup in self._hub.scene.sensors.values() for name in setup.zones)
        types = (
            messages.EVENT_TYPES if self._hub.scene.touch else [one for one in messages.EVENT_TYPES if one != "touch"]
        )
        return {"types": types, "gestures": self._gestures(), "zones": tuple(zones)}

    def _own_changed(self) -> None:
        """One of the user's own gestures came or went: whatever was asked about a contact is asked again."""
        self._desk.take(self._hub.change(self._hub.scene, self._ladder, time.monotonic()))
        self._clients.tell(messages.gestures_json(self._gestures()))

    def _foresee(self) -> None:
        """Have the hub give provisional events where somebody asks for them now, and soon touch events alike."""
        asyncio.get_running_loop().call_soon(self._follow)  # not among the events of which a client was just told
        named, every = self._clients.asked("provisional")
        named |= self._views.sensors
        every = every or any(output.foresees for output in self._outputs)
        self._hub.foresee(None if every else named)

    def _follow(self) -> None:
        """Have the hub give touch events where somebody asks for them now."""
        named, every = self._clients.asked("touch")
        named |= self._views.sensors
        every = every or any(output.follows for output in self._outputs)
        self._desk.take(self._hub.follow(None if every else named))

    async def start(self) -> None:
        """Take the connections of operators and bridges, which needs a loop that turns."""
        for server in self._servers:
            await server.start()

    async def serve(self, stop: asyncio.Event, reload: asyncio.Event) -> None:
        """Look after the timers until `stop` is set; then finish what is in flight."""
        watchdog = watchdog_period()
        canary = Canary(self._desk)
        period = min(TICK_S, watchdog or TICK_S)
        status_at = time.monotonic()
        due = status_at
        while not stop.is_set():
            self._pulse.woke(time.monotonic() - due)
            self._receiver.read()
            now = time.monotonic()
            self._desk.take(self._hub.tick(self._receiver.served))
            if now >= status_at:
                status_at = max(status_at + STATUS_S, now)  # on time, but not all at once after a stall
                self._every_second()
            if watchdog and canary.sings():
                notify("WATCHDOG=1")
            if reload.is_set() and not self._reload.running:
                reload.clear()
                self._reloading = asyncio.create_task(self._reload.run())  # frames and timers go on meanwhile
            wait = min(period, status_at - now)
            due = time.monotonic() + wait
            try:
                async with asyncio.timeout(wait):
                    await stop.wait()
            except TimeoutError:
                pass
        if self._reloading is not None:
            self._reloading.cancel()
        await self._finish()

    def _every_second(self) -> None:
        self._clients.tick()
        self._taps.tick()
        self._views.tick()
        self._own.tick()
        now, active = time.monotonic(), self._ladder.active
        self._metrics.kernel(kernel_drops(self._bound.udp))
        states = self._hub.states(now - self._receiver.behind_s)  # no snapshot: of a thousand sensors that is a stall
        state = overall(states, impaired=self._ladder.degraded or self._publisher.models_failed)
        self._publisher.publish(Status(state, states, active, time.time(), self._listening(now)))
        shown = ", ".join(f"{name} {state}" for name, state in list(states.items())[:SHOWN])
        words = f"{state}: {active} answers; sensors: {shown or 'none yet'}"
        if words != self._said:
            self._said = words
            notify(f"STATUS={words}")

    async def _finish(self) -> None:
        """Answer what is in flight, give clients a moment to read it, and say goodbye."""
        self._stopping = True
        notify("STOPPING=1")
        self._receiver.drain()
        self._receiver.close()
        self._taps.flush()
        for server in self._servers:
            server.close()
        self._desk.take(self._hub.flush(time.monotonic()))
        self._views.close()
        await self._clients.close(DRAIN_S)
        for output in self._outputs:
            output.close()
        if self._http is not None:
            self._http.close()
        log.info("ended")

    async def _swap(self, asked: Asked) -> None:
        """Go on with what a reload has opened. Changes of own gestures wait until that is in use."""
        async with self._own.writing:
            self._go_on(asked, await asyncio.to_thread(self._own.read, asked.own, asked.ladder))

    def _go_on(self, asked: Asked, own: Ready) -> None:
        settings, ladder = asked.settings, asked.ladder
        logging.configure(settings.log_level)
        self._settings, self._ladder = settings, ladder
        for key in self._awaiting_restart():
            log.warning("this setting changes at a restart only", key=key)
        self._desk.shift = Shift.of(ladder.model)
        before = self._gestures()
        self._own.follow(ladder, own)
        self._desk.take(self._hub.change(scene_of(settings, ladder), ladder, time.monotonic()))
        if self._gestures() != before:
            self._clients.tell(messages.gestures_json(self._gestures()))
        for output in self._outputs:
            output.close()
        self._outputs = asked.outputs
        self._publisher.sinks = self._sinks()
        self._foresee()
        log.info("reloaded", model=ladder.active)
