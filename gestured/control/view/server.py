"""The page over HTTP, and server-sent events; a thread for each browser, so that none waits for another."""

import json
import socket
import threading
from collections import deque
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from gestured.client.holder import bind_failure
from gestured.control.view.door import Door, at_home
from gestured.control.view.outbox import Outbox
from gestured.control.view.source import Source
from gestured.core.address import Address, is_sensor
from gestured.core.errors import GesturedError
from gestured.core.messages import json_object

PAGE = Path(__file__).with_name("page")
FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/view.css": ("view.css", "text/css; charset=utf-8"),
    "/view.js": ("view.js", "text/javascript; charset=utf-8"),
}
SAFE = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
CLOSED = "This address has been used, or is not the right one. Start gesturectl view again, and open what it prints.\n"
BROWSERS = 32  # streams at a time
STRANGERS = 32  # connections at a time that have not shown the secret; a further one takes the oldest one's place
BODY_BYTES = 4096  # of a request
ASK_S = 10.0  # for all of a request to come, and for its answer to go
SEND_S = 60.0  # for a browser that is stalled; then it has to come again, which it does by itself
ALIVE_S = 5.0  # without anything new, a comment says that the viewer is there
SENT_BYTES = 32 << 10  # that may be on their way to a browser: a stalled one comes back to the present, not to the past


class Server(ThreadingHTTPServer):
    """Serves on a loopback address; a context manager. Raises GesturedError where it cannot be had."""

    daemon_threads = True
    block_on_close = False

    def __init__(self, listen: Address, source: Source, door: Door) -> None:
        self.source, self.door = source, door
        self.address_family = socket.AF_INET6 if ":" in listen.host else socket.AF_INET
        self._strangers: deque[socket.socket] = deque()  # the oldest first
        self._browsers = threading.Semaphore(BROWSERS)
        try:
            super().__init__((listen.host, listen.port), Handler)
        except OSError as error:
            reason = bind_failure(error, listen, socket.SOCK_STREAM)
            raise GesturedError(f"--listen {listen}: cannot be had: {reason}") from error
        self.address = Address(*self.socket.getsockname()[:2])

    def process_request(self, request: Any, client_address: Any) -> None:
        """A new connection: who takes his time, or all places, gives his to others."""
        while len(self._strangers) >= STRANGERS:
            _hang_up(self._strangers.popleft())
        self._strangers.append(request)
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """One connection, in its thread: one request."""
        deadline = threading.Timer(ASK_S, self._late, (request,))
        deadline.start()
        try:
            super().process_request_thread(request, client_address)
        finally:
            deadline.cancel()
            self._no_stranger(request)

    def begin_stream(self, request: socket.socket) -> bool:
        """Who has shown the secret may stay; false where there is no place for a further stream."""
        self._no_stranger(request)
        return self._browsers.acquire(blocking=False)

    def end_stream(self) -> None:
        """A browser has gone."""
        self._browsers.release()

    def _late(self, request: socket.socket) -> None:
        if request in self._strangers:
            _hang_up(request)

    def _no_stranger(self, request: socket.socket) -> None:
        with suppress(ValueError):
            self._strangers.remove(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that has gone is none of our business."""


class Handler(BaseHTTPRequestHandler):
    """One request of a browser, and its answer."""

    server: Server
    timeout = ASK_S
    server_version, sys_version = "gestured", ""

    def do_GET(self) -> None:  # noqa: N802  # http.server's name
        """The page, its parts, and the stream."""
        where = urlsplit(self.path)
        query = {key: values[0] for key, values in parse_qs(where.query).items()}
        sensor = query.get("sensor", "")
        if not at_home(self.headers, self.server.address):
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"another host, or another site's page\n")
        elif where.path in FILES:  # nothing in them is anybody's
            name, kind = FILES[where.path]
            self._answer(HTTPStatus.OK, kind, (PAGE / name).read_bytes())
        elif where.path != "/stream":
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"no such page\n")
        elif not self.server.door.knows(self.headers):
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", CLOSED.encode())
        elif sensor and not is_sensor(sensor):
            self._answer(HTTPStatus.BAD_REQUEST, "text/plain", b"sensor: expected 1 to 64 of A-Z, a-z, 0-9, _ and -\n")
        elif not self.server.begin_stream(self.connection):
            self._answer(HTTPStatus.SERVICE_UNAVAILABLE, "text/plain", b"too many pages look already\n")
        else:
            try:
                self._stream(Outbox(sensor, query.get("raw") == "1"))
            finally:
                self.server.end_stream()

    def do_POST(self) -> None:  # noqa: N802
        """Come in, flag or recalibrate: what needs the token, and what changes anything."""
        door, source = self.server.door, self.server.source
        try:
            length = int(self.headers.get("Content-Length", ""))
            what = json_object(self.rfile.read(length)) if 0 <= length <= BODY_BYTES else None
        except (ValueError, OSError):
            what = None
        if not at_home(self.headers, self.server.address):
            self._json(HTTPStatus.FORBIDDEN, {"error": "another host, or another site's page"})
        elif self.path == "/open" and (secret := door.open(self.headers)) is not None:
            self._json(HTTPStatus.OK, {"secret": secret})
        elif not door.knows(self.headers):
            self._json(HTTPStatus.FORBIDDEN, {"error": CLOSED.strip()})
        elif what is None or not all(isinstance(value, str) for value in what.values()):
            self._json(
                HTTPStatus.BAD_REQUEST, {"error": f"expected a JSON object of texts, at most {BODY_BYTES} bytes"}
            )
        else:
            acts = {
                "/flag": lambda: source.flag(what.get("note", "")),
                "/recalibrate": lambda: source.recalibrate(what.get("sensor", "")),
            }
            if self.path not in acts:
                self._json(HTTPStatus.NOT_FOUND, {"error": f"expected one of {', '.join(acts)}"})
                return
            try:
                self._json(HTTPStatus.OK, {"done": acts[self.path]()})
            except (GesturedError, OSError) as error:
                self._json(HTTPStatus.CONFLICT, {"error": str(error)})

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is logged: who looks is not our business, and an address holds the token."""

    def _json(self, status: HTTPStatus, what: dict[str, str]) -> None:
        self._answer(status, "application/json", json.dumps(what).encode())

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self._head(status, {"Content-Type": kind, "Content-Length": str(len(body))})
        self.wfile.write(body)

    def _head(self, status: HTTPStatus, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in (SAFE | headers).items():
            self.send_header(name, value)
        self.end_headers()

    def _stream(self, outbox: Outbox) -> None:
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
        self.connection.settimeout(SEND_S)
        self._head(HTTPStatus.OK, {"Content-Type": "text/event-stream"})
        self.server.source.join(outbox)
        try:
            while (what := outbox.take(ALIVE_S)) is not None:
                self.wfile.write(what)
        except OSError:
            pass  # it has gone
        finally:
            self.server.source.leave(outbox)


def _hang_up(connection: socket.socket) -> None:
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
