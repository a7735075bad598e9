"""The page over HTTP, and server-sent events; a thread for each browser, so that none waits for another."""

import json
import socket
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from gestured.client.holder import bind_failure
from gestured.control.view.door import Door, at_home
from gestured.control.view.outbox import Outbox
from gestured.control.view.source import Source
from gestured.core.address import Address
from gestured.core.errors import GesturedError

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
BROWSERS = 32  # connections at a time
BODY_BYTES = 4096  # of a request
ASK_S = 10.0  # for a request to come
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
        self._busy = 0
        try:
            super().__init__((listen.host, listen.port), Handler)
        except OSError as error:
            reason = bind_failure(error, listen, socket.SOCK_STREAM)
            raise GesturedError(f"--listen {listen}: cannot be had: {reason}") from error
        self.address = Address(*self.socket.getsockname()[:2])

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Not more browsers than there is room for."""
        return self._busy < BROWSERS

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """One connection, in its thread."""
        self._busy += 1
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._busy -= 1

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
        if not at_home(self.headers, self.port):
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"another host, or another site's page\n")
        elif where.path == "/" and self.server.door.open(query.get("token", "")):
            self._file("/", {"Set-Cookie": self.server.door.cookie(self.port)})
        elif not self.server.door.knows(self.headers, self.port):
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", CLOSED.encode())
        elif where.path == "/stream":
            self._stream(Outbox(query.get("sensor", ""), query.get("raw") == "1"))
        elif where.path in FILES:
            self._file(where.path, {})
        else:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"no such page\n")

    def do_POST(self) -> None:  # noqa: N802
        """Flag or recalibrate: the requests that change anything."""
        door, source = self.server.door, self.server.source
        may = at_home(self.headers, self.port) and door.knows(self.headers, self.port) and door.may_change(self.headers)
        try:
            length = int(self.headers.get("Content-Length", ""))
            what = json.loads(self.rfile.read(length)) if 0 <= length <= BODY_BYTES else None
        except (ValueError, OSError):
            what = None
        if not may:
            self._json(HTTPStatus.FORBIDDEN, {"error": "the page's token is missing; load the page again"})
        elif not isinstance(what, dict) or not all(isinstance(value, str) for value in what.values()):
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

    @property
    def port(self) -> int:
        """The port of the page itself."""
        return self.server.address.port

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is logged: who looks is not our business, and an address holds the token."""

    def _file(self, path: str, more: dict[str, str]) -> None:
        name, kind = FILES[path]
        self._answer(HTTPStatus.OK, kind, (PAGE / name).read_bytes(), more)

    def _json(self, status: HTTPStatus, what: dict[str, str]) -> None:
        self._answer(status, "application/json", json.dumps(what).encode())

    def _answer(self, status: HTTPStatus, kind: str, body: bytes, more: dict[str, str] | None = None) -> None:
        self._head(status, {"Content-Type": kind, "Content-Length": str(len(body))} | (more or {}))
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
        outbox.put("hello", {"token": self.server.door.header})
        self.server.source.join(outbox)
        try:
            while (what := outbox.take(ALIVE_S)) is not None:
                self.wfile.write(what)
        except OSError:
            pass  # it has gone
        finally:
            self.server.source.leave(outbox)
