"""The reading of tapes, whose files may be cut off, damaged or hostile."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gestured.client.fields import wrong_field
from gestured.core.address import Address
from gestured.core.errors import RecordingError
from gestured.core.messages import json_object
from gestured.record.files import open_regular
from gestured.record.mcap import Budget, CutOff, Damaged, TooLarge, records
from gestured.record.tape import EVENTS, PACKETS, SCENE, Packet, Tape

ITEM_COSTS = 250  # bytes of memory for a packet or an event, besides what it holds
EVENT_COSTS = 24  # bytes of memory for a byte of JSON at worst, when it is all empty lists
LATEST_NS = 1 << 62  # of a packet, since 1970: a day in 2116, for which a clock here can still wait
NOBODY = Address("", 0)  # the source of a channel that holds no packets
HOST_CHARACTERS = 255  # of a sender's name; the DNS allows no more


def read(path: str | Path) -> Tape:
    """Read a file as far as it is good. Raises RecordingError for a file that is no tape or takes too much memory."""
    reading = _Reading()
    whole = True
    try:
        with open_regular(path) as file:
            budget = Budget(file)
            for record in records(file, budget):
                reading.take(record, budget)
            if file.read(1):
                raise _Wrong("holds more bytes after the end of its recording, expected one recording in a file")
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
    return Tape(reading.scene, tuple(reading.packets), tuple(reading.events), whole, tuple(reading.told))


class _Wrong(Exception):
    """Content that no tape of gestured has; the text says which, and what was expected."""


class _Reading:
    """The content of a tape that was read so far."""

    def __init__(self) -> None:
        self.scene: Mapping[str, Any] | None = None
        self.packets: list[Packet] = []
        self.events: list[Mapping[str, Any]] = []
        self.told: list[int] = []
        self._channels: dict[int, tuple[str, Address]] = {}  # topic, "" if it is not ours; source

    def take(self, record: Any, budget: Budget) -> None:
        """Take one record; unknown ones are skipped."""
        from mcap.records import Channel, Message, Metadata

        if isinstance(record, Message):
            self._message(record, budget)
        elif isinstance(record, Channel):
            topic = record.topic if record.topic in (PACKETS, EVENTS) else ""
            source = record.metadata.get("source") if topic == PACKETS else None
            self._channels[record.id] = topic, NOBODY if source is None else _source(source)
        elif isinstance(record, Metadata) and record.name == SCENE:
            self.scene = json_object(record.metadata.get("json", ""))
            if self.scene is None:
                raise _Wrong(f"metadata {SCENE!r}: expected a JSON object, as gesturectl record writes it")

    def _message(self, message: Any, budget: Budget) -> None:
        if message.channel_id not in self._channels:
            raise Damaged(f"a message of channel {message.channel_id}, which the file does not define")
        topic, source = self._channels[message.channel_id]
        data = message.data
        if topic == PACKETS:
            if message.log_time > LATEST_NS:
                place = len(self.packets) + 1
                raise _Wrong(f"packet {place}: expected a time up to {LATEST_NS} ns, found {message.log_time}")
            budget.spend(ITEM_COSTS + len(data))
            self.packets.append(Packet(message.log_time, source, data))
        elif topic == EVENTS:
            budget.spend(ITEM_COSTS + EVENT_COSTS * len(data))
            event = json_object(data)  # an event must be as sound as a daemon's line
            wrong = "expected a JSON object" if event is None else wrong_field(event)
            if event is None or wrong is not None:
                raise _Wrong(f"event {len(self.events) + 1}: {wrong}")
            self.events.append(event)
            self.told.append(len(self.packets))


def _source(text: str) -> Address:
    host = text.rpartition(":")[0]
    try:
        if len(host) <= HOST_CHARACTERS:
            return Address.parse(text)
    except ValueError:
        pass
    raise Damaged(f"a source {text[:40]!r}, expected HOST:PORT")
