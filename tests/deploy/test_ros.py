"""deploy/ros2 on a real ROS 2: built by colcon, started as its users start it, with another node on the other side.

It needs the environment of `make ros`. What needs no ROS is tested without.
"""

import importlib
import itertools
import json
import re
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gestured
from deploy.ros2.gestured_ros2.gestured_ros2.frames import values_of
from gestured.bridge.ros_names import token
from gestured.client.control import Control
from gestured.core.wire import Addresses, Decoder
from tests.bridge.conftest import wait
from tests.daemon.harness import DEADLINE_S, Daemon, Hand, Sensor
from tests.sockets import GESTURE, HELLO, FakeDaemon

ROOT = Path(__file__).resolve().parents[2]
ROS2 = ROOT / "deploy" / "ros2"
PACKAGE = ROS2 / "gestured_ros2"
PACKAGES = ["gestured_ros2", "gestured_msgs"]
PYTHON = ROOT / ".venv-ros" / "bin" / "python"
NAMES = ["armrest", "armrest-1", "armrest_1", "1st", "_a", "a__b", "a_", "x", "xarmrest_2d1", "-", "9", "__", "A-" * 32]
names = st.sampled_from(NAMES) | st.text("abxX019_-25df", min_size=1, max_size=64)


@given(names)
def test_a_sensors_name_can_be_read_from_its_topic(name: str):
    """So no two share a topic."""
    part = token(name)
    signs = {"_5f": "_", "_2d": "-"}
    read = re.sub("_5f|_2d", lambda found: signs[found[0]], part[1:]) if part.startswith("x") else part
    assert read == name
    assert re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*_?", part)  # neither hidden nor with a double underscore


def image(values: Any, **changed: object) -> dict[str, Any]:
    """An image of a frame, as its fields."""
    height, width = values.shape
    fields = {"height": height, "width": width, "encoding": "32FC1", "step": 4 * width, "is_bigendian": 0}
    return fields | {"data": values.astype("<f4").tobytes().hex()} | changed


PLACE = {"x": 0.25, "y": 0.5}
WHERE = {
    "start": PLACE,
    "end": PLACE | {"x": 1.0},
    "way": 0.75,
    "pressure": 212.5,
    "snr": 31.5,
    "contacts": 1,
    "bridged": 2,
}
# "test" excuses the age of what comes later than a second after its decision: the node would drop it.
PLACED = GESTURE | {"where": WHERE | {"zone": None}, "provisional": "confirmed", "own": True, "test": True}
PROVISIONAL = {
    "type": "provisional",
    **{name: GESTURE[name] for name in ("sensor", "id", "gesture", "confidence", "onset")},
}
PROVISIONAL |= {"decided": 1000.25, "test": True}
TOUCH = {"type": "touch", "sensor": "armrest", "id": 4, "touch": 1, "phase": "up", "t": 1000.25, "x": 0.5, "y": 0.0}
TOUCH |= {"dx": -0.125, "dy": 0.0, "pressure": 80.5, "area": 3, "zone": "volume", "reason": "learned"}
STATUS = {"type": "status", "state": "ok", "sensors": {"armrest": "stale"}, "model": "cnn_lstm", "time": 1000.0}
FRAME = np.arange(81.0).reshape(9, 9)
WRONG = {
    "encoding": image(FRAME, encoding="64FC1"),
    "not a number": image(np.where(FRAME == 3, np.nan, FRAME)),
    "one row": image(FRAME[:1]),
    "a side of 65": image(np.zeros((2, 65))),
    "too few bytes": image(FRAME, data=image(FRAME)["data"][8:]),
    "too short a step": image(FRAME, step=35, data="00" * 9 * 35),
}


@pytest.mark.parametrize("order", ["<f4", ">f4"])
@pytest.mark.parametrize("padding", [0, 3])
def test_a_frame_is_read_whatever_the_rows_end_in(order: str, padding: int):
    rows = [row.astype(order).tobytes() + b"?" * padding for row in FRAME]
    fields = image(FRAME, step=36 + padding, is_bigendian=order == ">f4")
    assert (values_of(SimpleNamespace(**fields | {"data": b"".join(rows)})) == FRAME).all()


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_no_frame_is_refused_with_what_was_expected(wrong: str):
    fields = WRONG[wrong] | {"data": bytes.fromhex(WRONG[wrong]["data"])}
    with pytest.raises(ValueError, match="expected|finite"):
        values_of(SimpleNamespace(**fields))


