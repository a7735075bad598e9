"""`gestured-bridge zenoh --ros2`: events as topics of ROS 2, for nodes with the middleware rmw_zenoh.

/gestured/{sensor}/gesture    std_msgs/String: the event in JSON as on the socket; reliable, the last 10
/gestured/status              std_msgs/String: the daemon's `status`, or `gone`; reliable and transient local

`--site NAME` puts /NAME in front. Keys, liveliness tokens and attachments are those of rmw_zenoh 0.2.4 and later (its
docs/design.md and liveliness_utils.cpp); the payload is CDR. This machine needs no ROS.
"""

import argparse
import hashlib
import os
import struct
import time
from itertools import count
from typing import Any

from gestured.bridge.counts import Counts
from gestured.bridge.daemon import GONE, MOST_SENSORS, Line
from gestured.bridge.options import STATUS, BridgeError
from gestured.bridge.ros_names import token
from gestured.bridge.zenoh_session import Zenoh

STRING = "std_msgs::msg::dds_::String_"  # the type std_msgs/String; STRING_HASH is the hash of its definition
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
# Quality of service as rmw_zenoh writes it: the differences from its default (reliable, volatile, the last 42).
LAST_TEN, LATEST = "::,10:,:,:,,", ":1:,1:,:,:,,"
HEARTBEAT_S = 0.5  # a subscriber that missed the latest status learns so within this time, as in rmw_zenoh
MOST_DOMAIN = 232  # the largest ROS_DOMAIN_ID


class Ros(Zenoh):
    """One daemon's events as the topics of a ROS 2 node called `gestured`."""

    def __init__(self, args: argparse.Namespace, counts: Counts) -> None:
        """Raises BridgeError for arguments that cannot be used."""
        super().__init__(args, counts)
        self._domain = _domain(os.environ.get("ROS_DOMAIN_ID") or "0")
        self._namespace = f"/{token(args.site)}" if args.site else ""
        self._types = [kind for kind in args.types if kind != STATUS]
        self._topics: dict[tuple[str, str], _Topic] = {}  # by sensor and type of event
        self._numbers = count(1)  # the numbers of this node's publishers
        self._status: Line = _gone()

    def take(self, line: Line) -> None:
        """Take one line of `follow`."""
        super().take(line)
        if line["type"] in (STATUS, GONE):
            self._status = line if line["type"] == STATUS else _gone()
            if self._session is not None:
                self._put({**self._status, "sensor": ""}, self._daemon.payload(self._status))

    def _serve(self, session: Any) -> None:
        """Answer no queries, since nodes of ROS 2 only subscribe to topics."""

    def _announce(self) -> None:
        """Announce the node and its topics; a sensor's before its first event, so that this finds subscribers."""
        if not self._topics:
            self._tokens["node"] = self._session.liveliness().declare_token(self._entity("0", "NN"))
            self._topic("", STATUS).publish(self._daemon.payload(self._status))
        for sensor in self._daemon.states:
            for kind in self._types:
                self._topic(sensor, kind)
        if len(self._topics) > MOST_SENSORS:  # any sender of frames can invent names of sensors
            for sensor, kind in [key for key in self._topics if key[0] and key[0] not in self._daemon.states]:
                self._topics.pop((sensor, kind)).close()

    def _put(self, event: Line, data: bytes) -> None:
        with self._holding:
            self._topic(event["sensor"], event["type"]).publish(data)

    def _topic(self, sensor: str, kind: str) -> "_Topic":
        """The topic for a type of event of a sensor, made if it is new; without a sensor, that of the status."""
        if (sensor, kind) not in self._topics:
            path = "/".join((self._namespace, "gestured", *([token(sensor)] if sensor else []), kind))
            quality = LAST_TEN if sensor else LATEST
            named = (path.replace("/", "%"), STRING, STRING_HASH, quality)
            entity = self._entity(str(next(self._numbers)), "MP", *named)
            key = f"{self._domain}{path}/{STRING}/{STRING_HASH}"
            self._topics[sensor, kind] = _Topic(self._session, key, entity, keeps_latest=quality == LATEST)
        return self._topics[sensor, kind]

    def _entity(self, number: str, kind: str, *topic: str) -> str:
        """The liveliness token of the node (kind `NN`, number 0) or of a publisher (`MP`)."""
        identity = ("@ros2_lv", str(self._domain), str(self._session.zid()), "0", number)
        return "/".join((*identity, kind, "%", self._namespace.replace("/", "%") or "%", "gestured", *topic))


class _Topic:
    """A publisher of std_msgs/String."""

    def __init__(self, session: Any, key: str, entity: str, keeps_latest: bool) -> None:
        import zenoh
        from zenoh import ext

        self._publisher: Any
        if keeps_latest:
            self._publisher = ext.declare_advanced_publisher(
                session,
                key,
                cache=ext.CacheConfig(1),
                publisher_detection=True,
                sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT_S),
            )
        else:
            self._publisher = session.declare_publisher(key, reliability=zenoh.Reliability.RELIABLE)
        self._token = session.liveliness().declare_token(entity)
        # A publisher's identity may be any 16 bytes that no other has; rmw_zenoh uses XXH3, which Python lacks.
        self._identity = hashlib.blake2b(entity.encode(), digest_size=16).digest()
        self._count = 0

    def publish(self, text: bytes) -> None:
        """Publish a text in UTF-8 as little-endian CDR: its length, the text, and a zero byte."""
        self._count += 1
        attachment = struct.pack("<qqB", self._count, time.time_ns(), len(self._identity)) + self._identity
        data = struct.pack("<4sI", b"\x00\x01\x00\x00", len(text) + 1) + text + b"\x00"
        self._publisher.put(data, attachment=attachment)

    def close(self) -> None:
        """Tell the network that this topic has ended."""
        self._token.undeclare()
        self._publisher.undeclare()


def _gone() -> Line:
    """The status while no daemon is there."""
    return {"type": STATUS, "state": GONE, "sensors": {}, "time": time.time()}


def _domain(text: str) -> int:
    """The number of the ROS domain that ROS_DOMAIN_ID names. Raises BridgeError."""
    if not (text.isascii() and text.isdigit() and len(text) <= 3 and int(text) <= MOST_DOMAIN):
        raise BridgeError(f"ROS_DOMAIN_ID={text}: expected a number from 0 to {MOST_DOMAIN}")
    return int(text)
