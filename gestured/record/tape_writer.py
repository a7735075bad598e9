"""The writing of tapes."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from gestured.core.errors import RecordingError
from gestured.record.files import create
from gestured.record.tape import EVENT_SCHEMA, EVENTS, PACKETS, SCENE

CHUNK_BYTES = 1 << 20  # bytes that are written at a time, unless a flush comes before
MESSAGE_BYTES = 32  # of the file for a message, besides its content: its header, and its place in the index
SENDER_CHANNELS = 256  # senders that have a channel of their own; all later ones share one


class Writer:
    """Writes a new file; a context manager. Raises RecordingError if it cannot be made, or exists."""

    def __init__(self, path: Path, scene: Mapping[str, Any], limit_bytes: int) -> None:
        """Make the file with `scene` as its metadata; `full` tells when it has about `limit_bytes`."""
        from mcap.writer import Writer as Mcap  # a slow import, which only recording needs

        self.path, self.limit_bytes = path, limit_bytes
        try:
            self._file = create(path)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be made: {error.strerror}") from error
        self._mcap: Any = Mcap(self._file, chunk_size=CHUNK_BYTES)
        self._senders: dict[str, int] = {}
        self._waiting = 0  # bytes that are not in the file yet
        self._broken = False  # whether the file took no more
        self._good = ""  # what an error then says of the file
        try:
            with self._writing():
                self._mcap.start(profile="gestured", library="gestured")
                self._mcap.add_metadata(SCENE, {"json": json.dumps(scene)})
                schema = self._mcap.register_schema("gestured.Event", "jsonschema", json.dumps(EVENT_SCHEMA).encode())
                self._events = self._mcap.register_channel(EVENTS, "json", schema)
            self.flush()
        except RecordingError:  # an empty file that stays would make the next attempt fail
            self.close()
            path.unlink()
            raise

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
        """Put what was kept so far onto the disk, where it survives a crash and a power cut."""
        with self._writing():
            self._mcap.flush()
            os.fsync(self._file.fileno())
        self._waiting, self._good = 0, "; good up to there"

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._broken = True
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}{self._good}") from error

    def _add(self, channel: int, t_ns: int, data: bytes) -> None:
        with self._writing():  # a chunk that is full is written now
            self._mcap.add_message(channel, t_ns, data, t_ns)
        self._waiting += len(data) + MESSAGE_BYTES

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
            with suppress(OSError):  # the error was raised before
                self._file.close()

    def __enter__(self) -> "Writer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
