"""The clients that receive an event, by their subscriptions."""

from dataclasses import replace

from gestured.core import messages
from gestured.core.events import Cancelled, Event, Gesture, Provisional, Touch, Unknown
from gestured.core.messages import Subscription
from gestured.daemon.client import Client, Finger


class Audience:
    """Clients by their subscriptions: an event is matched with each subscription once, however many clients share it.

    A client that is sent the `down` of a finger is also sent exactly one `up` of that finger.
    """

    def __init__(self) -> None:
        self._classes: dict[Subscription, set[Client]] = {}
        self._owed: dict[tuple[str, int], set[Client]] = {}  # by sensor and id: who was sent a provisional event
        self._down: dict[Finger, tuple[Touch, set[Client]]] = {}  # fingers that are down: the last event, who follows
        self._epoch = 0.0

    def change(self, client: Client, subscription: Subscription) -> bool:
        """Give a client a new subscription. Returns whether no client has the old one any more.

        The client is sent a `down` for each finger that it follows from now on, and an `up` for each that it leaves.
        """
        last = self._leave(client)
        client.subscription = subscription
        self._classes.setdefault(subscription, set()).add(client)
        for event, clients in tuple(self._down.values()):
            wanted = subscription.matches(event)
            if wanted != (client in clients):
                now = replace(event, phase="down" if wanted else "up", dx=0.0, dy=0.0)
                (clients.add if wanted else clients.discard)(client)
                client.touch(now, self._epoch, messages.to_json(now, self._epoch))
        return last

    def forget(self, client: Client) -> bool:
        """Remove a client that is gone. Returns whether no client has its subscription any more."""
        for _, clients in self._down.values():
            clients.discard(client)
        return self._leave(client)

    def of(self, event: Event) -> list[Client]:
        """The clients that receive an event: they ask for it, or were sent the provisional event that it answers."""
        wanted = [client for asked, clients in self._classes.items() if asked.matches(event) for client in clients]
        if isinstance(event, Provisional):
            self._owed[event.sensor, event.id] = set(wanted)
        elif self._owed and isinstance(event, Gesture | Unknown | Cancelled):
            owed = self._owed.pop((event.sensor, event.id), set())
            wanted += [
                client
                for client in owed
                if client in self._classes.get(client.subscription, ()) and not client.subscription.matches(event)
            ]
        return wanted

    def follow(self, event: Touch, epoch: float) -> None:
        """Send an event of a finger to the clients that follow this finger, which begins with its `down`."""
        finger, self._epoch = (event.sensor, event.id, event.touch), epoch
        if event.phase == "down":
            clients = set(self.of(event))
        else:
            _, clients = self._down.pop(finger)
        if event.phase != "up":
            self._down[finger] = event, clients
        line = messages.to_json(event, epoch) if clients else b""
        for client in tuple(clients):
            client.touch(event, epoch, line)

    def asked(self, kind: str) -> tuple[frozenset[str], bool]:
        """The sensors of which clients ask for that type of event by name, and whether a client asks for all."""
        named = [asked.sensors for asked in self._classes if kind in asked.types]
        return frozenset().union(*(names for names in named if names is not None)), None in named

    def _leave(self, client: Client) -> bool:
        members = self._classes.get(client.subscription, set())
        members.discard(client)
        return not members and self._classes.pop(client.subscription, None) is not None
