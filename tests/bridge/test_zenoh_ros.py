"""Events as topics of ROS 2, heard through a real router by another implementation of rmw_zenoh's protocol: pyzeros."""

import argparse
import asyncio
import json
import queue
import socket
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest

from gestured.bridge.counts import Counts
from gestured.bridge.options import BridgeError
from gestured.bridge.zenoh_ros import Ros
from tests.bridge.conftest import emit, wait
from tests.bridge.test_mqtt import STATUS, gesture
from tests.bridge.zenoh_site import Site, opened
from tests.daemon.harness import DEADLINE_S, Daemon
from tests.sockets import HELLO

zenoh = pytest.importorskip("zenoh", reason="the bridge to Zenoh needs the extra [zenoh]")
pyzeros = pytest.importorskip("pyzeros", reason="a ROS 2 without ROS, from the extra [dev]")

from pyzeros import node as its_node  # noqa: E402  # after the skip
from pyzeros import pub as its_pub  # noqa: E402
from pyzeros.qos import QosProfile  # noqa: E402
from pyzeros.sub import RawSub  # noqa: E402
from ros2_pyterfaces.cyclone.all_msgs import String  # noqa: E402
from zenoh import ext  # noqa: E402

TYPE: tuple[str, str] = (pyzeros.utils.ros_type_to_dds_type(String.get_type_name()), String.hash_rihs01())


class Listener:
    """A ROS node that hears topics."""

    def __init__(self, site: Site, *topics: str, domain: int = 0) -> None:
        self.samples: queue.Queue[tuple[str, Any]] = queue.Queue()
        self._node = pyzeros.Node("listener", session=site.client, domain_id=domain)
        for topic in topics:
            RawSub(String, topic, partial(self._hear, topic), session=self._node, scope=None)

    def _hear(self, topic: str, sample: Any) -> None:
        self.samples.put((topic, sample))

    def message(self) -> tuple[str, dict[str, Any]]:
        """The next message's topic, and the event in it."""
        topic, sample = self.samples.get(timeout=DEADLINE_S)
        return topic, json.loads(String.deserialize(sample.payload.to_bytes()).data)


@pytest.fixture(autouse=True)
def loop() -> Iterator[None]:
    """A loop of asyncio, which its subscriptions belong to, though they call us from Zenoh's threads."""
    loop = asyncio.new_event_loop()
    asyncio.set_event_loop(loop)
    yield
    asyncio.set_event_loop(None)
    loop.close()


def begin(bridge: Any, site: Site, daemon: Any, *more: object, domain: str = "") -> Any:
    path = daemon.socket if isinstance(daemon, Daemon) else daemon.path
    arguments = ("zenoh", "--ros2", "--connect", site.endpoint, "--socket", path, *more)
    return bridge(*arguments, env={"ROS_DOMAIN_ID": domain})


@pytest.fixture
def tokens(site: Site) -> Iterator[set[str]]:
    """What the graph of ROS holds, but for its listeners."""
    held: set[str] = set()

    def see(sample: Any) -> None:
        if "/MS/" not in str(sample.key_expr):
            (held.add if sample.kind == zenoh.SampleKind.PUT else held.discard)(str(sample.key_expr))

    watch = site.client.liveliness().declare_subscriber("@ros2_lv/**", see, history=True)
    yield held
    watch.undeclare()


def test_a_real_daemons_events_are_heard_by_a_node(bridge, site, daemon: Daemon):
    listener = Listener(site, "/gestured/armrest/gesture")
    process = begin(bridge, site, daemon)
    process.ready()
    client = daemon.client()
    for name in ("swipe_left", "one_tap"):
        emit(daemon, name)
        line = client.events("gesture", "armrest")[-1]
        told = line | {"instance": client.hello["instance"]}
        assert listener.message() == ("/gestured/armrest/gesture", told)
    client.close()
    assert process.stop() == 0, process.said()


def test_names_domain_and_namespace(bridge, site, fake):
    """A sensor's name that ROS does not take is written as the node of deploy/ros2 writes it."""
    topic = "/xcar_2d7/gestured/xarmrest_2d1/gesture"
    listener = Listener(site, topic, domain=7)
    begin(bridge, site, fake, "--site", "car-7", domain="7")
    fake.accept()

    event = gesture(1) | {"sensor": "armrest-1"}
    wait(lambda: fake.say(event) or not listener.samples.empty())
    assert listener.message() == (topic, event | {"instance": HELLO["instance"]})


