"""A bad network of our own: seeded, packet by packet. `Line` is the arithmetic, `Proxy` the same with sockets."""

import heapq
import itertools
import select
import socket
import threading
import time
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Impairment:
    """What becomes of a packet. Shares are probabilities of each packet, times are seconds."""

    loss: float = 0.0  # lost in the long run
    burst: float = 1.0  # packets that are lost in a row, on average (Gilbert's model)
    duplicate: float = 0.0  # arrives twice, the copy 0.04 s later on average
    delay_s: float = 0.0  # each comes so much later
    jitter_s: float = 0.0  # and up to so much more; more than a frame's period puts them out of order
    late: float = 0.0  # comes 0.15 s later than its neighbours: it is overtaken
    corrupt: float = 0.0  # one to eight bytes are changed
    cut: float = 0.0  # is cut short
    stall_s: float = 0.0  # each ten seconds nothing passes for so long, and then all of it at once


class Line:
    """One way through a bad network. The same seed and the same packets give the same arrivals."""

    def __init__(self, impairment: Impairment, seed: int) -> None:
        self._what, self._random = impairment, np.random.default_rng(seed)
        self._losing = False

    def push(self, t: float, packet: bytes) -> list[tuple[float, bytes]]:
        """(time of arrival in s, packet) of what becomes of a packet that is sent at `t`."""
        what = self._what
        # A fixed number of draws for each packet: what becomes of one does not change the others' luck.
        lost, doubled, late, corrupt, cut, jitter, copy = self._random.random(7)
        edits = self._random.integers(0, 256, (8, 3))
        if self._losing:
            self._losing = lost >= 1 / what.burst
        else:
            self._losing = lost < what.loss / (what.burst * (1 - what.loss))
        if self._losing:
            return []
        if corrupt < what.corrupt and packet:
            damaged = bytearray(packet)
            for high, low, value in edits[: 1 + edits[0, 2] % 8].tolist():
                damaged[(256 * high + low) % len(damaged)] = value
            packet = bytes(damaged)
        if cut < what.cut:
            packet = packet[: int(edits[0, 0]) * len(packet) // 256]
        arrival = t + what.delay_s + what.jitter_s * float(jitter) + 0.15 * (late < what.late)
        if (arrival % 10.0) < what.stall_s:
            arrival += what.stall_s - arrival % 10.0
        arrivals = [(arrival, packet)]
        if doubled < what.duplicate:
            arrivals.append((arrival + 0.08 * float(copy), packet))
        return arrivals


class Proxy:
    """UDP from `address` to `to` through a Line, in real time; a context manager.

    `line` may be replaced at any time. Each sender keeps one source port of its own, as behind a router.
    """

    def __init__(self, to: tuple[str, int], impairment: Impairment, seed: int = 0) -> None:
        self.line = Line(impairment, seed)
        self._to = to
        self._in = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._in.bind(("127.0.0.1", 0))
        self._in.setblocking(False)
        self.address: tuple[str, int] = self._in.getsockname()
        self._outs: dict[tuple[str, int], socket.socket] = {}
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        waiting: list[tuple[float, int, bytes, socket.socket]] = []
        order = itertools.count()
        while not self._end.is_set():
            wait = min(0.05, max(0.0, waiting[0][0] - time.monotonic())) if waiting else 0.05
            if select.select([self._in], [], [], wait)[0]:
                packet, source = self._in.recvfrom(65_536)
                out = self._out(source)
                for arrival, what in self.line.push(time.monotonic(), packet):
                    heapq.heappush(waiting, (arrival, next(order), what, out))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, packet, out = heapq.heappop(waiting)
                out.send(packet)

    def _out(self, source: tuple[str, int]) -> socket.socket:
        if source not in self._outs:
            self._outs[source] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._outs[source].connect(self._to)
        return self._outs[source]

    def __enter__(self) -> "Proxy":
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()
        for sock in (self._in, *self._outs.values()):
            sock.close()
