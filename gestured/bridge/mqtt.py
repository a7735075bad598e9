"""`gestured-bridge mqtt`: gesture events to an MQTT broker, with Home Assistant discovery.

    gestured/{host}/{sensor}/{type}    an event in JSON as on the socket, with the daemon's `instance`; never retained
    gestured/{host}/{sensor}/state     how the sensor is, retained
    gestured/{host}/availability       `online` or `offline`, retained; `offline` also by last will

All with QoS 1, so that an event may come twice: `instance`, `sensor` and `sequence` tell.

An event is worth something while it is fresh: what is older than OLD_S when the broker can be reached is not sent, and
the broker keeps none longer for a subscriber. The gap in `sequence` says what was missed.
"""

import argparse
import asyncio
import errno
import json
import logging
import signal
import threading
import time
from collections import deque
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gestured.bridge import homeassistant
from gestured.bridge.broker import PLAIN_PORT, TLS_PORT, broker_address, credentials, tls_context, why
from gestured.bridge.counts import Counts
from gestured.bridge.daemon import GONE, NOTICE_S, OLD_S, Daemon, Line, follow
from gestured.bridge.options import (
    STATUS,
    BridgeError,
    add_filters,
    add_metrics,
    host_name,
    need,
    subscriber,
)
from gestured.core.errors import GesturedError

EXPIRY_S = 1  # whole seconds in MQTT; as OLD_S
WAITING_EVENTS = 1000  # that are kept for the broker; more than a second of the busiest daemon
IN_FLIGHT = 20  # events whose acknowledgement is awaited at a time; more would only wait in the broker
PATIENCE_S = 5.0  # for any answer of the broker
LAST_S = 1.0  # for its answer to our good-bye; without it, it publishes our last will
KEEPALIVE_S = 5  # a broker that vanished without a word is noticed, and ours declared dead, after one and a half
AGAIN_S = 0.1  # until a task that goes on is cancelled again
FIRST_S, LONGEST_S = 0.25, 2.0  # from one attempt to the next: doubled each time, a broker that is back is found soon
QUIET = logging.Logger("mqtt", logging.CRITICAL)  # how the connection is, the bridge says in its own words


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the bridge to the command line."""
    parser = commands.add_parser(
        "mqtt",
        help="events to an MQTT broker",
        description="Publish events under gestured/HOST/SENSOR/TYPE, with Home Assistant discovery.\n"
        "User and password are the variables MQTT_USER and MQTT_PASSWORD, or a file that holds USER:PASSWORD.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="examples:\n  gestured-bridge mqtt --broker 192.168.7.2\n"
        "  gestured-bridge mqtt --broker broker.example --tls --credentials /etc/gestured/mqtt-user",
    )
    text = f"the broker (port {PLAIN_PORT}, with TLS {TLS_PORT}, unless named)"
    parser.add_argument("--broker", required=True, metavar="HOST[:PORT]", help=text)
    parser.add_argument("--host", metavar="NAME", help="name of this machine in topics (default: its hostname)")
    add_filters(parser)
    parser.add_argument("--tls", action="store_true", help="encrypt, and check the broker's certificate")
    parser.add_argument("--ca", type=Path, metavar="FILE", help="certificates to trust instead of the system's (PEM)")
    parser.add_argument("--cert", type=Path, metavar="FILE", help="our own certificate and key (PEM)")
    parser.add_argument("--credentials", type=Path, metavar="FILE", help="a file of one line, USER:PASSWORD")
    text = "discovery prefix of Home Assistant (default: homeassistant)"
    parser.add_argument("--discovery", default="homeassistant", metavar="PREFIX", help=text)
    text = "publish no discovery, and clear what was published"
    parser.add_argument("--no-discovery", action="store_true", help=text)
    add_metrics(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Mirror events until SIGTERM or Ctrl-C."""
    need("aiomqtt", "aiomqtt", "mqtt")
    asyncio.run(_main(args))
    return 0


@dataclass(frozen=True, slots=True)
class Event:
    """An event that waits for the broker."""

    decided: float  # monotonic s
    topic: str
    payload: bytes


async def _main(args: argparse.Namespace) -> None:
    counts = Counts("mqtt")
    bridge = Mqtt(args, counts)
    bridge.metrics = counts.serve(args.metrics)
    source = subscriber(args, NOTICE_S)
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(_pass_over_closed)
    failed: list[GesturedError] = []

    def hear() -> None:
        try:
            for line in follow(source):
                loop.call_soon_threadsafe(bridge.take, line)
        except GesturedError as error:  # a subscription that is refused, for one
            failed.append(error)
            loop.call_soon_threadsafe(bridge.stop)

    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, bridge.stop)
    thread = threading.Thread(target=hear, name="daemon", daemon=True)
    thread.start()
    try:
        await bridge.work()
    finally:
        source.close()
        thread.join()
    if failed:
        raise failed[0]


