"""Tapes: packets as a daemon received them and the events that it made of them, in an MCAP file (mcap.dev).

`/gestured/packets` holds each datagram as it came (message encoding `osc`; one channel for each sender, its address in
the channel's metadata), `/gestured/events` the lines of the event stream (JSON, with a schema). The log time is when
the daemon read it, in nanoseconds since the epoch; packets of one read have one time. The metadata record `scene` says
with which model and settings. So a tape replays through the same code to the same events.

For the eye of others `gesturectl export --ros2` makes a file with pictures (ros2.py).

A tape is written once, never changed, and is good up to its last whole chunk, wherever writing was cut off. The mcap
library comes with the extra `[record]`.
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gestured.core.address import Address
from gestured.core.errors import RecordingError
from gestured.record.files import create, open_regular
from gestured.record.mcap import CHANNEL, MESSAGE, METADATA, Budget, CutOff, Damaged, Fields, TooLarge, records

PACKETS, EVENTS, SCENE = "/gestured/packets", "/gestured/events", "scene"
TEXT_BYTES = 8 << 20  # of one channel or metadata record that is read; a scene may hold a user's own gestures
ITEM_COSTS = 250  # bytes of memory for a packet or an event, besides what it holds
EVENT_COSTS = 24  # bytes of memory for a byte of JSON, where it is all empty lists
NOBODY = Address("", 0)  # the source of a channel that holds no packets
HOST_CHARACTERS = 255  # of a sender's name; the DNS allows no more
LARGEST_NUMBER = 1e11  # of any number in an event; as seconds since 1970 it is a date that Python can print
CHUNK_BYTES = 1 << 20
SENDER_CHANNELS = 256  # channels; whoever comes after that shares one
EVENT_SCHEMA: dict[str, Any] = {
    "title": "gestured.Event",
    "type": "object",
    "properties": {
        "type": {"type": "string"},
        "sensor": {"type": "string"},
        "id": {"type": "integer"},
        "gesture": {"type": "string"},
        "confidence": {"type": "number"},
        "onset": {"type": "number"},
        "offset": {"type": "number"},
        "decided": {"type": "number"},
        "model": {"type": "string"},
        "reason": {"type": "string"},
    },
    "required": ["type"],
}
FORMS: dict[str, str] = {key: form["type"] for key, form in EVENT_SCHEMA["properties"].items()}
# What an event of a type says at least.
NEEDED = {
    "onset": ("sensor", "id", "onset"),
    "provisional": ("sensor", "id", "gesture", "confidence", "onset", "decided"),
    "gesture": ("sensor", "id", "gesture", "confidence", "onset", "offset"),
    "unknown": ("sensor", "id", "confidence", "onset", "offset"),
    "cancelled": ("sensor", "id", "reason"),
    "release": ("sensor", "id"),
}


@dataclass(frozen=True, slots=True)
class Packet:
    """A datagram."""

    t_ns: int  # when the daemon read it, since the epoch
    source: Address
    data: bytes


@dataclass(frozen=True, slots=True)
class Tape:
    """What a file holds, in the order of writing. `whole` is false where writing was cut off."""

    scene: Mapping[str, Any]
    packets: tuple[Packet, ...]
    events: tuple[Mapping[str, Any], ...]
    whole: bool


def library() -> Any:
    """The mcap package; RecordingError says how to get it."""
    try:
        import mcap.writer
    except ImportError:
        raise RecordingError("recordings need the mcap package: pip install 'gestured[record]'") from None
    return mcap


class Writer:
    """Writes a new file; a context manager. Raises RecordingError where it cannot be made, or exists."""

    def __init__(self, path: Path, scene: Mapping[str, Any], limit_bytes: int) -> None:
        """Never more than about `limit_bytes` (what is written before the limit stays good)."""
        mcap = library()
        self.path, self.limit_bytes = path, limit_bytes
        try:
            self._file = create(path)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be made: {error.strerror}") from error
        self._mcap = mcap.writer.Writer(self._file, chunk_size=CHUNK_BYTES)
        self._mcap.start(profile="gestured", library="gestured")
        self._mcap.add_metadata(SCENE, {"json": json.dumps(scene)})
        schema = self._mcap.register_schema("gestured.Event", "jsonschema", json.dumps(EVENT_SCHEMA).encode())
        self._events = self._mcap.register_channel(EVENTS, "json", schema)
        self._senders: dict[str, int] = {}
        self._waiting = 0  # bytes that are not in the file yet
        self._broken = False  # the file took no more
        self.flush()

    @property
    def full(self) -> bool:
        """Whether the limit is reached."""
        return self._file.tell() + self._waiting >= self.limit_bytes

    def packet(self, t_ns: int, source: str, data: bytes) -> None:
        """Keep a datagram of `source` (HOST:PORT)."""
        if source not in self._senders:
            source = source if len(self._senders) < SENDER_CHANNELS else "other:0"
            if source not in self._senders:
                self._senders[source] = self._mcap.register_channel(PACKETS, "osc", 0, {"source": source})
        self._add(self._senders[source], t_ns, data)

    def event(self, t_ns: int, event: Mapping[str, Any]) -> None:
        """Keep an event, as the event stream had it."""
        self._add(self._events, t_ns, json.dumps(event).encode())

    def flush(self) -> None:
        """From here on, what was kept so far survives a crash and a power cut."""
        with self._writing():
            self._mcap.flush()
            os.fsync(self._file.fileno())
        self._waiting = 0

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._broken = True
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}; good up to there") from error

    def _add(self, channel: int, t_ns: int, data: bytes) -> None:
        with self._writing():  # a chunk that is full is written now
            self._mcap.add_message(channel, t_ns, data, t_ns)
        self._waiting += len(data) + 32

    def close(self) -> None:
        """Write the index, and close. A file that took no more is closed as it is."""
        if self._file.closed:
            return
        try:
            if not self._broken:
                with self._writing():
                    self._mcap.finish()
                    self._file.flush()
        finally:
            with suppress(OSError):  # what was refused before is refused again
                self._file.close()

    def __enter__(self) -> "Writer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read(path: str | Path) -> Tape:
    """Read a file, as far as it is good. Raises RecordingError for what is no tape, and for what wants to be larger."""
    library()
    reading = _Reading()
    whole = True
    try:
        with open_regular(path) as file:
            budget = Budget(file)
            for opcode, content in records(file, budget):
                reading.take(opcode, content, budget)
    except CutOff:
        whole = False
    except Damaged as error:
        if reading.scene is None:
            raise RecordingError(f"{path}: is no recording of gesturectl (MCAP): {error}") from error
        whole = False
    except (_Wrong, TooLarge) as error:
        raise RecordingError(f"{path}: {error}") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    if reading.scene is None:
        raise RecordingError(f"{path}: has no metadata {SCENE!r}, expected a recording of gesturectl (MCAP)")
    return Tape(reading.scene, tuple(reading.packets), tuple(reading.events), whole)


class _Wrong(Exception):
    """What a tape says that no tape of ours does."""


class _Reading:
    """What was found so far."""

    def __init__(self) -> None:
        self.scene: Mapping[str, Any] | None = None
        self.packets: list[Packet] = []
        self.events: list[Mapping[str, Any]] = []
        self._channels: dict[int, tuple[str, Address]] = {}  # topic, "" where we do not know it; source

    def take(self, opcode: int, content: bytes, budget: Budget) -> None:
        """One record; what we do not know is passed over."""
        if opcode == MESSAGE:
            self._message(content, budget)
        elif opcode in (CHANNEL, METADATA):
            if len(content) > TEXT_BYTES:
                raise Damaged(f"a channel or metadata of {len(content)} bytes, expected at most {TEXT_BYTES}")
            fields = Fields(content)
            if opcode == CHANNEL:
                self._channel(fields)
            elif fields.text() == SCENE:
                self.scene = _scene(fields.pairs())

    def _channel(self, fields: Fields) -> None:
        number, _ = fields.take("<HH")
        topic, _ = fields.text(), fields.text()
        topic = topic if topic in (PACKETS, EVENTS) else ""
        source = fields.pairs().get("source") if topic == PACKETS else None
        self._channels[number] = topic, NOBODY if source is None else _source(source)

    def _message(self, content: bytes, budget: Budget) -> None:
        fields = Fields(content)
        number, _, t_ns, _ = fields.take("<HIQQ")
        if number not in self._channels:
            raise Damaged(f"a message of channel {number}, which there is not")
        topic, source = self._channels[number]
        data = fields.rest() if topic else b""
        if topic == PACKETS:
            budget.keep(ITEM_COSTS + len(data))
            self.packets.append(Packet(t_ns, source, data))
        elif topic == EVENTS:
            budget.keep(ITEM_COSTS + EVENT_COSTS * len(data))
            self.events.append(_event(data, len(self.events) + 1))


def _scene(metadata: Mapping[str, str]) -> Mapping[str, Any]:
    try:
        found = json.loads(metadata["json"])
    except (KeyError, ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise _Wrong(f"metadata {SCENE!r}: expected a JSON object, as gesturectl record writes it")
    return found


def _event(line: bytes, number: int) -> Mapping[str, Any]:
    """A line of the event stream, held against what is asked of events later; what it says besides is left alone."""
    try:
        event = json.loads(line)
    except (ValueError, RecursionError):
        event = None
    if not isinstance(event, dict):
        raise _Wrong(f"event {number}: expected a JSON object")
    needed = ("type", *NEEDED.get(str(event.get("type")), ()))
    for key, form in FORMS.items():
        if (key in event or key in needed) and not _right(form, event.get(key)):
            raise _Wrong(f"event {number}: expected {key} to be of the type {form}, found {_brief(event.get(key))}")
    return event


def _right(form: str, value: object) -> bool:
    if form == "string":
        return isinstance(value, str)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= LARGEST_NUMBER and (form == "number" or isinstance(value, int))  # so NaN is none


def _brief(value: object) -> str:
    return repr(value)[:40]


def _source(text: str) -> Address:
    host, _, port = text.rpartition(":")
    if ":" in host and not host.startswith("["):  # as it stands in tapes of before 0.1.0
        text = f"[{host}]:{port}"
    try:
        if len(host) <= HOST_CHARACTERS:
            return Address.parse(text)
    except ValueError:
        pass
    raise Damaged(f"a source {text[:40]!r}, expected HOST:PORT")
