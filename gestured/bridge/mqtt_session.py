"""A session of the MQTT bridge: it publishes one daemon's events and state at one broker, and takes commands."""

import argparse
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from gestured.bridge.broker import ANY_BYTES, HEADER_BYTES, PASSING, TOO_LARGE, Broker, properties, topic_of
from gestured.bridge.counts import Counts
from gestured.bridge.daemon import GONE, OLD_S, Daemon, Line
from gestured.bridge.gates import OFF, ON, Gate
from gestured.bridge.options import FIRST_S, LONGEST_S, STATUS, host_name
from gestured.bridge.retained import OPEN, Retained
from gestured.core.errors import GesturedError

COMMAND = ("gate", "set")  # the levels of a topic for commands, below the sensor
EXPIRY_S = 1  # a broker keeps an event for a subscriber as long as OLD_S, which MQTT counts in whole seconds
LAST_S = 1.0  # the longest wait for the broker at the end; if it does not answer, it publishes the last will
WAITING_EVENTS = 1000  # the most events that wait for the broker: more than a second of the busiest daemon
IN_FLIGHT = 20  # the most messages that await their acknowledgement, unless the broker asks for fewer


@dataclass(frozen=True, slots=True)
class Outgoing:
    """An event to be published."""

    decided: float  # monotonic s
    topic: str
    payload: bytes


