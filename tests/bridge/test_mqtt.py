"""Events at a real broker: what is published, retained and cleared, and what happens when somebody goes."""

import json
import os
import queue
import select
import shutil
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from gestured.bridge import daemon as known
from gestured.bridge.counts import Counts
from gestured.bridge.retained import Retained
from gestured.client.subscriber import Subscriber
from tests.bridge.conftest import Broker, Process, emit, guarded, page, wait
from tests.daemon.harness import DEADLINE_S, Daemon
from tests.several import several
from tests.sockets import HELLO, FakeDaemon

paho = pytest.importorskip("paho.mqtt.client", reason="the bridge to MQTT needs the extra [mqtt]")

STATUS = {"type": "status", "state": "ok", "sensors": {"armrest": "ok"}, "model": "m", "time": 1.0}


def gesture(sequence: int, name: str = "one_tap", **more: Any) -> dict[str, Any]:
    """A gesture as a daemon says it; made up by `gesturectl emit`, and so never too old, unless `decided` is named."""
    now, made_up = time.time(), {} if "decided" in more else {"test": True}
    return {
        "type": "gesture", "sensor": "armrest", "id": sequence, "gesture": name, "confidence": 0.9,
        "sequence": sequence, "onset": now, "offset": now, "decided": now,
        "frames": 3, "lost": 0, "model": "m", "degraded": False, "scores": {name: 0.9},
    } | made_up | more  # fmt: skip


MAD = (  # what no daemon says
    {"type": ["gesture"]}, {"type": "gestures", "gestures": 7}, {"type": "status", "sensors": ["armrest"]},
    STATUS | {"sensors": {"#": "ok"}}, gesture(1, decided="soon"), gesture(1, decided=float("nan")),
    gesture(1, decided=10**400), gesture(1) | {"sensor": "**"}, gesture(1) | {"type": "x/#"},
)  # fmt: skip


