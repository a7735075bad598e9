"""The server of the page of `gesturectl view`: streams of sensors, flags, and requests to the daemon."""

import threading
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from gestured.client.web.door import Door
from gestured.client.web.server import Handler, Said, Server
from gestured.control.view.source import Looker, Source
from gestured.core.address import Address, is_sensor
from gestured.core.errors import GesturedError

PAGE = Path(__file__).with_name("page")
TABS = 5  # the most streams at a time: a browser makes six connections to a server, and needs one for other requests
VERBS = {"/silence": "inhibit", "/hear": "allow", "/recalibrate": "recalibrate"}  # by path: the verb of the daemon


class ViewServer(Server):
    """Serves the page on a loopback address; a context manager. Raises GesturedError if the address cannot be bound."""

    def __init__(self, listen: Address, source: Source, door: Door) -> None:
        super().__init__(listen, door, PAGE, _Handler)
        self.source = source
        self.tabs = threading.Semaphore(TABS)


class _Handler(Handler):
    """One request of a browser, and its answer."""

    server: ViewServer

    def look(self, query: Mapping[str, str]) -> None:
        """Stream the daemon's state, one sensor's frames, and the events."""
        sensor = query.get("sensor", "")
        if sensor and not is_sensor(sensor):
            self.refuse(HTTPStatus.BAD_REQUEST, "sensor: expected 1 to 64 of A-Z, a-z, 0-9, _ and -")
        elif not self.server.tabs.acquire(blocking=False):
            self.refuse(HTTPStatus.SERVICE_UNAVAILABLE, f"{TABS} tabs look already: close one")
        else:
            looker = Looker(sensor, query.get("raw") == "1")
            try:
                self.server.source.join(looker)
                self.stream(looker)
            finally:
                self.server.source.leave(looker)
                self.server.tabs.release()

    def act(self, what: dict[str, Any]) -> Said:
        """Flag the last answers, or recalibrate, silence or hear a sensor."""
        if not all(isinstance(value, str) for value in what.values()):
            return HTTPStatus.BAD_REQUEST, {"error": "expected a JSON object of texts"}
        source, verb = self.server.source, VERBS.get(self.path)
        if verb is None and self.path != "/flag":
            return HTTPStatus.NOT_FOUND, {"error": f"expected one of /flag, {', '.join(VERBS)}"}
        try:
            done = source.flag(what.get("note", "")) if verb is None else source.ask(verb, what.get("sensor", ""))
            return HTTPStatus.OK, {"done": done}
        except (GesturedError, OSError) as error:
            return HTTPStatus.CONFLICT, {"error": str(error)}
