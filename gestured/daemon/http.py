"""The pages /metrics, /healthz and /readyz, served by a thread with an event loop of its own.

So these pages answer even if the daemon's loop hangs, and /healthz says 503 then. A connection has DEADLINE_S in all
and a bounded request; if there are too many connections, the oldest is closed, so that slow clients hold up nobody.
This module is loaded only if `metrics` is set.
"""

import asyncio
import json
import re
import socket
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus

from gestured.daemon.exposition import exposition
from gestured.daemon.log import Throttle
from gestured.daemon.parts import Parts
from gestured.daemon.sockets import AGAIN_S, AddressError, reason_of
from gestured.daemon.status import healthy, status

DEADLINE_S = 5.0  # for a connection, from its beginning to the end of its answer
REQUEST_BYTES = 8192  # of a request's head, at most
HTTP_CONNECTIONS = 64  # at a time
REST = 4  # seconds of pause for each second of work on connections

Response = tuple[int, str, bytes]  # status, content type, body


def as_json(status: int, body: Mapping[str, object]) -> Response:
    """An answer of one JSON object."""
    return status, "application/json", json.dumps(body).encode() + b"\n"


def serve_pages(sock: socket.socket, parts: Parts) -> "HttpThread":
    """Serve the daemon's pages on a listening socket; each request reads the daemon's state anew."""

    def metrics() -> Response:
        return 200, "text/plain; version=0.0.4; charset=utf-8", exposition(parts.metrics, status(parts))

    def healthz() -> Response:
        found = healthy(parts)
        return as_json(200 if found["healthy"] else 503, found)

    def readyz() -> Response:
        found = status(parts)["ready"]
        return as_json(200 if found["ready"] else 503, found)

    return HttpThread(sock, {"/metrics": metrics, "/healthz": healthz, "/readyz": readyz})


class HttpThread:
    """Serves GET and HEAD of `routes` (path -> function that makes the answer) on a listening socket.

    Raises AddressError if there are too few descriptors for its loop.
    """

    def __init__(self, sock: socket.socket, routes: dict[str, Callable[[], Response]]) -> None:
        self._sock, self._routes = sock, routes
        self._throttle = Throttle()
        self._open: dict[asyncio.StreamWriter, None] = {}  # oldest first
        self._stop = asyncio.Event()
        try:
            self._loop = asyncio.SelectorEventLoop()
        except OSError as error:
            raise AddressError(f"metrics: cannot serve: {error.strerror}") from error
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving and close the socket."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(1.0)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._main())

    async def _main(self) -> None:
        accepting = asyncio.create_task(self._accept())
        await self._stop.wait()
        accepting.cancel()
        self._sock.close()

    async def _accept(self) -> None:
        """Accept connections. asyncio's own server is not used: without a descriptor it retries a hundred times.

        After each connection there is a pause in which the daemon's thread has the interpreter, so that no number of
        requests delays an answer about a gesture.
        """
        spent = time.thread_time()
        while True:
            try:
                sock, _ = await self._loop.sock_accept(self._sock)
                reader = asyncio.StreamReader(REQUEST_BYTES)
                await self._loop.connect_accepted_socket(
                    partial(asyncio.StreamReaderProtocol, reader, self._serve), sock
                )
            except OSError as error:
                self._throttle.warn("cannot accept a connection to metrics", reason_of(error))
                await asyncio.sleep(AGAIN_S)
            else:
                before, spent = spent, time.thread_time()
                await asyncio.sleep(REST * (spent - before))

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._open) >= HTTP_CONNECTIONS:
            oldest = next(iter(self._open))
            del self._open[oldest]
            oldest.transport.abort()
        self._open[writer] = None
        try:
            async with asyncio.timeout(DEADLINE_S):
                head = b""
                while not head.endswith((b"\n\r\n", b"\n\n")):  # RFC 9112, 2.2: a line may end without \r
                    head += await reader.readuntil(b"\n")
                    if len(head) > REQUEST_BYTES:
                        return
                writer.write(self._answer(head))
                await writer.drain()
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, asyncio.CancelledError):
            pass  # the client was too slow, asked too much or is gone, or the daemon ends: no answer
        finally:
            self._open.pop(writer, None)
            writer.transport.abort() if writer.transport.get_write_buffer_size() else writer.close()

    def _answer(self, head: bytes) -> bytes:
        words = head.strip().split(b"\n", 1)[0].split()
        if len(words) != 3 or not words[2].startswith(b"HTTP/1."):
            status, kind, body = as_json(400, {"error": "not an HTTP/1 request"})
        elif words[0] not in (b"GET", b"HEAD"):
            status, kind, body = as_json(405, {"error": "only GET and HEAD"})
        else:
            path = re.sub(rb"^https?://[^/]*", b"", words[1].split(b"?", 1)[0], flags=re.IGNORECASE)
            route = self._routes.get(path.decode("latin-1"))
            try:
                status, kind, body = (
                    route() if route else as_json(404, {"error": "not found", "paths": list(self._routes)})
                )
            except Exception as error:  # a bug in a route costs this answer alone
                status, kind, body = as_json(500, {"error": repr(error)})
        header = (
            f"HTTP/1.1 {status} {HTTPStatus(status).phrase}",
            f"Content-Type: {kind}",
            f"Content-Length: {len(body)}",
            "Connection: close\r\n\r\n",
        )
        return "\r\n".join(header).encode() + (b"" if words[:1] == [b"HEAD"] else body)
