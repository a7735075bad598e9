"""A real browser without a window, spoken to by its own protocol (Chrome DevTools) over its websocket."""

import base64
import json
import os
import re
import select
import shutil
import socket
import struct
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

DEADLINE_S = 60.0
GONE = -32000  # the error of a question to a page that was left before its answer
PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class PageGone(AssertionError):
    """The page was left, or loaded again, before it had answered."""


class Browser:
    """Chromium with one empty page; a context manager."""

    def __init__(self, folder: Path) -> None:
        assert PROGRAM is not None
        command = [
            PROGRAM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--disable-background-networking", "--disable-extensions", "--remote-debugging-port=0",
            f"--user-data-dir={folder}", "about:blank",
        ]  # fmt: skip
        self._process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
        self.said: list[dict[str, Any]] = []  # what it told of itself
        self._number = 0
        try:
            where = self._where()
            self._web = WebSocket(where)
            target = self.call("Target.createTarget", url="about:blank")["targetId"]
            self._session: str | None = None
            self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            for domain in ("Page", "Runtime", "Log", "Network", "Accessibility"):
                self.call(f"{domain}.enable")
        except BaseException:
            self.close()
            raise

    def _where(self) -> str:
        assert self._process.stderr is not None
        said, end = b"", time.monotonic() + DEADLINE_S
        while time.monotonic() < end:
            if select.select([self._process.stderr], [], [], 1.0)[0]:
                said += os.read(self._process.stderr.fileno(), 4096)
                if found := re.search(rb"DevTools listening on (ws://\S+)\s", said):
                    return found[1].decode()
        raise AssertionError(f"no browser: {said.decode(errors='replace')}")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask for something, and wait for the answer."""
        self._number += 1
        request: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if getattr(self, "_session", None):
            request["sessionId"] = self._session
        self._web.send(json.dumps(request))
        while True:
            message = json.loads(self._web.receive())
            if message.get("id") == self._number:
                if message.get("error", {}).get("code") == GONE:
                    raise PageGone(method, message)
                assert "error" not in message, (method, message)
                return message["result"]
            self.said.append(message)

    def run(self, script: str) -> Any:
        """The value of an expression in the page."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def until(self, script: str) -> Any:
        """The value of an expression once it is true."""
        end = time.monotonic() + DEADLINE_S
        while time.monotonic() < end:
            with suppress(PageGone):  # it is being loaded again
                if found := self.run(script):
                    return found
            time.sleep(0.01)  # for the page's own work
        raise AssertionError(f"never: {script}; the page says {self.run('document.body.innerText')}")

    def size(self, width: int, height: int) -> None:
        """The window's size in pixels."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    def colours(self, scheme: str) -> None:
        """What the reader prefers: dark or light."""
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def complaints(self) -> list[str]:
        """Errors and warnings of the console, exceptions, and requests that failed."""
        self.run("1")
        found = []
        for message in self.said:
            what = message.get("params", {})
            match message.get("method"):
                case "Runtime.consoleAPICalled" if what["type"] in ("error", "warning"):
                    found.append(str(what["args"]))
                case "Runtime.exceptionThrown":
                    found.append(str(what["exceptionDetails"]))
                case "Log.entryAdded" if what["entry"]["level"] in ("error", "warning"):
                    found.append(str(what["entry"]))
        return found

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stderr is not None
        self._process.stderr.close()

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class WebSocket:
    """A client of RFC 6455, as far as is needed here: text frames, whole or in parts."""

    def __init__(self, address: str) -> None:
        where = urlsplit(address)
        self._socket = socket.create_connection((where.hostname, where.port), timeout=DEADLINE_S)
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            f"GET {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        self._file = self._socket.makefile("rb")
        assert b" 101 " in self._file.readline()
        while self._file.readline().strip():
            pass

    def send(self, text: str) -> None:
        """One message; a client's bytes are masked."""
        data, mask = text.encode(), os.urandom(4)
        size = bytes([0x80 | len(data)]) if len(data) < 126 else struct.pack(">BH", 0xFE, len(data))
        if len(data) > 0xFFFF:
            size = struct.pack(">BQ", 0xFF, len(data))
        self._socket.sendall(b"\x81" + size + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(data)))

    def receive(self) -> str:
        """The next message."""
        whole = b""
        while True:
            first, size = self._file.read(2)
            if size == 126:
                (size,) = struct.unpack(">H", self._file.read(2))
            elif size == 127:
                (size,) = struct.unpack(">Q", self._file.read(8))
            whole += self._file.read(size)
            if first & 0x80:
                return whole.decode()
