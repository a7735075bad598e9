"""The page of a pad: who may touch it, and how much."""

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
MESSAGES = 120  # a second
IDLE_S = 600.0  # without a touch; then the address has ended
SAID = 1000  # characters
DEFAULT = Address("127.0.0.1", 9110)
HEARD = ("onset", "provisional", "gesture", "unknown", "cancelled", "status")  # the status says that it lives
SILENT_S = 4.0  # without a word; a daemon tells its status each second


class PadServer(Server):
    """Serves one browser, on the one address that it is given; a context manager, served as long as that lasts.

    `ended` is set once the pad has not been touched for `idle_s`. Raises GesturedError where the address cannot be had.
    """

    def __init__(self, listen: Address, pad: Pad, program: str, idle_s: float = IDLE_S) -> None:
        """`program` printed the page's address, and would print another one."""
        super().__init__(listen, Door(program), PAGE, _Handler)
        if (host := ip_address(self.address.host)).is_unspecified or host.is_multicast:
            self.server_close()
            raise GesturedError(f"--listen {listen}: expected one address of this machine, such as {DEFAULT}")
        self.pad = pad
        self.ended = threading.Event()
        self.press: Callable[[str], None] | None = None  # takes a key of the page, where somebody waits for one
        self._said = ""  # what somebody who waits for keys has said last
        self._idle_s, self._used = idle_s, time.monotonic()
        self._messages: deque[float] = deque(maxlen=MESSAGES)  # when the last ones came
        self._outbox: Outbox | None = None  # of the browser that has the pad
        self._seat = 0  # counts the browsers that had it

    def serve(self, *sockets: Path) -> Self:
        """Serve from now on, in threads; the page is told the sensor's events by the daemon with this event socket."""
        events = Subscriber(*sockets, types=HEARD, sensors=[self.pad.name], timeout=SILENT_S) if sockets else None
        self.pad.begin(self.tell, events)
        threading.Thread(target=self.serve_forever, daemon=True).start()
        return self

    @property
    def open(self) -> bool:
        """Whether a browser shows the pad."""
        return self._outbox is not None

    def tell(self, kind: str, what: dict[str, Any]) -> None:
        """Tell the page something; without a page nobody is told."""
        if (outbox := self._outbox) is None:
            return
        if kind == "frame":
            outbox.frame(what)
        else:
            outbox.put(kind, what)

    def say(self, text: str) -> None:
        """Show words on the page; whoever opens it later sees the last ones."""
        self._said = (self._said + text)[-SAID:]
        self.tell("told", {"text": text})

    def service_actions(self) -> None:
        """End the address after its time, too."""
        super().service_actions()
        if time.monotonic() - self._used > self._idle_s and not self.ended.is_set():
            self.door.closed = True
            self.tell("over", {"reason": f"Nobody touched the pad for {self._idle_s / 60:.0f} minutes: it has ended."})
            self.leave(self._outbox)
            self.ended.set()

    def sit(self) -> Outbox:
        """A browser shows the pad, in place of the one before."""
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
        """A browser shows it no more: what touched it there is lifted."""
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
