"""The server of a pad's page: it decides who may touch the pad, and how much."""

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from http import HTTPStatus
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Self

from gestured.client.pad.pad import Pad
from gestured.client.subscriber import Subscriber
from gestured.client.web.door import Door
from gestured.client.web.outbox import Outbox
from gestured.client.web.server import Handler, Said, Server
from gestured.core.address import Address
from gestured.core.errors import GesturedError

PAGE = Path(__file__).with_name("page")
MESSAGES = 120  # of the browser in a second, at most
IDLE_S = 600.0  # without a touch, after which the address is no longer valid
SAID = 1000  # characters of `say` that are kept for a browser that comes later
DEFAULT = Address("127.0.0.1", 9110)
HEARD = ("onset", "provisional", "gesture", "unknown", "cancelled", "status")  # the status is a sign of life
SILENT_S = 4.0  # without an event, though a daemon sends its status each second


class PadServer(Server):
    """Serves one browser on one address; a context manager, whose end closes everything.

    `ended` is set once the pad has not been touched for `idle_s`. Raises GesturedError if the address cannot be had.
    """

    def __init__(self, listen: Address, pad: Pad, program: str, idle_s: float = IDLE_S) -> None:
        """`program` is the command that prints the page's address, and prints another one if it is started again."""
        super().__init__(listen, Door(program), PAGE, _Handler)
        if (host := ip_address(self.address.host)).is_unspecified or host.is_multicast:
            self.server_close()
            raise GesturedError(f"--listen {listen}: expected one address of this machine, such as {DEFAULT}")
        self.pad = pad
        self.ended = threading.Event()
        self._serving = threading.Thread(target=self.serve_forever, daemon=True)
        self.press: Callable[[str], None] | None = None  # takes a key of the page, if keys are wanted
        self._said = ""  # the last words of `say`
        self._idle_s, self._used = idle_s, time.monotonic()
        self._messages: deque[float] = deque(maxlen=MESSAGES)  # s, when the last ones came
        self._outbox: Outbox | None = None  # of the browser that has the pad
        self._seat = 0  # number of the browser that has it

    def serve(self, *sockets: Path) -> Self:
        """Serve from now on, in threads; the page shows the sensor's events of the daemons with these event sockets."""
        events = Subscriber(*sockets, types=HEARD, sensors=[self.pad.name], timeout=SILENT_S) if sockets else None
        self.pad.begin(self.tell, events)
        self._serving.start()
        return self

    @property
    def open(self) -> bool:
        """Whether a browser shows the pad."""
        return self._outbox is not None

    def tell(self, kind: str, what: dict[str, Any]) -> None:
        """Send something to the page; without a page it is dropped."""
        if (outbox := self._outbox) is not None:
            outbox.put(kind, what)

    def say(self, text: str) -> None:
        """Show words on the page; a browser that opens it later sees the last ones."""
        self._said = (self._said + text)[-SAID:]
        self.tell("told", {"text": text})

    def service_actions(self) -> None:
        """Do the base class's work, and end the address after `idle_s`."""
        super().service_actions()
        if time.monotonic() - self._used > self._idle_s and not self.ended.is_set():
            self.door.closed = True
            self.tell("over", {"reason": f"Nobody touched the pad for {self._idle_s / 60:.0f} minutes: it has ended."})
            self.leave(self._outbox)
            self.ended.set()

    def sit(self) -> Outbox:
        """Give the pad to a browser, in place of the one before; returns what waits for it."""
        pad, before = self.pad, self._outbox
        outbox = Outbox()
        with pad.lock:
            self._seat += 1
            pad.contacts.lift()
            what = {"seat": self._seat, "sensor": pad.name, "grid": pad.grid, "rate_hz": pad.rate_hz, "to": str(pad.to)}
            outbox.put("seat", what | {"keys": self.press is not None})
            outbox.put("told", {"text": self._said})
            self._outbox = outbox
        if before is not None:
            before.put("over", {"reason": "Another tab shows this pad now."})
            before.close()
        return outbox

    def leave(self, outbox: Outbox | None) -> None:
        """Note that a browser no longer shows the pad: its contacts end."""
        with self.pad.lock:
            if outbox is not None and outbox is self._outbox:
                self._outbox = None
                self.pad.contacts.lift()
        if outbox is not None:
            outbox.close()

    def touch(self, what: dict[str, Any]) -> Said:
        """Take a message of the browser that has the pad."""
        now = time.monotonic()
        if len(self._messages) == MESSAGES and now - self._messages[0] < 1.0:
            return HTTPStatus.TOO_MANY_REQUESTS, {"error": f"expected at most {MESSAGES} messages a second"}
        self._messages.append(now)
        sent, samples = what.get("sent"), what.get("samples")
        if not isinstance(sent, int | float) or not isinstance(samples, list):
            return HTTPStatus.BAD_REQUEST, {"error": "expected a seat, s of the browser's clock as sent, and samples"}
        with self.pad.lock:
            if what.get("seat") != self._seat or self._outbox is None:
                return HTTPStatus.CONFLICT, {"error": "another tab shows this pad now"}
            try:
                self.pad.contacts.take(float(sent), samples, now)
            except (ValueError, OverflowError) as error:
                return HTTPStatus.BAD_REQUEST, {"error": str(error)}
        self._used = now
        return HTTPStatus.OK, {}

    def __exit__(self, *_: object) -> None:
        self.door.closed = True
        self.pad.close()
        if self._serving.is_alive():  # else `shutdown` would wait for ever
            self.shutdown()
        self.leave(self._outbox)
        self.server_close()


class _Handler(Handler):
    """One request of a browser, and its answer."""

    server: PadServer
    protocol_version = "HTTP/1.1"  # one connection carries all messages

    def look(self, query: Mapping[str, str]) -> None:
        """Stream frames and names."""
        outbox = self.server.sit()
        try:
            self.stream(outbox)
        finally:
            self.server.leave(outbox)

    def act(self, what: dict[str, Any]) -> Said:
        """Touch the pad, or press a key."""
        if self.path == "/touch":
            return self.server.touch(what)
        press, key = self.server.press, what.get("key")
        if self.path == "/key" and press is not None and isinstance(key, str):
            press(key)
            return HTTPStatus.OK, {}
        return HTTPStatus.NOT_FOUND, {"error": "expected /touch"}
