"""The events that are on their way to an MQTT broker: those that wait, and those that it has not acknowledged."""

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from gestured.bridge.counts import Counts
from gestured.bridge.daemon import OLD_S

WAITING_EVENTS = 1000  # events that are kept for the broker; more than a second of the busiest daemon
IN_FLIGHT = 20  # events whose acknowledgement is awaited at a time; more would only wait in the broker


@dataclass(frozen=True, slots=True)
class Outgoing:
    """An event that the broker shall have."""

    decided: float  # monotonic s
    topic: str
    payload: bytes


class Outbox:
    """Events in their order, across connections."""

    def __init__(self, counts: Counts) -> None:
        self._counts = counts
        self._waiting: deque[Outgoing] = deque()
        self._sent: dict[int, Outgoing] = {}  # by number, not acknowledged so far
        self._number = 0
        self._arrived = asyncio.Event()

    def put(self, event: Outgoing) -> None:
        """Have an event wait; the oldest makes place where too many do."""
        if len(self._waiting) >= WAITING_EVENTS:
            self._waiting.popleft()
            self._counts.add("events", "overflow")
        self._waiting.append(event)
        self._arrived.set()

    def again(self) -> None:
        """Another connection: what nobody has acknowledged is sent again, before all else."""
        self._waiting.extendleft(reversed(self._sent.values()))
        self._sent.clear()

    async def send(self, publish: Callable[[str, bytes], Awaitable[None]]) -> None:
        """Publish (topic, payload) of each event, in order, while some acknowledgements are still under way.

        It goes on until it is cancelled or `publish` raises.
        """
        places = asyncio.Semaphore(IN_FLIGHT)

        async def send(number: int, event: Outgoing) -> None:
            await publish(event.topic, event.payload)
            del self._sent[number]
            self._counts.add("events", "sent")
            places.release()

        async with asyncio.TaskGroup() as tasks:
            while True:
                while not self._waiting:
                    self._arrived.clear()
                    await self._arrived.wait()
                await places.acquire()
                event = self._waiting.popleft()
                if time.monotonic() - event.decided > OLD_S:
                    self._counts.add("events", "old")
                    places.release()
                    continue
                self._number += 1
                self._sent[self._number] = event
                tasks.create_task(send(self._number, event))
