"""What the bridge to MQTT does while it runs: one daemon's events, and what is known of it, at one broker."""

import argparse
import asyncio
import time
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any

from gestured.bridge.broker import Broker, Connection, Lost, topic_of
from gestured.bridge.counts import Counts
from gestured.bridge.daemon import GONE, Daemon, Line
from gestured.bridge.options import STATUS, host_name
from gestured.bridge.outbox import Outbox, Outgoing
from gestured.bridge.retained import Retained

AGAIN_S = 0.1  # until a task that goes on although it was cancelled is cancelled again
FIRST_S, LONGEST_S = 0.25, 2.0  # from one attempt to the next: doubled each time, a broker that is back is found soon


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


class Mqtt:
    """A session with one broker, across its disappearances and the daemon's."""

    def __init__(self, args: argparse.Namespace, counts: Counts) -> None:
        """Raises BridgeError for what cannot be."""
        self._host = host_name(args.host)
        self._broker = Broker(args, self._host)
        self._counts = counts
        self._daemon = Daemon(args.sensors, args.gestures, counts)
        self._outbox = Outbox(counts)
        self._retained = Retained(self._daemon, self._host, args.discovery, discovers=not args.no_discovery)
        self._stop = asyncio.Event()
        self._changed = asyncio.Event()  # what the broker should retain may be something else now

    def take(self, line: Line) -> None:
        """One line of `follow`."""
        self._daemon.take(line)
        if "sensor" in line:  # an event: the daemon knows what was asked for, and which answers belong to it
            decided = time.monotonic() - self._daemon.age(line, time.time())
            topic = topic_of(self._host, line["sensor"], line["type"])
            self._outbox.put(Outgoing(decided, topic, self._daemon.payload(line)))
        if line["type"] in ("hello", "gestures", STATUS, GONE):
            self._changed.set()

    def stop(self) -> None:
        """Say good-bye, and let `work` end."""
        self._stop.set()

    async def work(self) -> None:
        """Be connected, and connect again; until it is stopped. Raises BridgeError where waiting does not help."""
        wait_s = FIRST_S
        availability = topic_of(self._host, "availability")
        while not self._stop.is_set():
            try:
                async with self._broker.connected(availability) as connection:
                    wait_s = FIRST_S
                    await self._serve(connection)
                    await connection.leave(availability)
            except Lost as error:
                words = f"broker {self._broker.address} is not there: {error}; trying again"
                self._counts.connected("broker", False, words)
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._stop.wait(), wait_s)
                wait_s = min(2 * wait_s, LONGEST_S)

    async def _serve(self, connection: Connection) -> None:
        """All that one connection is for, until we are stopped."""
        self._retained.forget()
        self._outbox.again()
        self._changed.set()
        self._counts.connected("broker", True, f"broker {self._broker.address} is there")
        await first_of(
            self._keep(connection), self._outbox.send(connection.event), self._until_stopped(), connection.lost()
        )

    async def _until_stopped(self) -> None:
        await self._stop.wait()

    async def _keep(self, connection: Connection) -> None:
        """Have the broker retain what holds, and forget what does not."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            for topic, payload in self._retained.changes():
                await connection.retain(topic, payload)
            if self._daemon.hello:
                self._counts.ready(broker=str(self._broker.address), host=self._host)