def test_the_package_says_everywhere_what_it_is():
    versions = {ElementTree.parse(ROS2 / name / "package.xml").findtext("version") for name in PACKAGES}
    (version,) = re.findall('version="(.*)"', (PACKAGE / "setup.py").read_text())
    assert versions | {version} == {gestured.__version__}
    launch = ElementTree.parse(PACKAGE / "launch" / "gestured.launch.xml").getroot()
    declared = set(
        re.findall(r'(?:_texts?|declare_parameter)\("(\w+)"', (PACKAGE / "gestured_ros2" / "node.py").read_text())
    )
    assert {each.get("name") for each in launch.iter("arg")} == declared
    assert {each.get("name"): each.get("value") for each in launch.iter("param")} == {
        name: f"$(var {name})" for name in declared
    }


@pytest.mark.parametrize("name", ["gesture", "provisional", "touch", "status", "where", "place"])
def test_a_message_has_the_fields_of_its_event(name: str):
    schema = json.loads((ROOT / "docs" / "events.schema.json").read_text())["$defs"][name]["properties"]
    lines = (ROS2 / "gestured_msgs" / "msg" / f"{name.capitalize()}.msg").read_text().splitlines()
    fields = {line.split()[1] for line in lines if not line.startswith("#")}
    assert fields - {"instance", "states"} == set(schema) - {"type", "scores", "gates"}


class StandIn:
    """In place of rclpy's node: it keeps what is published, and whatever else it is asked to do it does not."""

    def __init__(self, name: str) -> None:
        self.published: list[dict[str, Any]] = []

    def declare_parameter(self, name: str, default: object) -> object:
        return SimpleNamespace(value=default)

    def create_publisher(self, kind: object, topic: str, quality: object) -> object:
        return SimpleNamespace(msg_type=kind, publish=lambda told: self.published.append(json.loads(told.data)))

    def __getattr__(self, name: str) -> Any:
        return MagicMock()


def test_an_event_that_is_older_than_a_second_is_not_published(monkeypatch: pytest.MonkeyPatch):
    ros = MagicMock(Node=StandIn, String=SimpleNamespace)
    parts = ("rclpy", *(f"rclpy.{part}" for part in ("exceptions", "executors", "node", "qos", "signals", "task")))
    for name in (*parts, "sensor_msgs", "sensor_msgs.msg", "std_msgs", "std_msgs.msg", "std_srvs", "std_srvs.srv"):
        monkeypatch.setitem(sys.modules, name, ros)
    module = importlib.import_module("deploy.ros2.gestured_ros2.gestured_ros2.node")
    monkeypatch.setattr(module, "Subscriber", MagicMock())
    node, now = module.Gestures(), time.time()
    node._lines += [HELLO, *(GESTURE | {"id": id, "decided": now - age} for id, age in enumerate((0.0, 3.0, 0.0)))]
    node._take()
    assert [event["id"] for event in node.published if event["type"] == "gesture"] == [0, 2]


