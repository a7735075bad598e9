"""Which client follows which finger: each `down` that a client is told of has exactly one `up`, whatever comes."""

from dataclasses import replace

from gestured.core.events import Touch
from gestured.core.messages import Subscription, to_json
from gestured.daemon.audience import Audience
from gestured.daemon.client import Client

Key = tuple[str, int, int]  # sensor, id of the contact, number of the finger


class Touches:
    """The fingers that are down, and who has been told so."""

    def __init__(self, audience: Audience) -> None:
        self._audience = audience
        self._down: dict[Key, tuple[Touch, set[Client]]] = {}
        self._epoch = 0.0

    def publish(self, event: Touch, epoch: float) -> None:
        """Send an event to those who follow its finger: those who ask for it, from its `down` on."""
        key, self._epoch = (event.sensor, event.id, event.touch), epoch
        if event.phase == "down":
            clients = set(self._audience.of(event))
        else:
            _, clients = self._down.pop(key)
        if event.phase != "up":
            self._down[key] = event, clients
        line = to_json(event, epoch) if clients else b""
        for client in tuple(clients):
            client.touch(event, epoch, line)

    def change(self, client: Client, subscription: Subscription) -> None:
        """A client asks for something else: fingers that it is to follow are down, those it no longer follows up."""
        for event, clients in tuple(self._down.values()):
            wanted = subscription.matches(event)
            if wanted != (client in clients):
                now = replace(event, phase="down" if wanted else "up", dx=0.0, dy=0.0)
                (clients.add if wanted else clients.discard)(client)
                client.touch(now, self._epoch, to_json(now, self._epoch))

    def forget(self, client: Client) -> None:
        """A client is gone."""
        for _, clients in self._down.values():
            clients.discard(client)
