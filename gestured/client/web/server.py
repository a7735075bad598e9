"""A page over HTTP, and server-sent events; a thread for each connection, so that no browser waits for another."""

import json
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from gestured.client.address import bind_failure
from gestured.client.web.door import Door, at_home
from gestured.client.web.outbox import Outbox
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.core.messages import json_object

SHARED = Path(__file__).with_name("page")
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
SAFE = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
STRANGERS = 32  # connections at a time that have not shown the secret; a further one takes the oldest one's place
BODY_BYTES = 4096  # of a request
ASK_S = 10.0  # for all of a request to come, and for its answer to go
SEND_S = 60.0  # for a browser that is stalled; then it has to come again, which it does by itself
ALIVE_S = 5.0  # without anything new, a comment says that the server is there
SENT_BYTES = 32 << 10  # that may be on their way to a browser: a stalled one comes back to the present, not to the past

Said = tuple[HTTPStatus, Mapping[str, Any]]  # an answer, as a JSON object


class Server(ThreadingHTTPServer):
    """Serves the files of `page`, and those that all pages share; a context manager.

    Raises GesturedError where the address cannot be had.
    """

    daemon_threads = True
    block_on_close = False
    request_queue_size = 128  # beyond that the kernel has a browser try again, after a second, then three, then seven

    def __init__(self, listen: Address, door: Door, page: Path, handler: "type[Handler]") -> None:
        self.door = door
        self.files = {f"/{path.name}": path for folder in (SHARED, page) for path in folder.iterdir()}
        self.files["/"] = self.files.pop("/index.html")
        self.address_family = socket.AF_INET6 if ":" in listen.host else socket.AF_INET
        self._strangers: dict[socket.socket, float] = {}  # since when they are there (monotonic s), the oldest first
        try:
            super().__init__((listen.host, listen.port), handler)
        except OSError as error:
            reason = bind_failure(error, listen, socket.SOCK_STREAM)
            raise GesturedError(f"--listen {listen}: cannot be had: {reason}") from error
        self.address = Address(*self.socket.getsockname()[:2])

    @property
    def page(self) -> str:
        """The page's address, with the token that opens it once."""
        return f"http://{self.address}/#{self.door.token}"

    def process_request(self, request: Any, client_address: Any) -> None:
        """A new connection: who takes all places gives the oldest one's to others."""
        for oldest in list(self._strangers)[: 1 - STRANGERS]:
            self.no_stranger(oldest)
            _hang_up(oldest)
        self._strangers[request] = time.monotonic()
        super().process_request(request, client_address)

    def service_actions(self) -> None:
        """Hang up on strangers who take their time; called twice a second."""
        for request, since in list(self._strangers.items()):
            if time.monotonic() - since > ASK_S:
                _hang_up(request)

    def shutdown_request(self, request: Any) -> None:
        """The end of a connection."""
        self.no_stranger(request)
        super().shutdown_request(request)

    def no_stranger(self, request: socket.socket) -> None:
        """Who has shown the secret may stay."""
        self._strangers.pop(request, None)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that has gone is none of our business."""


class Handler(BaseHTTPRequestHandler):
    """A request of a browser, and its answer. What a page shows and does is in `look` and `act`."""

    server: Server
    timeout = ASK_S
    disable_nagle_algorithm = True  # an answer is two writes, and the second would wait for the first one's receipt
    server_version, sys_version = "gestured", ""

    def look(self, query: Mapping[str, str]) -> None:
        """Stream what the page shows; the browser has shown the secret."""
        raise NotImplementedError

    def act(self, what: dict[str, Any]) -> Said:
        """Do what the page asks for; the browser has shown the secret."""
        raise NotImplementedError

    def do_GET(self) -> None:  # noqa: N802  # http.server's name
        """The page, its parts, and the stream."""
        try:
            where = urlsplit(self.path)
        except ValueError:
            self.refuse(HTTPStatus.BAD_REQUEST, "no address")
            return
        if not at_home(self.headers, self.server.address):
            self.refuse(HTTPStatus.FORBIDDEN, "another host, or another site's page")
        elif (file := self.server.files.get(where.path)) is not None:  # nothing in them is anybody's
            self._answer(HTTPStatus.OK, f"{KINDS[file.suffix]}; charset=utf-8", file.read_bytes())
        elif where.path != "/stream":
            self.refuse(HTTPStatus.NOT_FOUND, "no such page")
        elif not self._known():
            self.refuse(HTTPStatus.FORBIDDEN, self._closed)
        else:
            self.look({key: values[0] for key, values in parse_qs(where.query).items()})

    def do_POST(self) -> None:  # noqa: N802
        """Come in, or act: what needs the token, and what changes anything."""
        door = self.server.door
        try:
            length = int(self.headers.get("Content-Length", ""))
            fits = 0 <= length <= BODY_BYTES
            what = json_object(self.rfile.read(length)) if fits else None
        except (ValueError, OSError):
            fits, what = False, None
        self.close_connection |= not fits  # what has not been read is no further request
        if not at_home(self.headers, self.server.address):
            said: Said = HTTPStatus.FORBIDDEN, {"error": "another host, or another site's page"}
        elif self.path == "/open" and (secret := door.open(self.headers)) is not None:
            said = HTTPStatus.OK, {"secret": secret}
        elif not self._known():
            said = HTTPStatus.FORBIDDEN, {"error": self._closed}
        elif what is None:
            said = HTTPStatus.BAD_REQUEST, {"error": f"expected a JSON object, at most {BODY_BYTES} bytes"}
        else:
            said = self.act(what)
        self._answer(said[0], "application/json", json.dumps(said[1]).encode())

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is logged: who looks is not our business, and an address holds the token."""

    def refuse(self, status: HTTPStatus, words: str) -> None:
        """Answer with a sentence."""
        self._answer(status, "text/plain", f"{words}\n".encode())

    def stream(self, outbox: Outbox) -> None:
        """Send what comes into an outbox, until it is closed or the browser has gone."""
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
        self.connection.settimeout(SEND_S)
        self.close_connection = True
        self._head(HTTPStatus.OK, {"Content-Type": "text/event-stream", "Connection": "close"})
        with suppress(OSError):  # it has gone
            while (what := outbox.take(ALIVE_S)) is not None:
                self.wfile.write(what)

    @property
    def _closed(self) -> str:
        program = self.server.door.program
        return f"This address has been used, or is not the right one. Start {program} again, and open what it prints."

    def _known(self) -> bool:
        known = self.server.door.knows(self.headers)
        if known:
            self.server.no_stranger(self.connection)
        return known

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self._head(status, {"Content-Type": kind, "Content-Length": str(len(body))})
        self.wfile.write(body)

    def _head(self, status: HTTPStatus, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in (SAFE | headers).items():
            self.send_header(name, value)
        self.end_headers()


def _hang_up(connection: socket.socket) -> None:
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