class Process:
    """A program of ROS."""

    def __init__(self, folder: Path, command: str) -> None:
        self.errors = folder / "ros.txt"
        environment = {"PATH": f"{PYTHON.parent}:/usr/bin:/bin", "HOME": str(folder), "PYTHONPATH": str(ROOT)}
        with self.errors.open("ab") as errors:
            self.process = subprocess.Popen(
                ["bash", "-c", f"export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST PYTHONUNBUFFERED=1; {command}"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True, env=environment,
            )  # fmt: skip

    def say(self, **command: object) -> None:
        self.process.stdin.write(json.dumps(command) + "\n")
        self.process.stdin.flush()

    def line(self) -> Any:
        """The next line that it says."""
        assert self.speaks(DEADLINE_S), self.errors.read_text()
        return json.loads(self.process.stdout.readline())

    def speaks(self, seconds: float) -> bool:
        """Whether a line is there, at the latest after that time."""
        assert self.process.stdout is not None
        return bool(select.select([self.process.stdout], [], [], seconds)[0])

    def end(self, number: int) -> int:
        """Its exit status after a signal."""
        self.process.send_signal(number)
        return self.process.wait(DEADLINE_S)


class Ros:
    """ROS 2 with our package in it, in a namespace that nobody else has."""

    def __init__(self, folder: Path, workspace: Path) -> None:
        self.folder, self.space = folder, f"/t{folder.name.translate({45: '_'})}_{id(folder)}"
        self._setup = f". {workspace}/install/local_setup.bash"
        self._program = f"exec {workspace}/install/gestured_ros2/lib/gestured_ros2/gestures"
        self.processes: list[Process] = []

    def node(self, **parameters: object) -> Process:
        """The node, as `ros2 run` starts it."""
        given = " ".join(
            f"-p '{name}:={json.dumps(str(v) if isinstance(v, Path) else v)}'" for name, v in parameters.items()
        )
        command = f"{self._setup} && {self._program} --ros-args -r __ns:={self.space} {given}"
        self.processes.append(Process(self.folder, command))
        return self.processes[-1]

    def peer(self) -> Process:
        """The other side, once it is there."""
        command = f"{self._setup} && exec {PYTHON} {ROOT}/tests/deploy/ros/peer.py"
        self.processes.append(Process(self.folder, command))
        assert self.processes[-1].line() == {"ready": True}
        return self.processes[-1]

    def topic(self, *parts: str) -> str:
        """A name below the node's."""
        return "/".join((self.space, "gestured", *parts))


@pytest.fixture(scope="module", params=[PACKAGES[:1]], ids=["without messages"])
def workspace(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace in which colcon has built these packages."""
    if not PYTHON.exists():
        pytest.skip("ROS 2 is not in .venv-ros: `make ros` installs it")
    if request.param == PACKAGES and not (shutil.which("cmake") and shutil.which("g++")):
        pytest.skip("cmake and g++ are not installed")
    folder = tmp_path_factory.mktemp("workspace")
    shutil.copytree(ROS2, folder / "src" / "gestured")
    command = [PYTHON, "-m", "colcon", "build", "--packages-select", *request.param]
    environment = {
        "PATH": f"{PYTHON.parent}:/usr/bin:/bin",
        "HOME": str(folder),
        "AMENT_PREFIX_PATH": PYTHON.parents[1],
    }
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    for file in ("local_setup.bash", "gestured_ros2/share/gestured_ros2/launch/gestured.launch.xml"):
        assert (folder / "install" / file).exists()
    return folder


@pytest.fixture
def ros(workspace: Path, tmp_path: Path) -> Iterator[Ros]:
    """What was started is ended, and no traceback was said."""
    ros = Ros(tmp_path, workspace)
    yield ros
    for each in ros.processes:
        each.process.kill()
        each.process.communicate()
    assert "Traceback" not in (tmp_path / "ros.txt").read_text()


def heard(peer: Process, condition: Callable[[dict[str, Any]], bool]) -> list[dict[str, Any]]:
    """What a node hears, up to the first line that is meant."""
    lines = [peer.line()]
    while not condition(lines[-1]):
        lines.append(peer.line())
    return lines


def test_ros_takes_the_topic_of_each_sensor(ros: Ros):
    peer = ros.peer()
    peer.say(invalid=[f"/gestured/{name}/gesture" for name in NAMES])
    assert peer.line()["invalid"]  # some of them would not do as they are
    peer.say(invalid=[f"/gestured/{token(name)}/gesture" for name in NAMES])
    assert peer.line() == {"invalid": []}


def test_gestures_of_sensors_with_names_alike_come_apart_and_without_a_gap(ros: Ros, serve):
    daemon: Daemon = serve()
    sensors = ("armrest-1", "armrest_1", "1st")
    topics = {ros.topic(token(name), "gesture"): name for name in sensors}
    for name in sensors:
        Sensor(daemon, name).begin()
    peer, node = ros.peer(), ros.node(socket=daemon.socket)
    for topic in topics:
        peer.say(listen=topic, latched=False)
    seen: dict[str, list[int]] = {name: [] for name in sensors}
    with Control(Path(daemon.ready["control"])) as control:
        while min(map(len, seen.values())) < 5:
            assert node.process.poll() is None, node.errors.read_text()
            for name in sensors:
                control.ask("emit", gesture=daemon.client().hello["gestures"][0], sensor=name)
            while peer.speaks(0.05):
                line = peer.line()
                assert line["data"]["sensor"] == topics[line["topic"]] and line["data"]["instance"]
                seen[line["data"]["sensor"]].append(line["data"]["sequence"])
    for sequences in seen.values():
        assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_well(ros: Ros, fake: FakeDaemon, number: int):
    node = ros.node(socket=fake.path)
    fake.accept()
    assert node.end(number) == 0
    assert "Traceback" not in node.errors.read_text()


def test_who_comes_late_is_told_the_status_and_that_the_daemon_went_and_returned(ros: Ros, fake: FakeDaemon):
    ros.node(socket=fake.path, types=["gesture", "unknown"])
    fake.accept()
    assert fake.request() == {"subscribe": {"types": ["gesture", "unknown", "status"]}}
    status = {"type": "status", "state": "ok", "sensors": {"armrest": "ok"}, "model": "cnn_lstm", "time": 1.0}
    fake.say(status)
    peer = ros.peer()
    peer.say(listen=ros.topic("status"), latched=True)
    assert heard(peer, lambda line: line["data"]["state"] != "gone")[-1]["data"] == status | {"instance": "a"}
    fake.close()
    assert heard(peer, lambda line: line["data"]["state"] == "gone")[-1]["data"]["sensors"] == {}
    fake.accept(HELLO | {"instance": "b"})
    fake.say(status)
    assert peer.line()["data"]["instance"] == "b"
    peer.say(listen=ros.topic("armrest", "gesture"), latched=False)
    line: dict[str, Any] = {"topic": ""}
    while not line["topic"].endswith("gesture"):  # the listener is found in its own time
        fake.say(PLACED, status)
        line = peer.line()
    assert line["data"] == PLACED | {"instance": "b"}


def same(told: dict[str, Any], event: dict[str, Any]) -> None:
    """Each field of a message is that of an event; null, and what is left out, are empty, 0 or false."""
    for name, value in told.items():
        match value, event.get(name):
            case {"sec": seconds, "nanosec": nanoseconds}, expected:
                assert seconds + 1e-9 * nanoseconds == expected, name
            case {}, expected:
                same(value, expected)
            case _, expected:
                assert value == (type(value)() if expected is None else expected), name


@pytest.mark.timeout(900)  # a message is thirty files in C and C++
@pytest.mark.parametrize("workspace", [PACKAGES], ids=["with messages"], indirect=True)
def test_events_come_as_messages_of_their_own(ros: Ros, fake: FakeDaemon):
    node, peer = ros.node(socket=fake.path, types=["gesture", "touch"], messages=True), ros.peer()
    fake.accept()
    peer.say(listen=ros.topic("status"), message="Status", latched=True)
    fake.say(STATUS)
    told = heard(peer, lambda line: line["data"]["state"] == "ok")
    same(told[-1]["data"], STATUS | {"sensors": ["armrest"], "states": ["stale"], "instance": "a"})
    for kind in ("gesture", "provisional", "touch"):
        peer.say(listen=ros.topic("armrest", kind), message=kind.capitalize(), latched=False)
    left = {event["type"]: event | {"instance": "a"} for event in (PLACED, PROVISIONAL, TOUCH)}
    while left:  # each listener is found in its own time
        fake.say(PLACED | {"id": -1}, PLACED, PROVISIONAL, TOUCH, STATUS)
        line = peer.line()
        if event := left.pop(line["topic"].rsplit("/")[-1], None):
            same(line["data"], event)
    assert "a gesture of the daemon is passed over: id -1: expected uint64" in node.errors.read_text()


def taken(daemon: Daemon, before: int) -> bool:
    """Whether the daemon has looked at more frames than before."""
    return daemon.frames() > before


def test_frames_of_a_topic_become_gestures_and_what_is_none_is_dropped(ros: Ros, serve):
    daemon: Daemon = serve("--clock", "sensor", "--metrics", "127.0.0.1:0", model="cnn_lstm")
    peer, client, hand = ros.peer(), daemon.client().subscribe("gesture"), Hand()
    node = ros.node(socket=daemon.socket, frames=["armrest-1"], to=str(daemon.address))
    topic, moments = ros.topic("xarmrest_2d1", "frames"), itertools.count(1_700_000_000_000_000_000, 66_666_667)

    def publish(frame: Any) -> None:
        peer.say(image=topic, **image(frame, stamp=divmod(next(moments), 10**9)))

    while not daemon.frames():  # the first ones are lost until both sides know each other
        publish(hand.frame())
    for each in WRONG.values():
        peer.say(image=topic, **each)
    for frame in [*hand.idle(2.0), *hand.swipe("left"), *hand.idle(1.0)]:
        before = daemon.frames()
        publish(frame)
        wait(partial(taken, daemon, before))
    (event,) = client.events("gesture", "armrest-1")
    assert event["gesture"] == "swipe_left" and event["lost"] == 0
    assert "an image for armrest-1 is dropped: encoding '64FC1': expected '32FC1'" in node.errors.read_text()


def test_frames_have_the_numbers_and_the_time_of_their_images(ros: Ros, fake: FakeDaemon, udp):
    ros.node(socket=fake.path, frames=["armrest"], to=f"127.0.0.1:{udp.getsockname()[1]}")
    peer, decoder, counters = ros.peer(), Decoder(Addresses(), lambda sensor: FRAME.shape), []
    while len(counters) < 3:
        peer.say(image=ros.topic("armrest", "frames"), **image(FRAME, stamp=(1_700_000_000, 250_000_000)))
        if select.select([udp], [], [], 0.05)[0]:
            (arrival,), faults = decoder.decode(udp.recv(65536))
            assert not faults and (arrival.values == FRAME).all() and arrival.timetag == 1_700_000_000.25
            counters.append(arrival.counter)
    assert counters == [1, 2, 3]


def test_a_service_closes_and_opens_a_gate_in_the_nodes_own_name(ros: Ros, serve, tmp_path: Path):
    gates = tmp_path / "gates.sock"
    daemon: Daemon = serve("--gates", gates)
    Sensor(daemon, "armrest").begin()
    ros.node(socket=daemon.socket, gates=gates, gate="robot")
    peer, client = ros.peer(), daemon.client().subscribe("gate")
    service = ros.topic("armrest", "listen")
    peer.say(call=service, data=False)
    assert peer.line() == {"call": service, "success": True, "message": "closed: robot"}
    assert client.events("gate", "armrest")[-1]["closed"] == ["robot"]
    peer.say(call=service, data=True)
    assert peer.line() == {"call": service, "success": True, "message": "it listens"}
    assert client.events("gate", "armrest")[-1]["closed"] == []


def test_a_gate_that_cannot_be_closed_is_told(ros: Ros, serve, tmp_path: Path):
    daemon: Daemon = serve()
    Sensor(daemon, "armrest").begin()
    ros.node(socket=daemon.socket, gates=tmp_path / "nobody.sock")
    peer = ros.peer()
    peer.say(call=ros.topic("armrest", "listen"), data=False)
    answer = peer.line()
    assert not answer["success"] and str(tmp_path / "nobody.sock") in answer["message"]


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"types": ["gestur"]}, "gestur"),
        ({"types": "gesture"}, "types"),
        ({"messages": True}, "parameter messages: the package gestured_msgs is not there"),
        ({"frames": ["arm rest"]}, "parameter frames: 'arm rest': expected letters, digits, _ and -"),
        ({"frames": ["armrest"], "to": "9000"}, "parameter to: '9000': expected HOST:PORT"),
        ({"frames": ["armrest"], "to": "a..b:9000"}, "parameter to: 'a..b:9000': expected HOST:PORT"),
        ({"frames": ["armrest"], "to": "255.255.255.255:9"}, "cannot send to 255.255.255.255:9: Permission denied"),
        ({"gates": "/nowhere.sock", "gate": "my gate"}, "parameter gate: 'my gate': expected letters"),
    ],
)
def test_a_parameter_that_cannot_be_ends_the_node_with_one_sentence(ros: Ros, serve, parameters: Any, words: str):
    node = ros.node(socket=serve().socket, **parameters)
    assert node.process.wait(DEADLINE_S) == 1
    assert words in node.errors.read_text()