def _pass_over_closed(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """The library asks the loop to watch a socket a moment after that was closed; all else is a bug, and is said."""
    error = context.get("exception")
    if not (isinstance(error, OSError) and error.errno == errno.EBADF):
        loop.default_exception_handler(context)


async def first_of(*coroutines: Coroutine[Any, Any, None]) -> None:
    """Run them until one ends or raises, which ends the others.

    Cancelled as often as it takes: asyncio.wait_for of Python 3.11 swallows a cancellation that comes with its result.
    """
    tasks = [asyncio.ensure_future(coroutine) for coroutine in coroutines]
    done, left = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    while left:
        for task in left:
            task.cancel()
        ended, left = await asyncio.wait(left, timeout=AGAIN_S)
        done |= ended
    errors = [error for task in tasks if not task.cancelled() and (error := task.exception())]
    if errors:
        raise errors[0]


def _cause(error: BaseException) -> BaseException:
    """What ended the connection; what is none of the library's errors is raised as it is."""
    import aiomqtt

    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    if not isinstance(error, aiomqtt.MqttError):
        raise error
    return error.__cause__ or error


class Mqtt:
    """One daemon's events, and what is known of it, at one broker."""

    def __init__(self, args: argparse.Namespace, counts: Counts) -> None:
        """Raises BridgeError for what cannot be."""
        self._broker = broker_address(args.broker, args.tls)
        self._host = host_name(args.host)
        self._user, self._password = credentials(args.credentials)
        self._tls = tls_context(args)
        self._prefix = args.discovery
        self._discovers = not args.no_discovery
        self._counts = counts
        self._daemon = Daemon(args.sensors, args.gestures)
        self._events: deque[Event] = deque()
        self._sent: dict[int, Event] = {}  # not acknowledged so far, in their order
        self._number = 0
        self._kept: dict[str, str] = {}  # topic -> what the broker retains of this connection's
        self._found: dict[str, str | None] = {}  # discovery of before at the broker -> its gesture
        self._stop = asyncio.Event()
        self._changed = asyncio.Event()
        self._arrived = asyncio.Event()
        self.metrics: str | None = None

    def take(self, line: Line) -> None:
        """One line of `follow`."""
        kind = line.get("type")
        self._daemon.take(line)
        if kind in ("hello", GONE):
            self._counts.daemon(kind == "hello")
        if "sensor" in line:  # an event: the daemon knows what was asked for, and which answers belong to it
            self._wait(line)
        if kind in ("hello", "gestures", STATUS, GONE):
            self._changed.set()

    def _wait(self, event: Line) -> None:
        """Have an event wait for the broker; the oldest makes place where too many do."""
        decided = time.monotonic() - self._daemon.age(event, time.time())
        if len(self._events) >= WAITING_EVENTS:
            self._events.popleft()
            self._counts.add("events", "overflow")
        topic = self._topic(event["sensor"], event["type"])
        self._events.append(Event(decided, topic, self._daemon.payload(event)))
        self._arrived.set()

    def stop(self) -> None:
        """Say good-bye, and let `work` end."""
        self._stop.set()

    async def work(self) -> None:
        """Be connected, and connect again; until it is stopped. Raises BridgeError where waiting does not help."""
        import aiomqtt

        wait_s = FIRST_S
        while not self._stop.is_set():
            try:
                async with self._client() as client:
                    wait_s = FIRST_S
                    await self._serve(client)
            except (aiomqtt.MqttError, ExceptionGroup) as error:
                if self._refusal:
                    raise self._refusal from None
                reason = why(_cause(error), self._broker, self._host)
                self._counts.connected("broker", False, f"broker {self._broker} is not there: {reason}; trying again")
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._stop.wait(), wait_s)
                wait_s = min(2 * wait_s, LONGEST_S)

    def _client(self) -> Any:
        import aiomqtt
        from paho.mqtt.packettypes import PacketTypes
        from paho.mqtt.properties import Properties

        self._fresh = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
        self._fresh.MessageExpiryInterval = EXPIRY_S
        refusing = self._refused

        class Client(aiomqtt.Client):
            """A client that does not pass over a broker's refusal to take a message."""

            def _on_publish(self, *args: Any) -> None:
                reason_code = args[3]
                if reason_code.is_failure:
                    refusing(reason_code)
                super()._on_publish(*args)

        self._refusal: BridgeError | None = None
        return Client(
            self._broker.host,
            self._broker.port,
            username=self._user,
            password=self._password,
            identifier=f"gestured-{self._host}",  # the same after a kill, so that an old last will comes before us
            protocol=aiomqtt.ProtocolVersion.V5,
            will=aiomqtt.Will(self._topic("availability"), "offline", qos=1, retain=True),
            timeout=PATIENCE_S,
            keepalive=KEEPALIVE_S,
            clean_start=True,
            max_queued_incoming_messages=WAITING_EVENTS,
            tls_context=self._tls,
            logger=QUIET,
        )

    async def _serve(self, client: Any) -> None:
        """All that one connection is for; raises MqttError when it ends."""
        self._kept.clear()
        self._found.clear()
        self._events.extendleft(reversed(self._sent.values()))  # what nobody has acknowledged is sent again
        self._sent.clear()
        self._changed.set()
        self._counts.connected("broker", True, f"broker {self._broker} is there")
        await first_of(self._hear(client), self._keep(client), self._send(client), self._until_stopped())
        await client.publish(self._topic("availability"), "offline", qos=1, retain=True, timeout=LAST_S)

    async def _until_stopped(self) -> None:
        await self._stop.wait()

    async def _hear(self, client: Any) -> None:
        """What earlier bridges of this host have left at the broker, so that it can be cleared."""
        for topics in homeassistant.mine(self._prefix, self._host):
            await client.subscribe(topics)
        async for message in client.messages:
            topic = message.topic.value
            if message.payload and len(self._found) < 100 * WAITING_EVENTS:
                self._found[topic] = homeassistant.gesture_of(message.payload)
                self._changed.set()

    async def _keep(self, client: Any) -> None:
        """Have the broker retain what holds, and forget what does not."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            wanted = self._retained()
            for topic, payload in wanted.items():
                if self._kept.get(topic) != payload:
                    await self._publish(client, topic, payload.encode(), retain=True)
                    self._kept[topic] = payload
            for topic in self._obsolete(wanted):
                await self._publish(client, topic, b"", retain=True)
                self._kept.pop(topic, None)
                self._found.pop(topic, None)
            if self._daemon.hello:
                where = {"broker": str(self._broker), "host": self._host, "metrics": self.metrics}
                self._counts.ready(**where)

    def _retained(self) -> dict[str, str]:
        """Topic -> what the broker should retain now."""
        wanted = {self._topic("availability"): "online" if self._daemon.hello else "offline"}
        for sensor, state in self._daemon.states.items():
            wanted[self._topic(sensor, "state")] = state
            if self._discovers and self._daemon.gestures:
                version = self._daemon.hello.get("version", "")
                found = homeassistant.discovery(self._prefix, self._host, version, sensor, self._daemon.gestures)
                wanted |= {topic: json.dumps(payload) for topic, payload in found}
        return wanted

    def _obsolete(self, wanted: dict[str, str]) -> list[str]:
        """Topics of what is gone: gestures that were forgotten, also while no bridge ran. Sensors may come back."""
        known = self._daemon.gestures
        gone = [topic for topic in self._kept if topic not in wanted]
        for topic, gesture in self._found.items():
            forgotten = known is not None and gesture is not None and gesture not in known
            if topic not in wanted and topic not in gone and (forgotten or not self._discovers):
                gone.append(topic)
        return gone

    async def _send(self, client: Any) -> None:
        """Each event, in order, while the acknowledgements of some are still under way."""
        places = asyncio.Semaphore(IN_FLIGHT)

        async def send(number: int, event: Event) -> None:
            await self._publish(client, event.topic, event.payload, properties=self._fresh)
            del self._sent[number]
            self._counts.add("events", "sent")
            places.release()

        async with asyncio.TaskGroup() as tasks:
            while True:
                while not self._events:
                    self._arrived.clear()
                    await self._arrived.wait()
                await places.acquire()
                event = self._events.popleft()
                if time.monotonic() - event.decided > OLD_S:
                    self._counts.add("events", "old")
                    places.release()
                    continue
                self._number += 1
                self._sent[self._number] = event
                tasks.create_task(send(self._number, event))

    async def _publish(self, client: Any, topic: str, payload: bytes, **more: Any) -> None:
        """QoS 1: until the broker has it. Raises MqttError, or BridgeError where it does not want it."""
        await client.publish(topic, payload, qos=1, **more)
        if self._refusal:
            raise self._refusal

    def _refused(self, reason_code: Any) -> None:
        self._refusal = BridgeError(
            f"the broker {self._broker} does not let us publish ({reason_code}): allow this user to write "
            f"gestured/{self._host}/# and {self._prefix}/+/gestured_{self._host}/# in its access list"
        )

    def _topic(self, *parts: str) -> str:
        return "/".join(("gestured", self._host, *parts))
