"""Frames and gestures in an MCAP file as ROS 2 has them, so that rosbag2 plays it and viewers draw it.

`/{sensor}/pressure` holds each frame as `sensor_msgs/msg/Image` (32FC1: counts), `/{sensor}/gesture` each gesture as
`std_msgs/msg/String` (the event's JSON). Messages are CDR (OMG's Common Data Representation, little-endian), schemas
`ros2msg`: mcap.dev/spec/registry, profile `ros2`.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gestured.core.errors import RecordingError
from gestured.core.frames import Frame
from gestured.record.files import atomic_write

IMAGE, STRING = "sensor_msgs/msg/Image", "std_msgs/msg/String"
RULE = "=" * 80
SCHEMAS = {
    IMAGE: f"""\
std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
{RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
""",
    STRING: "string data\n",
}
ENCODING = "32FC1"  # one float32 a taxel


class Cdr:
    """The bytes of one message; each number stands at a multiple of its size."""

    def __init__(self) -> None:
        self._data = bytearray()

    def number(self, form: str, value: int) -> "Cdr":
        """`form` as in struct: B, i or I."""
        self._data += bytes(-len(self._data) % struct.calcsize(form)) + struct.pack("<" + form, value)
        return self

    def text(self, value: str) -> "Cdr":
        """A string, with its length and a zero at its end."""
        data = value.encode() + b"\0"
        self.number("I", len(data))
        self._data += data
        return self

    def raw(self, value: bytes) -> "Cdr":
        """A sequence of bytes."""
        self.number("I", len(value))
        self._data += value
        return self

    def message(self) -> bytes:
        """With the header that says: little-endian CDR."""
        return b"\0\1\0\0" + bytes(self._data)


def image(sensor: str, frame: Frame) -> bytes:
    """A frame; its time is in seconds since the epoch."""
    rows, columns = frame.values.shape
    t_ns = nanoseconds(frame.t)
    cdr = Cdr().number("i", t_ns // 10**9).number("I", t_ns % 10**9).text(sensor)
    cdr.number("I", rows).number("I", columns).text(ENCODING).number("B", 0).number("I", 4 * columns)
    return cdr.raw(frame.values.astype("<f4").tobytes()).message()


def nanoseconds(t: float) -> int:
    """Seconds since the epoch in the unit of MCAP and ROS."""
    return round(t * 1e6) * 1000  # a float64 since 1970 knows no nanoseconds


def write(path: Path, sessions: Mapping[str, Sequence[Frame]], events: Sequence[Mapping[str, Any]]) -> None:
    """A file with the frames of each sensor, at times since the epoch, and these gestures.

    Raises RecordingError where it cannot be written; then nothing has changed.
    """
    from mcap.writer import Writer  # who exports nothing need not wait for it

    found = [(nanoseconds(frame.t), sensor, frame) for sensor, frames in sessions.items() for frame in frames]
    told = [(nanoseconds(event.get("decided", event["offset"])), event["sensor"], event) for event in events]
    try:
        with atomic_write(path) as file:
            writer: Any = Writer(file)
            writer.start(profile="ros2", library="gestured")
            schemas = {name: writer.register_schema(name, "ros2msg", text.encode()) for name, text in SCHEMAS.items()}

            def channel(topic: str, schema: str) -> int:
                number: int = writer.register_channel(topic, "cdr", schemas[schema], {"offered_qos_profiles": ""})
                return number

            pressure = {sensor: channel(f"/{sensor}/pressure", IMAGE) for sensor in sessions}
            gestures = {sensor: channel(f"/{sensor}/gesture", STRING) for sensor in sorted({e[1] for e in told})}
            for t_ns, sensor, what in sorted([*found, *told], key=lambda each: each[0]):
                if isinstance(what, Frame):
                    writer.add_message(pressure[sensor], t_ns, image(sensor, what), t_ns)
                else:
                    writer.add_message(gestures[sensor], t_ns, Cdr().text(json.dumps(what)).message(), t_ns)
            writer.finish()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error
