"""The clients of the event stream, in classes of those that ask for the same events."""

from gestured.core.events import Cancelled, Event, Gesture, Provisional, Unknown
from gestured.core.messages import Subscription
from gestured.daemon.client import Client


class Audience:
    """Clients by their subscriptions: an event is held against each subscription once, however many share it."""

    def __init__(self) -> None:
        self._classes: dict[Subscription, set[Client]] = {}
        self._owed: dict[tuple[str, int], set[Client]] = {}  # who was sent a provisional event

    def join(self, client: Client, subscription: Subscription) -> None:
        """Put a client, which is in no class, with those that ask for the same."""
        client.subscription = subscription
        self._classes.setdefault(subscription, set()).add(client)

    def leave(self, client: Client) -> bool:
        """Take a client out of its class. Returns whether it was the last one in it."""
        members = self._classes.get(client.subscription, set())
        members.discard(client)
        if members:
            return False
        return self._classes.pop(client.subscription, None) is not None

    def of(self, event: Event) -> list[Client]:
        """The clients that hear an event: those who ask for it or were sent the provisional event that it answers."""
        wanted = [client for asked, clients in self._classes.items() if asked.matches(event) for client in clients]
        if isinstance(event, Provisional):
            self._owed[event.sensor, event.id] = set(wanted)
        elif self._owed and isinstance(event, Gesture | Unknown | Cancelled):
            owed = self._owed.pop((event.sensor, event.id), set())
            wanted += [client for client in owed if self._is_here(client) and not client.subscription.matches(event)]
        return wanted

    def asked(self, kind: str) -> tuple[frozenset[str], bool]:
        """The sensors whose events of a type somebody asks for by name, and whether somebody asks for all."""
        named = [asked.sensors for asked in self._classes if kind in asked.types]
        return frozenset().union(*(names for names in named if names is not None)), None in named

    def _is_here(self, client: Client) -> bool:
        return client in self._classes.get(client.subscription, ())