class Mqtt:
    """A session with one broker, which goes on when broker or daemon are away for a while.

    Everything is done in the thread that calls `work`; other threads put what they learn into the inbox.
    """

    def __init__(self, args: argparse.Namespace, counts: Counts) -> None:
        """Raises BridgeError for arguments that cannot be used."""
        self._host = host_name(args.host)
        self._broker = Broker(args, self._host)
        self._availability = topic_of(self._host, "availability")
        self._counts = counts
        self._daemon = Daemon(args.sensors, args.gestures, counts)
        self._gate = None if args.gates is None else Gate(args.gates, args.gate, counts)
        self._commanded = topic_of(self._host, "+", *COMMAND)
        gate = None if self._gate is None else self._gate.name
        self._retained = Retained(self._daemon, self._host, args.discovery, gate, discovers=not args.no_discovery)
        self._commands: dict[str, str] = {}  # by sensor: the last command that was not carried out yet
        self._obeying = threading.Lock()  # guards `_commands`
        self._inbox: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()  # a signal handler may put into it
        self._stopping = False
        self._client: Any = None  # of this connection, from the attempt to connect on; None if there is none
        self._connected = False
        self._wait_s, self._due = FIRST_S, 0.0  # s, the next pause; monotonic s, the next attempt to connect
        self._since = 0.0  # monotonic s, when the broker accepted the connection
        self._waiting: deque[Outgoing] = deque()  # events for the broker, in order
        self._sent: dict[int, Outgoing] = {}  # by message number: events that the broker has not acknowledged
        self._changed = False  # whether a command has changed what the broker should retain
        self._changes: Iterator[tuple[str, str]] = iter(())  # retained messages to be published
        # By message number: topics of retained messages that the broker has not acknowledged.
        self._changing: dict[int, str] = {}
        self._refusals: set[int] = set()  # reason codes of refused messages, each of which is logged once
        self._farewell = 0  # number of the last message, "offline"
        self._most = 0  # messages that may be in flight, without the last one
        self._largest = ANY_BYTES  # bytes of the largest packet that the broker takes

    def stop(self) -> None:
        """Let `work` end at once with the last message, whatever else waits."""
        self._stopping = True
        self._inbox.put(lambda: None)

    def hear(self, lines: Iterator[Line]) -> None:
        """Take each line of `follow`; called in a thread of its own."""
        try:
            for line in lines:
                self._inbox.put(partial(self._take, line))
        except GesturedError as error:  # such as a subscription that is refused
            self._inbox.put(partial(self._fail, error))

    def work(self) -> None:
        """Connect, and connect again, until `stop` is called. Raises GesturedError if waiting does not help."""
        while not self._stopping:
            if self._client is None and time.monotonic() >= self._due:
                self._call()
            self._serve(None if self._client is not None else self._due)
        end = time.monotonic() + LAST_S
        if self._connected:
            self._farewell = self._publish(self._availability, "offline", retain=True)
        while self._connected and time.monotonic() < end:
            self._serve(end)

    def _serve(self, until: float | None) -> None:
        """Call the next function in the inbox, if one comes before `until` (monotonic s; None: wait for it)."""
        with suppress(queue.Empty):
            self._inbox.get(timeout=None if until is None else max(until - time.monotonic(), 0.0))()

    def _fail(self, error: GesturedError) -> None:
        raise error

    def _take(self, line: Line) -> None:
        self._daemon.take(line)
        if "sensor" in line:  # an event, which the daemon has filtered already
            if len(self._waiting) >= WAITING_EVENTS:
                self._waiting.popleft()
                self._counts.add("events", "overflow")
            decided = time.monotonic() - self._daemon.age(line, time.time())
            topic = topic_of(self._host, line["sensor"], line["type"])
            self._waiting.append(Outgoing(decided, topic, self._daemon.payload(line)))
        gate = self._gate if line["type"] == STATUS and self._connected else None
        if gate is not None and self._daemon.is_silent_by(gate.name):
            gate.renew()
        if line["type"] in ("hello", "gestures", STATUS, GONE):  # this goes before what the broker is still to retain
            self._changes = self._retained.changes()
        self._send()

    def _call(self) -> None:
        """Connect to the broker in a thread of its own, since the look-up of a name may take long."""
        client = self._client = self._broker.client(self._availability)

        def told(what: Callable[..., None], *which: int) -> Callable[..., None]:
            return lambda *given: self._inbox.put(partial(what, client, *(given[n] for n in which)))

        def call() -> None:
            try:
                self._broker.call(client)
            except OSError as error:
                self._inbox.put(partial(self._gone, client, error))

        client.on_connect = told(self._there, 3, 4)
        client.on_disconnect = told(self._gone, 3)
        client.on_failure = told(self._gone, 0)
        client.on_subscribe = told(self._subscribed, 3)
        client.on_message = lambda _, __, message: self._hear(message)
        client.on_publish = told(self._taken, 2, 3)
        threading.Thread(target=call, name="broker", daemon=True).start()

    def _there(self, client: Any, code: Any, terms: Any) -> None:
        """The broker has answered the attempt to connect with a reason code and properties (`terms`)."""
        if code.is_failure:
            self._gone(client, code)
            return
        self._connected, self._since = True, time.monotonic()
        self._counts.connected("broker", True, f"broker {self._broker.address} is there")
        self._largest = self._broker.check(terms)
        self._most = max(min(IN_FLIGHT, getattr(terms, "ReceiveMaximum", IN_FLIGHT)) - 1, 1)
        if self._gate is not None:
            self._broker.hear(client, self._commanded)
        self._retained.forget()  # the broker may have lost what it retained
        self._changes = self._retained.changes()
        self._changing.clear()
        self._waiting.extendleft(reversed(self._sent.values()))  # what was not acknowledged comes first
        self._sent.clear()
        self._send()

    def _gone(self, client: Any, error: Any) -> None:
        if client is not self._client:
            return
        held_s = time.monotonic() - self._since if self._connected else None
        self._client, self._connected = None, False
        if held_s is not None and held_s >= LONGEST_S:
            self._wait_s = FIRST_S
        if not self._stopping:
            why = self._broker.why(error, held_s)
            words = f"broker {self._broker.address} is not there: {why}; trying again"
            self._counts.connected("broker", False, words)
            self._due = time.monotonic() + self._wait_s
            self._wait_s = min(2 * self._wait_s, LONGEST_S)

    def _taken(self, client: Any, number: int, code: Any) -> None:
        if client is not self._client:
            return
        event, retained = self._sent.pop(number, None), self._changing.pop(number, None)
        if code.is_failure:
            error = self._broker.refused(code, event.topic if event else retained or self._availability)
            if code.value not in PASSING:
                raise error
            if code.value not in self._refusals:
                self._refusals.add(code.value)
                self._counts.say(str(error))
            if retained:
                self._retained.forget(retained)  # the next status publishes it again
        elif number == self._farewell:
            client.disconnect()
        if event is not None:
            self._counts.add("events", "refused" if code.is_failure else "sent")
        self._send()

    def _subscribed(self, client: Any, codes: Any) -> None:
        if client is self._client and codes[0].is_failure:
            raise self._broker.unreadable(codes[0], self._commanded)

    def _hear(self, message: Any) -> None:
        """Take a command, in the library's thread. A newer command for a sensor replaces one that still waits."""
        sensor = message.topic.split("/")[2]
        command = message.payload.decode(errors="replace")
        if message.retain or command not in (ON, OFF) or sensor not in self._daemon.states:
            why = "it was retained" if message.retain else f"expected {ON} or {OFF}, for a known sensor"
            words = f"{message.topic}: {command[:40]!r} is ignored: {why}"
            self._counts.wrong(words, "commands", "retained" if message.retain else "wrong")
            return
        with self._obeying:
            waits, self._commands[sensor] = sensor in self._commands, command
        if not waits:
            self._inbox.put(partial(self._obey, sensor))

    def _obey(self, sensor: str) -> None:
        with self._obeying:
            command = self._commands.pop(sensor)
        if self._gate is None or self._stopping:
            return
        try:
            closed = self._gate.obey(sensor, command)
        except GesturedError:
            return  # `Gate` has logged it; the retained state, and so any switch, stays as it is
        self._counts.add("commands", "obeyed")
        self._daemon.listening[sensor] = {**OPEN, **self._daemon.listening.get(sensor, {}), "closed": closed}
        self._changed = True
        self._send()

    def _send(self) -> None:
        """Publish what waits, as far as the broker has acknowledged earlier messages."""
        if not self._connected or self._stopping:
            return
        most = max(self._most // 2, 1)  # so that no event waits for all of them
        while len(self._changing) < most and len(self._sent) + len(self._changing) < self._most:
            change = next(self._changes, None)
            if change is not None:
                self._changing[self._publish(*change, retain=True)] = change[0]
            elif self._changed and not self._changing:  # many changes at a time are looked for once
                self._changed, self._changes = False, self._retained.changes()
            else:
                break
        while self._waiting and len(self._sent) + len(self._changing) < self._most:
            event = self._waiting.popleft()
            if time.monotonic() - event.decided > OLD_S:
                self._counts.add("events", "old")
                continue
            fresh = properties("PUBLISH", MessageExpiryInterval=EXPIRY_S)
            self._sent[self._publish(event.topic, event.payload, properties=fresh)] = event
        if not self._changing and self._daemon.hello:
            self._counts.ready(broker=str(self._broker.address), host=self._host)

    def _publish(self, topic: str, payload: str | bytes, **options: Any) -> int:
        """Publish a message with QoS 1 (it may come twice, but is not lost on the way); returns its number.

        Raises BridgeError if the broker takes no packet of its size.
        """
        if HEADER_BYTES + len(topic.encode()) + len(payload) > self._largest:
            raise self._broker.refusal(TOO_LARGE)
        number: int = self._client.publish(topic, payload, qos=1, **options).mid
        return number
