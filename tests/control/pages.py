"""A page that gesturectl serves, as an HTTP client sees it; and the view, served in this process."""

import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from gestured.client.web.door import HEADER, Door
from gestured.control.view.server import ViewServer
from gestured.control.view.source import Source
from gestured.core.address import Address
from tests.daemon.harness import DEADLINE_S


class Page:
    """The viewer as an HTTP client sees it."""

    def __init__(self, said: str) -> None:
        where = urlsplit(said.strip())
        self.whole, self.address, self.token = said.strip(), Address.parse(where.netloc), where.fragment
        self.secret = ""

    def ask(self, path: str, method: str = "GET", body: object = None, **headers: str) -> tuple[int, Any, bytes]:
        """Status, headers and body; with the secret, unless `headers` say otherwise."""
        connection = http.client.HTTPConnection(*self.address, timeout=DEADLINE_S)
        given = {HEADER: self.secret} | {name.replace("_", "-"): value for name, value in headers.items()}
        data = body if isinstance(body, bytes | None) else json.dumps(body)
        try:
            connection.request(method, path, data, {k: v for k, v in given.items() if v})
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def come_in(self) -> "Page":
        """Use the token."""
        status, _, body = self.ask("/open", "POST", {}, X_Gestured_Token=self.token)
        assert status == 200
        self.secret = json.loads(body)["secret"]
        return self

    def stream(self, sensor: str = "") -> "Stream":
        """The server-sent events."""
        return Stream(self, sensor)


class Stream:
    """Server-sent events, read as they come."""

    def __init__(self, page: Page, sensor: str, received: int | None = None) -> None:
        self.sock = socket.socket(socket.AF_INET)
        if received is not None:
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, received)
        self.sock.settimeout(DEADLINE_S)
        self.sock.connect(page.address)
        request = f"GET /stream?sensor={sensor} HTTP/1.1\r\nHost: {page.address}\r\n{HEADER}: {page.secret}\r\n\r\n"
        self.sock.sendall(request.encode())
        self._file = self.sock.makefile("rb")
        assert b" 200 " in self._file.readline()
        while self._file.readline().strip():
            pass

    def until(self, *kinds: str) -> tuple[str, dict[str, Any]]:
        """The next event of one of these kinds."""
        kind, end = "", time.monotonic() + DEADLINE_S
        while line := self._file.readline().decode():
            assert time.monotonic() < end, f"none of {kinds} came"
            if line.startswith("event: "):
                kind = line[7:].strip()
            elif line.startswith("data: ") and kind in kinds:
                return kind, json.loads(line[6:])
        raise AssertionError("the viewer hung up")

    def close(self) -> None:
        """Look no more."""
        self._file.close()
        self.sock.close()


@contextmanager
def viewing(control: object, folder: Path = Path()) -> Iterator[Page]:
    """The page of `gesturectl view`, of the daemon with this control socket."""
    source = Source(Path(str(control)), folder)
    with ViewServer(Address("127.0.0.1", 0), source, Door("gesturectl view")) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()  # s, until it hears `shutdown`
        yield Page(server.page)
        source.close()
        server.shutdown()
