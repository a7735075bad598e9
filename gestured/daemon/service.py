"""The service: the parts of one daemon put together, with their timers from start to end."""

import asyncio
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from gestured import __version__
from gestured.client.notify import notify
from gestured.core import messages
from gestured.core.errors import GesturedError
from gestured.core.events import Status
from gestured.core.hub import Hub
from gestured.daemon import log as logging
from gestured.daemon.asked import Asked, open_all, scene_of
from gestured.daemon.bound import Bound
from gestured.daemon.clients import EventServer
from gestured.daemon.control import ControlServer
from gestured.daemon.desk import Desk
from gestured.daemon.gatekeeper import Gatekeeper
from gestured.daemon.health import TICK_S, Canary, watchdog_period
from gestured.daemon.keeper import Keeper
from gestured.daemon.log import log
from gestured.daemon.metrics import Metrics
from gestured.daemon.operations import Operations
from gestured.daemon.own import OwnGestures
from gestured.daemon.parts import Parts
from gestured.daemon.settings import Settings
from gestured.daemon.shift import Shift
from gestured.daemon.sinks import Sink
from gestured.daemon.sockets import kernel_drops
from gestured.daemon.status import overall, status
from gestured.daemon.tap import Taps
from gestured.daemon.udp import Receiver
from gestured.daemon.views import Views
from gestured.model.own import Own

STATUS_S = 1.0  # from one status to the next
DRAIN_S = 0.5  # s for clients to read what waits for them, when the daemon ends
SHOWN = 4  # sensors in systemd's status line

Loader = Callable[[], Settings]  # reads the configuration


