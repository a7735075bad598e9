"""What is fuzzed: each target takes any bytes, and raises only where a promise is broken.

Atheris drives them (`python -m tests.fuzz.run`), and so do Hypothesis and the kept corpus in `make test`.
"""

import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from gestured.core.errors import ModelError, ProtocolError
from gestured.core.frames import Segment
from gestured.core.messages import MAX_LINE, parse_subscription
from gestured.core.stamping import Stamper
from gestured.core.wire import FEW, Addresses, Arrival, Decoder
from gestured.daemon.client import Client
from gestured.model.model import Model
from tests.bounds import little_memory

CORPUS = Path(__file__).with_name("corpus")
BIG = "big"  # the sensor with 9 x 9 taxels; the others have 2 x 2, which a fuzzer hits more easily


def _decoder() -> Decoder:
    return Decoder(Addresses(), lambda name: (9, 9) if name == BIG else (2, 2), keep_touches=True)


_one = _decoder()
_stampers = {clock: Stamper(cast(Any, clock)) for clock in ("arrival", "sensor")}
_now = 0.0


def decoder(data: bytes) -> None:
    """A packet is frames and errors, the same whether or not its layout was seen before; frames get rising times."""
    global _now
    # One that has seen other packets, against one that has seen none, and the same once it knows this packet alone.
    found, new = [], _decoder()
    for one in (_one, new, new):
        found.append(one.decode(data, "source"))
        one._pending.clear()  # touches that wait for a frame: what comes next depends on them
    (arrivals, errors), *others = found
    assert all(_plain(*other) == _plain(arrivals, errors) for other in others), "depends on what came before"
    unseen = Decoder(Addresses(), lambda name: (9, 9) if name == BIG else (2, 2), keep_touches=False)
    alone = [unseen.decode(data) for _ in range(FEW)]  # from the second one on by its layout
    for block in unseen.together([data] * FEW):
        for place, n in enumerate(block.packets):
            assert _plain([block.arrival(place)], []) == _plain(*alone[n]), "read with others it says something else"
    for arrival in arrivals:
        assert arrival.values.shape == ((9, 9) if arrival.sensor == BIG else (2, 2))
        assert np.isfinite(arrival.values).all()
    _now += 0.05
    for clock, stamper in _stampers.items():
        before = stamper.at(_now - 0.05)
        times = [before] + [stamp.t for stamp in stamper.stamp(arrivals, _now) if not stamp.dropped]
        assert all(map(math.isfinite, times)), clock
        assert all(a <= b for a, b in zip(times[1:], times[2:], strict=False)), clock


def _plain(arrivals: list[Arrival], errors: list[ProtocolError]) -> object:
    frames = [(a.sensor, a.values.tobytes(), a.counter, a.timetag, a.touches) for a in arrivals]
    return frames, [(error.reason, str(error)) for error in errors]


class _Socket:
    """A client's socket of which `recv` gives one chunk after the other."""

    def __init__(self, chunks: list[bytes]) -> None:
        self._chunks = chunks
        self.sent: list[bytes] = []

    def recv(self, size: int) -> bytes:
        chunk = self._chunks.pop(0)
        assert len(chunk) <= size
        return chunk

    def send(self, line: bytes) -> int:
        self.sent.append(line)
        return len(line)

    def fileno(self) -> int:
        return 0


GESTURES = ("swipe_left", "one_tap")


class _Server:
    """Takes the place of EventServer: remembers what was asked for."""

    def __init__(self) -> None:
        self.subscribed: list[object] = []
        self.queued: list[Client] = []
        self.loop = self

    def add_reader(self, sock: object, read: object) -> None:
        """The reads are done by hand."""

    def remove_reader(self, sock: object) -> None:
        """The reads are done by hand."""

    def known(self) -> dict[str, tuple[str, ...]]:
        return {"gestures": GESTURES}

    def subscribe(self, client: object, subscription: object) -> None:
        self.subscribed.append(subscription)

    def queue(self, client: Client) -> None:
        client.turns += 1  # as many as it likes
        self.queued.append(client)


def request(data: bytes) -> None:
    """Lines of a client are answered one by one, however they are cut into chunks: the first bytes say how."""
    cuts, text = data[:8], data[8:]
    chunks, at = [], 0
    while at < len(text):
        size = 4 + 4 * cuts[len(chunks) % len(cuts)]  # at most what a reader asks for at once
        chunks.append(text[at : at + size])
        at += size
    *lines, _ = text.split(b"\n")
    wanted, refused = [], []
    for line in lines:
        try:
            wanted.append(parse_subscription(line, {"gestures": GESTURES}))
        except ProtocolError as error:
            assert error.reason == "subscription"
            refused.append(str(error))
    sock, server = _Socket(chunks), _Server()
    client = Client(cast(Any, server), cast(Any, sock))
    while chunks:
        client.turns = 2
        client.read()
        while server.queued:
            server.queued.pop().answer()
        assert len(client._request) <= MAX_LINE + 1
    assert server.subscribed == wanted
    answers = [json.loads(line) for line in sock.sent]
    assert [answer["type"] for answer in answers] == ["error"] * len(refused)
    long = ("a request has at most",)  # how many bytes it had is not known to a reader that keeps no more
    for answer, reason in zip(answers, refused, strict=True):
        assert answer["reason"] == reason or (answer["reason"].startswith(long) and reason.startswith(long))


@cache
def _touch() -> Segment:
    frames = np.zeros((6, 9, 9), np.float32)
    frames[range(6), 4, range(6)] = 100.0
    return Segment(frames, np.arange(6) / 15.0, 0, 5, 1.0)


def model(data: bytes) -> None:
    """A file opens, and then gives probabilities, or is refused with a reason."""
    try:
        with little_memory():
            opened = Model(data, "fuzzed")
    except ValueError as error:
        assert str(error)
        return
    try:
        with little_memory():
            scores = opened.classify(_touch())
    except ModelError:
        return  # the ladder's next rung answers
    assert abs(float(scores.values.sum()) - 1.0) <= 2e-3 and 0.0 <= scores.unknown <= 1.0


TARGETS: dict[str, Callable[[bytes], None]] = {"decoder": decoder, "request": request, "model": model}


def corpus(target: str) -> list[Path]:
    """The kept inputs of a target."""
    return sorted((CORPUS / target).iterdir())
