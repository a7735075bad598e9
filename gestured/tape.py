"""Tapes: packets as a daemon received them and the events that it made of them, in an MCAP file (mcap.dev).

`/gestured/packets` holds each datagram as it came (message encoding `osc`; one channel for each sender, its address in
the channel's metadata), `/gestured/events` the lines of the event stream (JSON, with a schema). The log time is when
the daemon read it, in nanoseconds since the epoch; packets of one read have one time. The metadata record `scene` says
with which model and settings. So a tape replays through the same code to the same events.

For the eye `/{sensor}/pressure` holds each frame once more, as a picture that robotics tools draw (foxglove.RawImage in
JSON, docs.foxglove.dev/docs/visualization/message-schemas/raw-image); nothing is ever read back from there.

A tape is written once, never changed, and is good up to its last whole chunk, wherever writing was cut off. The mcap
library comes with the extra `[record]`.
"""

import base64
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from numpy.typing import NDArray

from gestured.core.errors import RecordingError
from gestured.files import create

PACKETS, EVENTS, SCENE = "/gestured/packets", "/gestured/events", "scene"
RECORD_BYTES = 64 << 20  # of one record of a file that somebody gave us
CHUNK_BYTES = 1 << 20
SENDERS = 256  # channels; whoever comes after that shares one
EVENT_SCHEMA = {
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

IMAGE_SCHEMA = {
    "title": "foxglove.RawImage",
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "frame_id": {"type": "string"},
        "width": {"type": "integer"},
        "height": {"type": "integer"},
        "encoding": {"type": "string"},
        "step": {"type": "integer"},
        "data": {"type": "string", "contentEncoding": "base64"},
    },
}


@dataclass(frozen=True, slots=True)
class Packet:
    """A datagram."""

    t_ns: int  # when the daemon read it, since the epoch
    source: tuple[str, int]
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
        import mcap.exceptions
        import mcap.records
        import mcap.stream_reader
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
            raise RecordingError(f"{path}: cannot be made: {error.strerror}") from None
        self._mcap = mcap.writer.Writer(self._file, chunk_size=CHUNK_BYTES)
        self._mcap.start(profile="gestured", library="gestured")
        self._mcap.add_metadata(SCENE, {"json": json.dumps(scene)})
        schema = self._mcap.register_schema("gestured.Event", "jsonschema", json.dumps(EVENT_SCHEMA).encode())
        self._events = self._mcap.register_channel(EVENTS, "json", schema)
        self._image = self._mcap.register_schema("foxglove.RawImage", "jsonschema", json.dumps(IMAGE_SCHEMA).encode())
        self._senders: dict[str, int] = {}
        self._pictures: dict[str, int] = {}
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
            source = source if len(self._senders) < SENDERS else "other:0"
            if source not in self._senders:
                self._senders[source] = self._mcap.register_channel(PACKETS, "osc", 0, {"source": source})
        self._add(self._senders[source], t_ns, data)

    def picture(self, t_ns: int, sensor: str, values: NDArray[Any]) -> None:
        """Keep a frame, (R, C) counts, for viewers; of the first SENDERS sensors."""
        if sensor not in self._pictures:
            if len(self._pictures) >= SENDERS:
                return
            self._pictures[sensor] = self._mcap.register_channel(f"/{sensor}/pressure", "json", self._image)
        rows, columns = values.shape
        picture = {
            "timestamp": {"sec": t_ns // 10**9, "nsec": t_ns % 10**9},
            "frame_id": sensor,
            "width": columns,
            "height": rows,
            "encoding": "32FC1",
            "step": 4 * columns,
            "data": base64.b64encode(values.astype("<f4").tobytes()).decode(),
        }
        self._add(self._pictures[sensor], t_ns, json.dumps(picture).encode())

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
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}; good up to there") from None

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
    """Read a file, as far as it is good. Raises RecordingError for what is no tape."""
    mcap = library()
    scene: Mapping[str, Any] | None = None
    channels: dict[int, tuple[str, tuple[str, int]]] = {}
    packets: list[Packet] = []
    events: list[Mapping[str, Any]] = []
    whole = True
    try:
        with open(path, "rb") as file:
            for record in _records(mcap, file):
                if isinstance(record, mcap.records.Channel):
                    channels[record.id] = record.topic, _source(record.metadata.get("source", ":0"))
                elif isinstance(record, mcap.records.Metadata) and record.name == SCENE:
                    scene = json.loads(record.metadata["json"])
                elif isinstance(record, mcap.records.Message):
                    topic, source = channels[record.channel_id]
                    if topic == PACKETS:
                        packets.append(Packet(record.log_time, source, bytes(record.data)))
                    elif topic == EVENTS:
                        events.append(json.loads(record.data))
    except mcap.exceptions.EndOfFile:
        whole = False
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception as error:  # of a damaged file the library raises a dozen types
        if scene is None:
            raise RecordingError(
                f"{path}: is no recording of gesturectl (MCAP): {error or type(error).__name__}"
            ) from None
        whole = False
    if not isinstance(scene, dict):
        raise RecordingError(f"{path}: has no metadata {SCENE!r}, expected a recording of gesturectl")
    return Tape(scene, tuple(packets), tuple(events), whole)


def _records(mcap: Any, file: IO[bytes]) -> Iterator[Any]:
    reader = mcap.stream_reader.StreamReader(file, emit_chunks=True, record_size_limit=RECORD_BYTES)
    for record in reader.records:
        if not isinstance(record, mcap.records.Chunk):
            yield record
        elif record.uncompressed_size > RECORD_BYTES:
            raise ValueError(f"a chunk unpacks to {record.uncompressed_size} bytes, expected at most {RECORD_BYTES}")
        else:
            yield from mcap.stream_reader.breakup_chunk(record, validate_crc=True)


def _source(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    return host, int(port)