class Listener:
    """A client of its own make, with MQTT 5."""

    def __init__(self, port: int, *topics: str, login: tuple[str | None, str | None] = (None, None)) -> None:
        self._messages: queue.Queue[Any] = queue.Queue()
        subscribed: queue.Queue[bool] = queue.Queue()
        self.client = paho.Client(paho.CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        self.client.on_message = lambda _, __, message: self._messages.put(message)
        self.client.on_subscribe = lambda *_: subscribed.put(True)
        self.client.username_pw_set(*login)
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()
        for topic in topics:
            self.client.subscribe(topic, qos=1)
            subscribed.get(timeout=DEADLINE_S)

    def next(self) -> Any:
        """The next message."""
        return self._messages.get(timeout=DEADLINE_S)

    def until(self, topic: str, payload: str | None = None) -> Any:
        """The next message under a topic (with a payload)."""
        while True:
            message = self.next()
            if message.topic == topic and payload in (None, message.payload.decode()):
                return message

    def events(self, count: int) -> list[dict[str, Any]]:
        """The next events."""
        return [json.loads(self.until("gestured/car/armrest/gesture").payload) for _ in range(count)]

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()


@pytest.fixture
def listen() -> Iterator[Callable[..., Listener]]:
    yield from several(Listener, Listener.close)


@pytest.fixture
def at(broker: Callable[..., Broker]) -> Broker:
    """One that lets everybody in."""
    return broker()


def begin(bridge: Callable[..., Process], broker: Broker, daemon: Any, *more: object, **options: Any) -> Process:
    """A bridge of the machine `car`."""
    path = daemon.path if isinstance(daemon, FakeDaemon) else daemon.socket
    return bridge("mqtt", "--broker", broker.address, "--socket", path, "--host", "car", *more, **options)


def started(bridge: Callable[..., Process], broker: Broker, fake: FakeDaemon, *more: object) -> Process:
    """A bridge between a broker and a scripted daemon, connected to both."""
    process = begin(bridge, broker, fake, *more)
    fake.accept()
    assert process.ready()["host"] == "car"
    return process


def retained(listen: Callable[..., Listener], broker: Broker, topics: str = "#") -> dict[str, str]:
    """What a subscriber gets who comes now: all that the broker retains."""
    listener = listen(broker.port, topics)
    end = f"end/{id(listener)}"
    listener.client.subscribe(end, qos=1)
    listener.client.publish(end, b"", qos=1)
    found = {}
    while (message := listener.next()).topic != end:
        if message.retain:
            found[message.topic] = message.payload.decode()
    return found


def test_a_real_daemons_events_arrive_and_none_is_retained(bridge, at, listen, daemon: Daemon):
    listener = listen(at.port, "gestured/#")
    assert begin(bridge, at, daemon).ready() | {"metrics": None} == {
        "type": "ready", "bridge": "mqtt", "broker": at.address, "host": "car", "metrics": None,
    }  # fmt: skip
    client = daemon.client()
    for name in ("swipe_left", "one_tap"):
        emit(daemon, name)
        line = client.events("gesture", "armrest")[-1]
        message = listener.until("gestured/car/armrest/gesture")
        assert json.loads(message.payload) == line | {"instance": client.hello["instance"]}
        assert (message.qos, message.retain) == (1, False)
        assert message.properties.MessageExpiryInterval == 1
    client.close()
    found = retained(listen, at)
    assert found["gestured/car/availability"] == "online"
    assert not [topic for topic in found if topic.endswith("/gesture")]


def test_sensors_states_are_retained_and_follow_the_daemon(bridge, at, listen, fake: FakeDaemon):
    listener = listen(at.port, "gestured/car/#")
    started(bridge, at, fake)
    listener.until("gestured/car/armrest/state", "no_data")
    fake.say(STATUS)
    listener.until("gestured/car/armrest/state", "ok")
    silent = {"armrest": {"armed": None, "closed": ["seat"], "until": None}}
    fake.say(STATUS | {"sensors": {"armrest": "stale", "door": "starting"}, "gates": silent})
    listener.until("gestured/car/armrest/state", "stale")
    listener.until("gestured/car/door/state", "starting")
    listener.until("gestured/car/door/gates")
    found = retained(listen, at, "gestured/#")
    assert found == {
        "gestured/car/availability": "online",
        "gestured/car/armrest/state": "stale",
        "gestured/car/door/state": "starting",
        "gestured/car/armrest/gates": '{"armed": null, "closed": ["seat"], "until": null}',
        "gestured/car/door/gates": '{"armed": null, "closed": [], "until": null}',
    }


def test_what_is_asked_for_is_asked_of_the_daemon_and_unknown_keys_are_passed_on(bridge, at, listen, fake):
    listener = listen(at.port, "gestured/#")
    process = begin(
        bridge, at, fake, "--types", "gesture,unknown,touch", "--sensors", "armrest", "--gestures", "one_tap,double_tap"
    )
    fake.accept()
    assert fake.request() == {
        "subscribe": {
            "types": ["gesture", "unknown", "touch", "status"],
            "sensors": ["armrest"], "gestures": ["one_tap", "double_tap"],
        }
    }  # fmt: skip
    process.ready()
    fake.say(gesture(1, own=True, news={"of": 2027}), gesture(2) | {"type": "unknown", "reason": "hole"})
    assert json.loads(listener.until("gestured/car/armrest/gesture").payload)["news"] == {"of": 2027}
    assert json.loads(listener.until("gestured/car/armrest/unknown").payload)["reason"] == "hole"
    fake.say({"type": "touch", "sensor": "armrest", "id": 3, "touch": 0, "phase": "down", "t": 1.8e9, "x": 0.5,
              "y": 0.5, "dx": 0.0, "dy": 0.0, "pressure": 80.0, "area": 3, "zone": None})  # fmt: skip
    assert listener.until("gestured/car/armrest/touch").retain is False
    assert not [topic for topic in retained(listen, at, "gestured/#") if topic.endswith(("/touch", "/gesture"))]


def test_availability_when_the_daemon_goes_when_the_bridge_ends_and_when_it_is_killed(bridge, at, listen, fake):
    listener = listen(at.port, "gestured/car/availability")
    process = started(bridge, at, fake)
    listener.until("gestured/car/availability", "online")
    fake.close()
    listener.until("gestured/car/availability", "offline")
    fake.accept()
    listener.until("gestured/car/availability", "online")
    assert process.stop() == 0
    listener.until("gestured/car/availability", "offline")
    process = begin(bridge, at, fake)
    fake.accept()
    listener.until("gestured/car/availability", "online")
    process.process.kill()
    listener.until("gestured/car/availability", "offline")


def test_a_killed_bridges_last_will_does_not_outlive_its_successor(bridge, at, listen, fake):
    listener = listen(at.port, "gestured/car/availability")
    first = started(bridge, at, fake)
    listener.until("gestured/car/availability", "online")
    first.process.send_signal(signal.SIGSTOP)  # its connection stays open
    begin(bridge, at, fake)
    fake.accept()
    listener.until("gestured/car/availability", "offline")  # the broker cuts off the first for its successor
    listener.until("gestured/car/availability", "online")
    first.process.kill()
    first.process.wait()
    assert retained(listen, at, "gestured/#")["gestured/car/availability"] == "online"


# What Home Assistant takes (homeassistant/components/mqtt: event.py, device_trigger.py, binary_sensor.py, switch.py,
# schemas.py, and the pages integrations/event.mqtt, device_trigger.mqtt, binary_sensor.mqtt, switch.mqtt and mqtt of
# home-assistant.io, November 2026).
BASE = {"qos", "encoding", "device", "origin"}
DEVICE = {
    "identifiers", "connections", "manufacturer", "model", "model_id", "name", "hw_version", "serial_number",
    "sw_version", "via_device", "suggested_area", "configuration_url",
}  # fmt: skip
ORIGIN = {"name", "sw_version", "support_url"}
ENTITY = BASE | {
    "state_topic", "value_template", "name", "unique_id", "device_class", "icon",
    "availability", "availability_mode", "availability_template", "availability_topic",
    "payload_available", "payload_not_available", "enabled_by_default", "entity_category",
    "entity_picture", "json_attributes_topic", "json_attributes_template", "object_id", "default_entity_id",
}  # fmt: skip
KEYS = {  # component -> required, allowed
    "event": ({"state_topic", "event_types"}, ENTITY | {"event_types"}),
    "binary_sensor": (
        {"state_topic"}, ENTITY | {"payload_on", "payload_off", "expire_after", "force_update", "off_delay"}
    ),
    "switch": (
        {"command_topic"},
        ENTITY | {
            "command_topic", "command_template", "payload_on", "payload_off", "state_on", "state_off", "optimistic",
            "retain",
        },
    ),
    "device_automation": (
        {"automation_type", "device", "topic", "type", "subtype"},
        BASE | {"automation_type", "topic", "type", "subtype", "payload", "value_template", "platform"},
    ),
}  # fmt: skip


def test_discovery_holds_what_home_assistant_takes(bridge, at, listen, fake):
    listener = listen(at.port, "homeassistant/#")
    begin(bridge, at, fake)
    any_name = "wave/#+ é"  # a model of one's own may call its gestures anything, a topic may not
    fake.accept(HELLO | {"gestures": ["one_tap", any_name]})
    triggers = {}
    for _ in range(4):
        message = listener.next()
        _, component, node, identifier, config = message.topic.split("/")
        payload = json.loads(message.payload)
        required, allowed = KEYS[component]
        assert required <= payload.keys() <= allowed
        assert payload["device"].keys() <= DEVICE and payload["origin"].keys() <= ORIGIN
        assert (node, config, payload["device"]["identifiers"]) == ("gestured_car", "config", ["gestured_car_armrest"])
        assert identifier.replace("-", "_").isidentifier()
        if component == "event":
            assert payload["event_types"] == ["one_tap", any_name]
            assert payload["state_topic"] == "gestured/car/armrest/gesture"
            assert payload["availability_topic"] == "gestured/car/availability"
        elif component == "binary_sensor":
            assert payload["state_topic"] == "gestured/car/armrest/gates"
        else:
            triggers[identifier] = payload["topic"], payload["payload"]
    topic = "gestured/car/armrest/gesture"
    assert triggers == {"armrest-one_tap": (topic, "one_tap"), "armrest-wave_____": (topic, any_name)}


def test_templates_make_of_an_event_what_home_assistant_expects():
    """With its template engine, and its filter `tojson`."""
    jinja2 = pytest.importorskip("jinja2", reason="the extra [lab] brings the template engine")
    daemon = known.Daemon(None, None, Counts("mqtt"))
    daemon.take(HELLO | {"gestures": ["one_tap"], "sensors": {"armrest": 0}})
    retained = Retained(daemon, "car", "homeassistant", "house", discovers=True)
    found = {topic: json.loads(payload) for topic, payload in retained.changes() if topic.startswith("homeassistant/")}
    value = gesture(7) | {"instance": "i"}
    event = found["homeassistant/event/gestured_car/armrest/config"]
    made = json.loads(jinja2.Environment().from_string(event["value_template"]).render(value_json=value))
    assert made == {"event_type": "one_tap", "confidence": 0.9, "sequence": 7, "instance": "i"}
    trigger = found["homeassistant/device_automation/gestured_car/armrest-one_tap/config"]
    assert jinja2.Environment().from_string(trigger["value_template"]).render(value_json=value) == trigger["payload"]
    switch = found["homeassistant/switch/gestured_car/armrest/config"]
    assert KEYS["switch"][0] <= switch.keys() <= KEYS["switch"][1]
    listens = found["homeassistant/binary_sensor/gestured_car/armrest/config"]
    for armed, closed, expected in (
        (None, [], ("ON", "ON")), (True, [], ("ON", "ON")), (False, [], ("ON", "OFF")),
        (None, ["door"], ("ON", "OFF")), (None, ["house", "door"], ("OFF", "OFF")),
    ):  # fmt: skip
        told = {"armed": armed, "closed": closed, "until": None}
        templates = (switch["value_template"], listens["value_template"])
        assert tuple(jinja2.Environment().from_string(each).render(value_json=told) for each in templates) == expected


def test_no_two_sensors_of_two_machines_are_one_in_home_assistant():
    """It takes devices and entities with the same id for one, and both names may contain `_`."""
    found = []
    for host, sensor in (("a", "b_c"), ("a_b", "c"), ("car", "armrest")):
        daemon = known.Daemon(None, None, Counts("mqtt"))
        daemon.take(HELLO | {"sensors": {sensor: 0}})
        kept = dict(Retained(daemon, host, "ha", discovers=True).changes())
        event = json.loads(kept[f"ha/event/gestured_{host}/{sensor}/config"])
        found.append((*event["device"]["identifiers"], event["unique_id"]))
    assert found[2] == ("gestured_car_armrest", "gestured_car_armrest_gesture")  # as ever, so that entities stay
    assert all(one != other for one, other in zip(*found[:2], strict=True))


def test_what_was_forgotten_while_the_broker_was_away_is_cleared_when_it_is_back():
    daemon = known.Daemon(None, None, Counts("mqtt"))
    retained = Retained(daemon, "car", "homeassistant", discovers=True)
    broker: dict[str, str] = {}  # what it retains
    daemon.take(HELLO | {"gestures": ["one_tap", "nod"]})
    broker |= retained.changes()
    retained.forget()
    daemon.take({"type": "gestures", "gestures": ["one_tap"]})
    before = set(broker)
    broker |= retained.changes()
    (cleared,) = [topic for topic in before if not broker[topic]]
    assert cleared == "homeassistant/device_automation/gestured_car/armrest-nod/config"
    assert not list(retained.changes())


def test_a_gate_that_opens_by_itself_is_not_published_anew_each_second():
    daemon = known.Daemon(None, None, Counts("mqtt"))
    retained = Retained(daemon, "car", "homeassistant", discovers=False)
    closed = {"armed": None, "closed": ["door"]}
    daemon.take(STATUS | {"gates": {"armrest": closed | {"until": 1795871457.4070168}}})
    assert json.loads(dict(retained.changes())["gestured/car/armrest/gates"]) == closed | {"until": 1795871457.4}
    daemon.take(STATUS | {"gates": {"armrest": closed | {"until": 1795871457.4070173}}})  # by clocks read later
    assert not list(retained.changes())


def test_what_others_retain_is_neither_read_nor_cleared(bridge, at, listen, fake):
    """Any integration may write below the discovery prefix, and as much as it likes."""
    theirs = "homeassistant/event/gestured_car/other/config"
    stranger = listen(at.port, theirs)
    stranger.client.publish(theirs, b"{}" * 500_000, qos=1, retain=True)
    stranger.until(theirs)
    listener = listen(at.port, "gestured/#")
    started(bridge, at, fake, "--no-discovery")
    fake.say(gesture(1))
    listener.events(1)
    assert retained(listen, at, "homeassistant/#").keys() == {theirs}
    said = at.said()
    assert "Received PUBLISH from gestured-car" in said and "Received SUBSCRIBE from " in said  # such lines are logged
    assert "Received SUBSCRIBE from gestured-car" not in said


def test_a_bridge_goes_on_where_nobody_reads_that_it_is_ready(bridge, at, listen, fake):
    listener = listen(at.port, "gestured/#")
    process = begin(bridge, at, fake)
    process.process.stdout.close()
    fake.accept()
    listener.until("gestured/car/availability", "online")
    for n in range(1, 11):  # the first of them come before it is ready
        fake.say(gesture(n))
        assert listener.events(1)[0]["sequence"] == n
    assert process.stop() == 0


def test_a_broker_is_told_to_send_no_large_message(bridge, fake):
    """What is read whole before it can be looked at is bounded by the other side."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(DEADLINE_S)
        bridge("mqtt", "--broker", f"127.0.0.1:{server.getsockname()[1]}", "--socket", fake.path)
        with server.accept()[0] as connection:
            assert b"\x27" + (65536).to_bytes(4, "big") in connection.recv(65536)  # Maximum Packet Size (3.1.2.11.4)


def published(data: bytes) -> Iterator[tuple[bytes, str]]:
    """Number and topic of each message that a client has published, with QoS 1."""
    while data:
        length, size, shift = 0, 1, 0
        while True:  # 1.5.5, seven bits a byte
            length, shift = length | (data[size] & 127) << shift, shift + 7
            size += 1
            if data[size - 1] < 128:
                break
        packet, data = data[size : size + length], data[size + length :]
        end = 2 + int.from_bytes(packet[:2], "big")
        yield packet[end : end + 2], packet[2:end].decode()


def test_a_broker_gets_no_more_messages_at_a_time_than_it_asks_for(bridge, fake):
    """It may end the connection of who sends more (Receive Maximum, 3.2.2.3.3)."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(DEADLINE_S)
        bridge("mqtt", "--broker", f"127.0.0.1:{server.getsockname()[1]}", "--socket", fake.path)
        with server.accept()[0] as connection:
            connection.settimeout(DEADLINE_S)
            assert connection.recv(65536).startswith(b"\x10")  # CONNECT
            connection.sendall(b"\x20\x06\x00\x00\x03\x21\x00\x03")  # CONNACK: three
            fake.accept()
            events, waiting = 0, list[bytes]()
            while events < 20:
                fake.say(STATUS, *(gesture(n) for n in range(10)))
                while select.select([connection], [], [], 0.05)[0]:
                    for number, topic in published(connection.recv(65536)):
                        waiting.append(number)
                        events += topic.endswith("/armrest/gesture")
                assert len(waiting) <= 3
                connection.sendall(b"\x40\x02" + waiting.pop(0))  # PUBACK


@contextmanager
def let_in(bridge: Callable[..., Process], fake: FakeDaemon) -> Iterator[tuple[Process, socket.socket]]:
    """A bridge, and the connection of a broker that has just accepted it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(DEADLINE_S)
        to = ("--broker", f"127.0.0.1:{server.getsockname()[1]}", "--metrics", "127.0.0.1:0")
        process = bridge("mqtt", *to, "--socket", fake.path, "--host", "car")
        fake.accept()
        with server.accept()[0] as connection:
            connection.settimeout(DEADLINE_S)
            assert connection.recv(65536).startswith(b"\x10")  # CONNECT
            connection.sendall(b"\x20\x03\x00\x00\x00")  # CONNACK
            yield process, connection


@pytest.mark.parametrize("code", [128, 131, 145, 151])
def test_a_message_that_the_broker_does_not_take_now_ends_nothing(bridge, fake, code: int):
    """As if a quota is exceeded: what is to be retained is published again, and events go on."""
    wanted, refused, taken = {f"gestured/car/armrest/{level}" for level in ("state", "gesture")}, set(), set()
    with let_in(bridge, fake) as (process, connection):
        while not wanted <= taken:
            fake.say(STATUS, gesture(1))
            while select.select([connection], [], [], 0.05)[0]:
                for number, topic in published(connection.recv(65536)):
                    first = topic in wanted - refused
                    (refused if first else taken).add(topic)
                    connection.sendall(b"\x40\x03" + number + bytes([code if first else 0]))  # PUBACK (3.4.2.1)
        assert process.said().count("refuses a message at") == 1 and "access list" not in process.said()
        assert '_events_total{bridge="mqtt",result="refused"} 1.0' in page(process.ready()["metrics"])


@pytest.mark.parametrize("code", [144, 153])
def test_a_message_that_the_broker_never_takes_ends_the_bridge_with_its_topic(bridge, fake, code: int):
    with let_in(bridge, fake) as (process, connection):
        number, topic = next(published(connection.recv(65536)))
        connection.sendall(b"\x40\x03" + number + bytes([code]))  # PUBACK
        assert process.end() == 1
        assert f"refuses a message at {topic}: " in process.said() and "access list" not in process.said()


def test_a_broker_far_away_hears_first_that_the_daemon_is_gone(bridge, fake):
    """However much it is still to retain; a message a round trip takes minutes for some dozen sensors."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(DEADLINE_S)
        to = f"127.0.0.1:{server.getsockname()[1]}"
        process = bridge("mqtt", "--broker", to, "--socket", fake.path, "--host", "car")
        fake.accept(HELLO | {"sensors": {f"arm{n}": 0 for n in range(30)}})
        with server.accept()[0] as connection:
            connection.settimeout(DEADLINE_S)
            assert connection.recv(65536).startswith(b"\x10")  # CONNECT
            process.until("daemon is there")
            connection.sendall(b"\x20\x03\x00\x00\x00")  # CONNACK
            told = list[str]()
            while told.count("gestured/car/availability") < 2:
                numbers, topics = zip(*published(connection.recv(65536)), strict=True)
                if not told:
                    fake.close()
                    process.until("no daemon answers")
                told += topics
                connection.sendall(b"".join(b"\x40\x02" + number for number in numbers))  # PUBACK
    assert len(told) <= 20


def test_a_broker_that_sends_what_cannot_be_read_is_called_again(bridge, fake):
    """Whatever the library's thread dies of: else the bridge would believe for ever that the broker is there."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(DEADLINE_S)
        process = bridge("mqtt", "--broker", f"127.0.0.1:{server.getsockname()[1]}", "--socket", fake.path)
        for packet in (b"\x30\x05\x00\x02\xff\xfe\x00", b"\x40\x00", b"\x30\x06\x00\x01a\x7f\x01\x02"):
            with server.accept()[0] as connection:
                connection.settimeout(DEADLINE_S)
                assert connection.recv(65536).startswith(b"\x10")  # CONNECT
                connection.sendall(b"\x20\x03\x00\x00\x00" + packet)
                while connection.recv(65536):
                    pass
        server.accept()[0].close()
        assert "it sent what cannot be read" in process.said() and "Traceback" not in process.said()


def test_a_sensor_that_the_daemon_let_go_gives_its_place_to_another(monkeypatch):
    monkeypatch.setattr(known, "MOST_SENSORS", 3)
    daemon = known.Daemon(None, None, Counts("mqtt"))
    for n in range(10):
        daemon.take(STATUS | {"sensors": {"armrest": "ok", f"invented{n}": "ok"}})
    assert daemon.states == {"invented8": "no_data", "armrest": "ok", "invented9": "ok"}


def test_a_name_of_a_test_is_no_sensor():
    """The hello of a daemon holds it, as the sequence of its events goes on."""
    daemon = known.Daemon(None, None, Counts("mqtt"))
    for _ in range(2):  # the first connection ends before a status has come
        daemon.take(HELLO | {"sensors": {"armrest": 3, "test": 1}})
    daemon.take(STATUS)
    assert daemon.states == {"armrest": "ok"}


def test_sequences_go_on_where_there_are_as_many_sensors_as_are_remembered(monkeypatch):
    monkeypatch.setattr(known, "MOST_SENSORS", 2)
    daemon = known.Daemon(None, None, Counts("mqtt"))
    daemon.take(HELLO | {"sensors": {"armrest": 1, "door": 1}})
    for name in ("armrest", "invented"):
        daemon.take({"type": "gesture", "sensor": name, "sequence": 7})
    assert daemon.hello["sensors"] == {"armrest": 7, "door": 1}


def test_a_sensor_that_a_restarted_daemon_does_not_know_is_silent(bridge, at, listen, fake):
    started(bridge, at, fake)
    listener = listen(at.port, "gestured/car/armrest/state")
    fake.say(STATUS)
    listener.until("gestured/car/armrest/state", "ok")
    fake.close()
    fake.accept(HELLO | {"instance": "b", "sensors": {}})
    fake.say(STATUS | {"sensors": {"door": "ok"}})
    listener.until("gestured/car/armrest/state", "no_data")


def test_a_broker_that_is_killed_and_comes_back_gets_what_is_fresh(bridge, at, listen, fake):
    process = begin(bridge, at, fake, "--metrics", "127.0.0.1:0")
    fake.accept()
    where = process.ready()["metrics"]
    listener = listen(at.port, "gestured/car/armrest/gesture")
    fake.say(*(gesture(n, decided=time.time()) for n in range(1, 4)))
    assert [event["sequence"] for event in listener.events(3)] == [1, 2, 3]
    at.kill()
    process.until("is not there")
    fake.say(*(gesture(n, decided=time.time() - 30) for n in range(4, 3000)))  # more than it keeps, all old
    counted = '_events_total{bridge="mqtt",result="%s"} %s.0'
    wait(lambda: counted % ("overflow", 2996 - 1000) in page(where))
    at.start()
    process.until(f"broker {at.address} is there", 2)
    listener = listen(at.port, "gestured/car/armrest/gesture")
    fake.say(gesture(3000))
    assert listener.events(1)[0]["sequence"] == 3000
    assert counted % ("old", 1000) in page(where)
    assert retained(listen, at)["gestured/car/availability"] == "online"


def test_a_daemon_that_starts_again_is_found(bridge, at, listen, fake):
    listener = listen(at.port, "gestured/car/armrest/gesture")
    started(bridge, at, fake)
    fake.say(gesture(1, decided=time.time() + 30))  # by its sensor's clock, which has run ahead for weeks
    assert listener.events(1)[0]["instance"] == "a"
    fake.close()
    fake.accept(HELLO | {"instance": "b"})
    fake.say(gesture(1, decided=time.time()))
    assert listener.events(1)[0]["instance"] == "b"


def test_a_daemon_that_hangs_is_gone_until_it_goes_on(daemon: Daemon, monkeypatch):
    """Nobody restarts it where no watchdog does, and its connection stays open."""
    monkeypatch.setattr("gestured.client.subscriber.GREETING_S", 2.0)
    source = Subscriber(daemon.socket, types=["gesture", "status"], timeout=known.NOTICE_S)
    late = threading.Timer(DEADLINE_S, source.close)
    late.start()
    lines = known.follow(source, Counts("mqtt"))
    try:
        for kind, then in (("status", signal.SIGSTOP), (known.GONE, signal.SIGCONT), ("hello", signal.SIGCONT)):
            assert any(line["type"] == kind for line in lines), f"no line {kind!r} comes"
            daemon.signal(then)
    finally:
        daemon.signal(signal.SIGCONT)
        late.cancel()
        source.close()


@pytest.mark.parametrize("ahead", [-30.0, 30.0])
def test_a_test_says_nothing_of_the_sensors_clock_and_is_never_old(ahead: float) -> None:
    daemon = known.Daemon(None, None, Counts("mqtt"))
    events = [gesture(1, decided=100 + ahead), gesture(2, decided=101, test=True), gesture(3, decided=102 + ahead)]
    assert [daemon.age(event, now) for now, event in zip((100, 101, 102), events, strict=True)] == [0.0, 0.0, 0.0]


def test_what_has_waited_while_the_daemon_was_held_up_is_old() -> None:
    """It says its status each second if it can; after a silence an event may have waited for as long."""
    daemon = known.Daemon(None, None, Counts("mqtt"))

    def age(decided: float, now: float, sensor: str = "armrest") -> float:
        return round(daemon.age(gesture(1, decided=decided) | {"sensor": sensor}, now), 3)

    def goes_on(begin: int, end: int) -> None:
        for second in range(begin, end):
            daemon.take(STATUS | {"time": float(second)})

    goes_on(90, 101)
    assert age(100.6, 104.9) == 4.3  # the first of its sensor
    daemon.take(STATUS | {"time": 104.9})
    assert age(101.5, 105.0) == 3.5  # it waited for another turn of the daemon
    goes_on(105, 901)
    assert age(900.2, 900.2) == 0.0
    goes_on(901, 1801)
    assert age(1800.2, 1803.0) == 2.8  # after many minutes, in which the sensor's clock may have drifted
    goes_on(1803, 1901)
    assert age(400.0, 1900.1, "door") == 0.0  # its clock is wrong


def test_an_event_that_was_on_its_way_when_the_clock_was_set_back_makes_no_later_one_old() -> None:
    daemon = known.Daemon(None, None, Counts("mqtt"))
    for told, decided, now in ((5000.0, 5000.5, 5000.5), (5001.0, 5001.5, 1401.5), (1402.0, 1402.5, 1402.5)):
        daemon.take(STATUS | {"time": told})
        late = daemon.age(gesture(1, decided=decided), now)
    assert late == 0.0


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An authority, a broker's certificate for 127.0.0.1, and another authority."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    folder = tmp_path_factory.mktemp("certificates")

    def openssl(*arguments: str) -> None:
        subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True, timeout=60)

    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    for name in ("ca", "other"):
        use = ("-addext", "keyUsage=critical,keyCertSign,cRLSign")  # Python 3.13 and newer ask an authority for it
        openssl("req", "-x509", *key, *use, "-keyout", f"{name}.key", "-out", f"{name}.pem", "-subj", f"/CN={name}")
    openssl("req", *key, "-keyout", "broker.key", "-out", "broker.csr", "-subj", "/CN=broker")
    (folder / "san").write_text("subjectAltName=IP:127.0.0.1\n")
    openssl(
        "x509", "-req", "-in", "broker.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
        "-out", "broker.pem", "-extfile", "san",
    )  # fmt: skip
    for path in folder.iterdir():
        path.chmod(0o644)  # the broker gives up root's rights
    folder.chmod(0o755)
    return folder


def tls(certificates: Path) -> list[str]:
    return ["allow_anonymous true", f"certfile {certificates}/broker.pem", f"keyfile {certificates}/broker.key"]


def test_a_broker_with_tls_is_called_as_it_wants_or_says_why_not(bridge, broker, fake, certificates: Path):
    at = broker(*tls(certificates), "user root")
    process = begin(bridge, at, fake, "--tls", "--ca", certificates / "ca.pem")
    fake.accept()
    process.ready()
    process = begin(bridge, at, fake, "--tls", "--ca", certificates / "other.pem")
    assert process.end() == 1
    assert f"the certificate of the broker {at.address} is not to be trusted" in process.said()
    assert "--ca FILE" in process.said() and process.said().count("\n") <= 2
    process = begin(bridge, at, fake)
    assert f"{at.address} is not there: it closed the connection" in process.until("is it one with TLS: --tls?")


def test_a_broker_that_wants_a_certificate_says_so(bridge, broker, fake, certificates: Path):
    at = broker(*tls(certificates), f"cafile {certificates}/ca.pem", "require_certificate true", "user root")
    process = begin(bridge, at, fake, "--tls", "--ca", certificates / "ca.pem")
    process.until("does it ask for a --cert that it knows?")


def test_a_broker_without_tls_is_told_from_one_that_is_not_there(bridge, broker, fake):
    begin(bridge, broker(), fake, "--tls").until("closed the connection before it let us in (is it one without TLS")


def test_a_broker_that_refuses_and_topics_that_are_not_allowed(bridge, broker, fake, tmp_path: Path):
    access = "user car\ntopic write gestured/car/#\ntopic write homeassistant/+/gestured_car/#\n"
    at = broker(*guarded(tmp_path, "car:secret\n", access))
    process = begin(bridge, at, fake, env={"MQTT_USER": "car", "MQTT_PASSWORD": "wrong"})
    assert process.end() == 1
    assert f"the broker {at.address} refuses us" in process.said() and "MQTT_PASSWORD" in process.said()
    process = bridge(
        "mqtt", "--broker", at.address, "--socket", fake.path, "--host", "other",
        env={"MQTT_USER": "car", "MQTT_PASSWORD": "secret"},
    )  # fmt: skip
    assert process.end() == 1
    assert "does not let us publish" in process.said() and "gestured/other/#" in process.said()


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--broker", "a b"], "expected HOST:PORT"),
        (["--broker", "localhost", "--ca", "x.pem"], "add --tls"),
        (["--broker", "localhost", "--tls", "--ca", "/none.pem"], "/none.pem"),
        (["--broker", "localhost", "--tls", "--ca", "/etc/ssl/certs"], "--ca /etc/ssl/certs: there is no such file"),
        (["--broker", "localhost", "--types", "gestures"], "--types"),
        (["--broker", "localhost", "--discovery", "home/#"], '--discovery "home/#": expected the beginning of a topic'),
        (["--broker", "localhost", "--discovery", "+"], '--discovery "+": expected the beginning of a topic'),
        (["--broker", "localhost", "--discovery", "ha/"], '--discovery "ha/": expected the beginning of a topic'),
        (["--broker", "localhost", "--discovery", ""], '--discovery "": expected the beginning of a topic'),
    ],
)
def test_bad_input_is_one_sentence(refused, tmp_path: Path, flags: list[str], words: str):
    assert words in refused("mqtt", "--socket", tmp_path / "none.sock", *flags)


def test_a_login_that_is_no_text_is_refused_and_not_shown(refused, tmp_path: Path, monkeypatch):
    monkeypatch.setitem(os.environb, b"MQTT_PASSWORD", b"gr\xfcn")
    said = refused("mqtt", "--broker", "localhost", "--socket", tmp_path / "none.sock")
    assert "MQTT_PASSWORD: expected text in UTF-8" in said and "gr" not in said.partition("MQTT_PASSWORD")[2]


@pytest.mark.parametrize(
    ("limit", "words"),
    [("retain_available false", "it retains nothing"), ("max_qos 0", "it takes no messages with QoS 1")],
)
def test_a_broker_that_takes_too_little_of_mqtt_is_none_for_the_bridge(bridge, broker, fake, limit, words):
    process = begin(bridge, broker("allow_anonymous true", limit), fake)
    assert process.end() == 1 and words in process.said()


def test_a_broker_that_takes_small_packets_alone_is_none_for_the_bridge(bridge, broker, fake):
    """mosquitto would close the connection, and what it says of the reason is mostly lost."""
    process = begin(bridge, broker("allow_anonymous true", "max_packet_size 200"), fake)
    fake.accept()
    fake.say(STATUS)
    assert process.end() == 1 and "it takes no packets as large as ours" in process.said()
    assert "is not there" not in process.said()


def test_two_bridges_of_one_name_are_told_that_there_is_another(bridge, at, fake):
    """A broker need not say why it closes the older connection: mosquitto 2.0 does not."""
    first, second = begin(bridge, at, fake), begin(bridge, at, fake)
    for process in (first, second):
        process.until("does another bridge have the name gestured-car? (--host)")


def test_lines_of_a_mad_daemon_are_passed_over(bridge, at, listen, fake):
    listener = listen(at.port, "gestured/#")
    process = begin(bridge, at, fake, "--metrics", "127.0.0.1:0")
    fake.accept()
    where = process.ready()["metrics"]
    fake.say(*MAD, gesture(2))
    assert listener.events(1)[0]["sequence"] == 2
    assert process.said().count("passed over") == 1 and 'type ["gesture"]: expected' in process.said()
    wait(lambda: f'gestured_bridge_events_total{{bridge="mqtt",result="wrong"}} {len(MAD)}.0' in page(where))
    wait(lambda: 'gestured_bridge_events_total{bridge="mqtt",result="sent"} 1.0' in page(where))
    assert all(
        f'gestured_bridge_connected{{bridge="mqtt",to="{to}"}} 1.0' in page(where) for to in ("broker", "daemon")
    )


def test_a_subscription_that_the_daemon_refuses_ends_the_bridge(bridge, broker, fake):
    process = begin(bridge, broker(), fake, "--gestures", "wave")
    fake.accept()
    fake.say({"type": "error", "reason": "subscribe.gestures: unknown wave, there are one_tap"})
    assert process.end() == 1
    assert "there are one_tap" in process.said()
