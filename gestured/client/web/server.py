"""The server of a page over HTTP, with server-sent events; each connection has a thread, so no browser waits."""

import json
import socket
import sys
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
ASK_S = 10.0  # s for a request to come, and for its answer to go
SEND_S = 60.0  # s for a browser that is stalled; after them it has to connect again, which it does by itself
ALIVE_S = 5.0  # s without an event, after which a comment shows that the server is alive
SENT_BYTES = 32 << 10  # that may be on their way to a browser; few, so that one that was stalled sees the present soon

Said = tuple[HTTPStatus, Mapping[str, Any]]  # an answer, as a JSON object


class Server(ThreadingHTTPServer):
    """Serves the files of `page`, and those that all pages share; a context manager.

    Raises GesturedError if the address cannot be had.
    """

    daemon_threads = True
    block_on_close = False
    request_queue_size = 128  # beyond them a browser's kernel tries again after one second, then after three and seven

    def __init__(self, listen: Address, door: Door, page: Path, handler: "type[Handler]") -> None:
        self.door = door
        self.files = {f"/{path.name}": path for folder in (SHARED, page) for path in folder.iterdir()}
        self.files["/"] = self.files.pop("/index.html")
        self.address_family = socket.AF_INET6 if ":" in listen.host else socket.AF_INET
        self._strangers: dict[socket.socket, float] = {}  # by connection: its begin (monotonic s), the oldest first
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
        """Serve a new connection, which takes the place of the oldest stranger if there are too many."""
        for oldest in list(self._strangers)[: 1 - STRANGERS]:
            self.no_stranger(oldest)
            _hang_up(oldest)
        self._strangers[request] = time.monotonic()
        super().process_request(request, client_address)

    def service_actions(self) -> None:
        """Hang up on strangers that are too slow; http.server calls this twice a second."""
        for request, since in list(self._strangers.items()):
            if time.monotonic() - since > ASK_S:
                _hang_up(request)

    def shutdown_request(self, request: Any) -> None:
        """End a connection."""
        self.no_stranger(request)
        super().shutdown_request(request)

    def no_stranger(self, request: socket.socket) -> None:
        """Note that a connection is no stranger any more: it has shown the secret, or is over."""
        self._strangers.pop(request, None)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print the traceback of a bug, but not that a browser has gone."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """One request of a browser, and its answer. Subclasses define what a page shows (`look`) and does (`act`)."""

    server: Server
    timeout = ASK_S
    disable_nagle_algorithm = True  # else the second write of an answer waits for the receipt of the first one
    server_version, sys_version = "gestured", ""

    def look(self, query: Mapping[str, str]) -> None:
        """Stream what the page shows; the browser has shown the secret."""
        raise NotImplementedError

    def act(self, what: dict[str, Any]) -> Said:
        """Do what the page asks for; the browser has shown the secret."""
        raise NotImplementedError

    def do_GET(self) -> None:  # noqa: N802  # http.server's name
        """Answer with the page, one of its parts, or the stream."""
        try:
            where = urlsplit(self.path)
        except ValueError:
            self.refuse(HTTPStatus.BAD_REQUEST, "no address")
            return
        if not at_home(self.headers, self.server.address):
            self.refuse(HTTPStatus.FORBIDDEN, self._elsewhere)
        elif (file := self.server.files.get(where.path)) is not None:  # no file holds private data
            self._answer(HTTPStatus.OK, f"{KINDS[file.suffix]}; charset=utf-8", file.read_bytes())
        elif where.path != "/stream":
            self.refuse(HTTPStatus.NOT_FOUND, "no such page")
        elif not self._known():
            self.refuse(HTTPStatus.FORBIDDEN, self._closed)
        else:
            self.look({key: values[0] for key, values in parse_qs(where.query).items()})

    def do_POST(self) -> None:  # noqa: N802
        """Come in with the token, or act with the secret."""
        door = self.server.door
        try:
            length = int(self.headers.get("Content-Length", ""))
            fits = 0 <= length <= BODY_BYTES
            what = json_object(self.rfile.read(length)) if fits else None
        except (ValueError, OSError):
            fits, what = False, None
        self.close_connection |= not fits  # the rest of the body must not be read as a request
        if not at_home(self.headers, self.server.address):
            said: Said = HTTPStatus.FORBIDDEN, {"error": self._elsewhere}
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
        """Log nothing, since who looks at a page is nobody's business."""

    def refuse(self, status: HTTPStatus, words: str) -> None:
        """Answer with a sentence."""
        self._answer(status, "text/plain", f"{words}\n".encode())

    def stream(self, outbox: Outbox) -> None:
        """Send what comes into an outbox, until the outbox is closed or the browser has gone."""
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
        self.connection.settimeout(SEND_S)
        self.close_connection = True
        self._head(HTTPStatus.OK, {"Content-Type": "text/event-stream", "Connection": "close"})
        with suppress(OSError):  # the browser has gone
            while (what := outbox.take(ALIVE_S)) is not None:
                self.wfile.write(what)

    @property
    def _elsewhere(self) -> str:
        return f"The page is at http://{self.server.address}/ alone, and no other site's page may lead here: type it."

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