class Service:
    """A running daemon."""

    def __init__(self, asked: Asked, metrics: Metrics, bound: Bound, load: Loader) -> None:
        """Serve packets from now on. `load` reads the configuration again, for a reload."""
        settings, ladder = asked.settings, asked.ladder
        self._load, self._reloading = load, asyncio.Lock()
        self._reload: asyncio.Task[str | None] | None = None  # kept, since a task without a reference may be collected
        self._said = ""  # the last STATUS= that systemd was told
        for name in settings.sensors:
            metrics.sensor_label(name)  # the sensors of the configuration get the first labels
        own = OwnGestures(self._own_changed)
        own.follow(ladder, *own.read(asked.own, ladder))
        hub = Hub(scene_of(settings, ladder), ladder, later=True)
        taps, views = Taps(settings.flight_recorder << 20), Views(hub, lambda: status(self.parts), self._foresee)
        clients = EventServer(bound.events.sock, self._hello, metrics, known=self._known, changed=self._foresee)
        desk = Desk(hub, metrics, Shift.of(ladder.model), own, views)
        receiver = Receiver(bound.udp, bound.since, hub, desk, taps)
        gates = Gatekeeper(hub, desk)
        self.parts = Parts(asked, bound, metrics, hub, own, desk, clients, taps, views, receiver, gates)
        desk.sinks = self._sinks()
        self._foresee()
        self._follow()
        operations = Operations(self.parts, self.reload)
        self._servers = [ControlServer(bound.control.sock, operations.verbs())]
        if bound.gates is not None:
            self._servers.append(ControlServer(bound.gates.sock, gates.of_bridges(), guarded=False))
        self._http: Any = None
        if bound.http is not None:
            from gestured.daemon.http import serve_pages

            self._http = serve_pages(bound.http, self.parts)

    def _sinks(self) -> tuple[Sink, ...]:
        """The sinks of events: clients and outputs, which may act on an event, come before taps and views."""
        parts = self.parts
        return (parts.clients, *parts.asked.outputs, parts.taps, parts.views)

    def _hello(self) -> bytes:
        parts = self.parts
        return messages.hello_json(
            version=__version__,
            instance=parts.instance,
            model=parts.ladder.active,
            gestures=parts.gestures,
            sensors=parts.hub.sequences(),
            gates=parts.listening(),
        )

    def _known(self) -> dict[str, Sequence[str]]:
        """The types, gestures and zones that a client may name in a subscription."""
        scene = self.parts.hub.scene
        zones = dict.fromkeys(name for setup in scene.sensors.values() for name in setup.zones)
        types = [one for one in messages.EVENT_TYPES if scene.touch or one != "touch"]
        return {"types": types, "gestures": self.parts.gestures, "zones": tuple(zones)}

    def _own_changed(self) -> None:
        """Drop what the model said of open contacts, and tell clients the gestures: an own one came or went."""
        parts = self.parts
        parts.desk.take(parts.hub.change(parts.hub.scene, parts.ladder, time.monotonic()))
        parts.clients.tell(messages.gestures_json(parts.gestures))

    def _foresee(self) -> None:
        """Have the hub give the provisional events that somebody asks for now, and soon after the touch events."""
        asyncio.get_running_loop().call_soon(self._follow)  # later, since a client is just being sent touch events
        self.parts.hub.foresee(self._wanted("provisional"))

    def _follow(self) -> None:
        """Have the hub give the touch events that somebody asks for now."""
        self.parts.desk.take(self.parts.hub.follow(self._wanted("touch")))

    def _wanted(self, kind: str) -> frozenset[str] | None:
        """The sensors of which somebody wants events of the type `kind`; None for all."""
        named, every = self.parts.clients.audience.asked(kind)
        every = every or any(kind in output.wants for output in self.parts.asked.outputs)
        return None if every else named | self.parts.views.sensors

    async def start(self) -> None:
        """Accept connections of operators and bridges, for which the loop must be running."""
        for server in self._servers:
            await server.start()

    async def serve(self, stop: asyncio.Event, reload: asyncio.Event) -> None:
        """Run the timers until `stop` is set, and a reload each time that `reload` is; then finish."""
        parts = self.parts
        watchdog = watchdog_period()
        canary = Canary(parts.desk)
        period = min(TICK_S, watchdog or TICK_S)
        status_at = time.monotonic()
        due = status_at
        while not stop.is_set():
            parts.pulse.woke(time.monotonic() - due)
            parts.receiver.read()
            now = time.monotonic()
            parts.desk.take(parts.hub.tick(parts.receiver.served))
            if now >= status_at:
                status_at = max(status_at + STATUS_S, now)  # on time, but with no catching up after a stall
                self._every_second()
            if watchdog and canary.sings():
                notify("WATCHDOG=1")
            if reload.is_set() and not self._reloading.locked():
                reload.clear()
                self._reload = asyncio.create_task(self.reload())  # frames and timers go on meanwhile
            wait = min(period, status_at - now)
            due = time.monotonic() + wait
            with suppress(TimeoutError):
                async with asyncio.timeout(wait):
                    await stop.wait()
        if self._reload is not None:
            self._reload.cancel()
        await self._finish()

    def _every_second(self) -> None:
        parts, active = self.parts, self.parts.ladder.active
        for part in (parts.clients, parts.taps, parts.views, parts.own):
            part.tick()
        parts.metrics.kernel(kernel_drops(parts.bound.udp))
        states = parts.hub.states(parts.as_of)  # not `status`, which is a stall for a thousand sensors
        state = overall(states, impaired=parts.impaired)
        parts.desk.publish(Status(state, states, active, time.time(), parts.listening()))
        shown = ", ".join(f"{name} {state}" for name, state in list(states.items())[:SHOWN])
        words = f"{state}: {active} answers; sensors: {shown or 'none yet'}"
        if words != self._said:
            self._said = words
            notify(f"STATUS={words}")

    async def _finish(self) -> None:
        """Answer the open contacts, give clients DRAIN_S to read the answers, and close everything."""
        parts = self.parts
        parts.stopping = True
        notify("STOPPING=1")
        parts.receiver.drain()
        parts.receiver.close()
        parts.taps.flush()
        for server in self._servers:
            server.close()
        parts.desk.take(parts.hub.flush(time.monotonic()))
        parts.views.close()
        await parts.clients.close(DRAIN_S)
        for output in parts.asked.outputs:
            output.close()
        if self._http is not None:
            self._http.close()
        log.info("ended")

    async def reload(self) -> str | None:
        """Read configuration, models and own gestures anew. Returns None, or why nothing has changed.

        It waits for reloads that have begun. Nothing changes unless all is valid. Frames are served meanwhile.
        """
        async with self._reloading:
            notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
            try:
                settings = await asyncio.to_thread(self._load)  # a disk may be slow
                asked = await asyncio.to_thread(open_all, settings, self.parts.metrics, insist=True)
            except Exception as error:
                bug = not isinstance(error, GesturedError)
                said = log.exception if bug else log.error
                said("reload refused, nothing has changed", reason=str(error))
                self.parts.metrics.reloads.add("refused")
                return f"a bug: {error!r}" if bug else str(error)
            else:
                own = self.parts.own
                async with own.writing:  # changes of own gestures wait until what was opened is in use
                    self._go_on(asked, *await asyncio.to_thread(own.read, asked.own, asked.ladder))
                self.parts.metrics.reloads.add("done")
                return None
            finally:
                notify("READY=1")

    def _go_on(self, asked: Asked, keeper: Keeper, own: Own) -> None:
        """Put to use what a reload has opened."""
        parts, settings, ladder = self.parts, asked.settings, asked.ladder
        logging.configure(settings.log_level)
        before, outputs, parts.asked = parts.gestures, parts.asked.outputs, asked
        for key in parts.awaiting_restart():
            log.warning("this setting changes at a restart only", key=key)
        parts.desk.shift = Shift.of(ladder.model)
        parts.own.follow(ladder, keeper, own)
        parts.desk.take(parts.hub.change(scene_of(settings, ladder), ladder, time.monotonic()))
        if parts.gestures != before:
            parts.clients.tell(messages.gestures_json(parts.gestures))
        for output in outputs:
            for one in asked.outputs:
                one.take_over(output)
            output.close()
        parts.desk.sinks = self._sinks()
        self._foresee()
        log.info("reloaded", model=ladder.active)