def test_the_graph_shows_node_and_topics_before_the_first_event(bridge, site, fake, tokens):
    process = begin(bridge, site, fake, "--types", "gesture,unknown")
    fake.accept()
    fake.say(STATUS)
    wait(lambda: len(tokens) == 4)
    _, domain, identity, *_ = next(iter(tokens)).split("/")
    it: dict[str, Any] = {"session": site.client, "domain_id": domain, "_zenoh_id": identity, "_node_id": 0}
    expected = {its_node.token_keyexpr("gestured", **it, _entity_id=0)}
    qualities = {
        "/gestured/status": "TRANSIENT_LOCAL",
        "/gestured/armrest/gesture": "VOLATILE",
        "/gestured/armrest/unknown": "VOLATILE",
    }
    for number, (topic, durability) in enumerate(qualities.items(), 1):
        quality = QosProfile(depth=1 if number == 1 else 10, durability=durability)
        names: dict[str, Any] = {"qos_profile": quality, "node_name": "gestured", "_entity_id": number}
        expected.add(its_pub.token_keyexpr(topic, *TYPE, **names | it))
    assert tokens == expected
    process.process.kill()
    wait(lambda: not tokens)


def test_who_comes_late_is_told_the_last_status(bridge, site, fake):
    """By Zenoh's own means, which rmw_zenoh uses for what is transient local."""
    process = begin(bridge, site, fake)
    fake.accept()
    process.ready()
    fake.say(STATUS)

    def states() -> list[str]:
        late = opened("client", connect=site.endpoint)
        found: queue.Queue[Any] = queue.Queue()
        key = "/".join(("0/gestured/status", *TYPE))
        history = ext.HistoryConfig(detect_late_publishers=True)
        hears = ext.declare_advanced_subscriber(late, key, found.put, history=history)
        sample = found.get(timeout=DEADLINE_S)
        hears.undeclare()
        late.close()
        line = json.loads(String.deserialize(sample.payload.to_bytes()).data)
        return [line["type"], line["state"], *line["sensors"]]

    wait(lambda: states() == ["status", STATUS["state"], "armrest"])
    fake.close()  # as after a kill of the daemon
    wait(lambda: states() == ["status", "gone"])


def test_an_attachment_counts_dates_and_names_its_publisher(bridge, site, fake):
    listener = Listener(site, "/gestured/armrest/gesture")
    process = begin(bridge, site, fake)
    fake.accept()
    process.ready()
    before = time.time_ns()
    fake.say(*(gesture(n) for n in (1, 2, 3)))
    found = [listener.samples.get(timeout=DEADLINE_S)[1].attachment for _ in range(3)]
    parts = [ext.z_deserialize(tuple[ext.Int64, ext.Int64, bytes], one) for one in found]
    assert [int(number) for number, _, _ in parts] == [1, 2, 3]
    times = [int(stamp) for _, stamp, _ in parts]
    assert before <= times[0] <= times[1] <= times[2] <= time.time_ns()
    assert len({name for _, _, name in parts}) == 1 and len(parts[0][2]) == 16


@pytest.mark.parametrize("text", ["abc", "-1", "233", "1000000", "²"])
def test_a_domain_that_ros_does_not_have_is_refused(text: str, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with socket.create_server(("127.0.0.1", 0)) as router:
        endpoint = f"tcp/127.0.0.1:{router.getsockname()[1]}"
        fields = {"connect": [endpoint], "config": None, "site": None, "frames": False, "ros2": True}
        args = argparse.Namespace(**fields, sensors=None, gestures=None, types=["gesture"], to=None)
        with pytest.raises(BridgeError, match=f"ROS_DOMAIN_ID={text}: expected a number from 0 to 232"):
            Ros(args, Counts("zenoh"))


def test_frames_of_ros_are_not_taken(bridge, site, fake):
    process = begin(bridge, site, fake, "--frames")
    assert process.end() == 2
    assert "--ros2: not allowed with argument --frames" in process.said() or "--frames: not allowed" in process.said()
