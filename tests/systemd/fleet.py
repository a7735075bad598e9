"""`make system-test`, of several instances and their bridges: as docs/fleet.md and docs/connect.md tell a user."""

import json
import queue
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path

import pytest

from tests.documents.blocks import blocks
from tests.systemd.conftest import ROOT
from tests.systemd.container import DEADLINE_S, NETWORK, Container, missing, wait
from tests.systemd.vehicle import Vehicle, steady

HERE = "tests/systemd/fleet.py::"
FRAMES = 20  # that a sensor sends to be heard, or not
SOCKETS = ("gestured-osc.socket", "gestured-events.socket", "gestured-metrics.socket")
NO_END = 1_000_000  # frames

pytestmark = [
    pytest.mark.skipif(missing() is not None, reason=f"no container here: {missing()}"),
    pytest.mark.timeout(300),
]


def example(name: str) -> str:
    """The example that this test, or this fixture, runs."""
    (block,) = blocks("run", HERE + name)
    return block.text


class Bus:
    """A broker and a router in the container, and what is published there."""

    def __init__(self, box: Container, folder: Path) -> None:
        for module in ("zenoh", "paho.mqtt.client"):
            pytest.importorskip(module, reason="the bridges need the extras [mqtt] and [zenoh]")
        if shutil.which("mosquitto", path="/usr/sbin:/usr/bin") is None:
            pytest.skip("mosquitto is not installed (apt-get install mosquitto)")
        file = folder / "mosquitto.conf"
        file.write_text("listener 1883 0.0.0.0\nallow_anonymous true\n")
        network = ["nsenter", f"--net=/proc/{box.leader}/ns/net", f"--wd={ROOT}"]
        self._broker = subprocess.Popen([*network, "mosquitto", "-c", file], stderr=subprocess.DEVNULL)
        wait("the broker", lambda: box.run("ss", "-Hltn", "sport = :1883").stdout)
        command = [*network, sys.executable, "-m", "tests.systemd.bus"]
        self._listener = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
        assert self._listener.stdout is not None and self._listener.stdout.readline() == "ready\n"
        self._heard: queue.Queue[tuple[str, str, str]] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._listener.stdout is not None
        for line in self._listener.stdout:
            self._heard.put(tuple(json.loads(line)))

    def until(self, *expected: tuple[str, str], holds: Callable[[str], bool] = bool) -> dict[tuple[str, str], str]:
        """What is said under each of these (bus, key), once that holds; what else comes meanwhile is passed over."""
        found: dict[tuple[str, str], str] = {}
        end = time.monotonic() + DEADLINE_S
        while missing := [each for each in expected if each not in found]:
            assert time.monotonic() < end, f"not heard: {missing}"
            with suppress(queue.Empty):
                bus, key, text = self._heard.get(timeout=1.0)
                if holds(text):
                    found[bus, key] = text
        return found

    def close(self) -> None:
        """End both."""
        for process in (self._listener, self._broker):
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def fleet(box: Container) -> Iterator[dict[str, Vehicle]]:
    """Two instances, as the document makes them."""
    said = box.follow(example("fleet"))
    assert "/run/gestured-left/events.ctl " in said and "/run/gestured-right/events.ctl " in said
    yield {"left": Vehicle(box, "gestured@left", 9001, 9111), "right": Vehicle(box, "gestured@right", 9002, 9112)}
    box.run("systemctl", "disable", "--now", "gestured@left", "gestured@right")


@pytest.fixture(scope="module")
def bus(box: Container, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bus]:
    """The buses, before any bridge."""
    with closing(Bus(box, tmp_path_factory.mktemp("bus"))) as bus:
        yield bus


@pytest.fixture(scope="module")
def bridges(box: Container, fleet: dict[str, Vehicle], bus: Bus) -> Iterator[None]:
    """A bridge to MQTT for each instance, and one to Zenoh, as the document makes them."""
    box.follow(example("bridges"))
    there = [("mqtt", f"gestured/{name}/availability") for name in fleet]
    bus.until(*there, ("zenoh", "gestured/left/alive"), holds="online".__eq__)
    yield
    box.run("systemctl", "disable", "--now", "gestured-bridge@left", "gestured-bridge@right", "gestured-bridge@site")


def known(vehicle: Vehicle, sensor: str) -> bool:
    """Whether the daemon runs and knows the idle sensor."""
    return bool(vehicle.status().get("sensors", {}).get(sensor, {}).get("state") == "ok")


def test_a_swipe_comes_out_of_its_own_instance_alone_and_under_its_name(
    fleet: dict[str, Vehicle], bridges: None, bus: Bus
):
    with ExitStack() as stack:
        clients = {name: stack.enter_context(closing(each.client())) for name, each in fleet.items()}
        for name, each in fleet.items():
            stack.enter_context(each.swiped(f"arm-{name}"))
        heard = {name: client.line() for name, client in clients.items()}
        told = bus.until(
            ("mqtt", "gestured/left/arm-left/gesture"),
            ("mqtt", "gestured/right/arm-right/gesture"),
            ("zenoh", "gestured/left/arm-left/gesture"),
            holds=lambda text: text.startswith("{"),
        )
    for name, event in heard.items():
        assert (event["sensor"], event["gesture"]) == (f"arm-{name}", "swipe_left")
        assert {**event, "instance": fleet[name].instance()} == json.loads(
            told["mqtt", f"gestured/{name}/arm-{name}/gesture"]
        )
        assert list(fleet[name].status()["sensors"]) == [f"arm-{name}"]
    assert told["mqtt", "gestured/left/arm-left/gesture"] == told["zenoh", "gestured/left/arm-left/gesture"]


def test_one_instance_is_killed_and_the_other_and_the_buses_go_on(
    box: Container, fleet: dict[str, Vehicle], bridges: None, bus: Bus
):
    left, right = fleet["left"], fleet["right"]
    sensors = {name: each.sensor("killed") for name, each in fleet.items()}
    stop = threading.Event()
    senders = [steady(sensor, NO_END, stop) for sensor in sensors.values()]
    try:
        wait("both sensors", lambda: known(left, "killed") and known(right, "killed"))
        before = left.instance(), right.instance()
        box.run("systemctl", "kill", "--signal=SIGKILL", "gestured@left")
        gone = ("mqtt", "gestured/left/availability"), ("zenoh", "gestured/left/alive")
        bus.until(*gone, holds="offline".__eq__)
        bus.until(*gone, holds="online".__eq__)
        wait("the killed one's sensor", lambda: known(left, "killed"))
    finally:
        stop.set()
        for sender in senders:
            sender.join()
    assert box.run("systemctl", "show", "-P", "NRestarts", "gestured@left", "gestured@right").stdout.split() == [
        "1",
        "0",
    ]
    assert left.instance() != before[0] and right.instance() == before[1]
    wait("every frame that was sent to the other", lambda: right.frames("killed") == sensors["right"].count)
    status = right.status()
    assert status["sensors"]["killed"]["lost"] == status["input"]["kernel_drops"] == 0

    box.run("gesturectl", "emit", "swipe_left", "--sensor", "killed", "--control", left.control)
    said = bus.until(
        ("mqtt", "gestured/left/killed/gesture"),
        ("zenoh", "gestured/left/killed/gesture"),
        holds=lambda text: text[0] == "{",
    )
    assert json.loads(said["mqtt", "gestured/left/killed/gesture"])["instance"] == left.instance()


def heard_from(vehicle: Vehicle, sensor: str) -> int:
    """Frames that the daemon has heard from the network, once it has heard those from its own machine behind them."""
    far, near = vehicle.sensor(f"{sensor}-far", NETWORK), vehicle.sensor(f"{sensor}-near")
    for each in (far, near):
        each.send([each.hand.frame() for _ in range(FRAMES)])
    wait("its own machine's frames", lambda: vehicle.frames(near.name) == FRAMES)
    return vehicle.frames(far.name)


def test_an_instance_hears_its_own_machine_alone_until_the_drop_in_names_a_network(
    box: Container, fleet: dict[str, Vehicle]
):
    name = "test_an_instance_hears_its_own_machine_alone_until_the_drop_in_names_a_network"
    assert [heard_from(each, "closed") for each in fleet.values()] == [0, 0]
    for each in fleet.values():  # what the unit refuses, the kernel counts as dropped
        assert "IPAddressAllow=" in box.run("gesturectl", "doctor", "--control", each.control, check=False).stdout
    box.follow(example(name))
    assert [heard_from(each, "opened") for each in fleet.values()] == [FRAMES, FRAMES]


def connected(box: Container, unit: str) -> str:
    """What a bridge says of itself."""
    return box.run("systemctl", "show", "-P", "StatusText", unit).stdout


def test_the_bridge_has_the_network_that_its_drop_in_names_and_the_service_has_none(box: Container, bus: Bus):
    box.run("systemctl", "start", "gestured.service")
    try:
        box.follow(example("test_the_bridge_has_the_network_that_its_drop_in_names_and_the_service_has_none"))
        topic = f"gestured/{box.run('hostname').stdout.strip()}/armrest/gesture"
        wait("the bridge", lambda: connected(box, "gestured-bridge@house").startswith("connected"))
        box.run("gesturectl", "emit", "swipe_left", "--sensor", "armrest")
        bus.until(("mqtt", topic))
        process = box.run("systemctl", "show", "-P", "MainPID", "gestured").stdout.strip()
        own = box.run("nsenter", f"--net=/proc/{process}/ns/net", "ip", "-json", "address").stdout
        assert NETWORK not in own

        box.run("rm", "-r", "/etc/systemd/system/gestured-bridge@house.service.d")
        box.run("systemctl", "daemon-reload")
        box.run("systemctl", "restart", "gestured-bridge@house")
        wait("its complaint", lambda: f"broker {NETWORK}:1883 is not there" in connected(box, "gestured-bridge@house"))
    finally:
        box.run("systemctl", "disable", "--now", "gestured-bridge@house")
        box.run("systemctl", "stop", "gestured.service", *SOCKETS)


ASK = """
import contextlib, json, socket, sys
with socket.socket(socket.AF_UNIX) as daemon:
    daemon.connect(sys.argv[1])
    with contextlib.suppress(BrokenPipeError):  # who is refused is told so at once
        daemon.sendall(sys.argv[2].encode() + b"\\n")
    print(daemon.makefile().readline())
"""


def test_a_bridge_may_close_its_gate_and_can_command_nothing(box: Container):
    """As its unit's groups let it, of the activated service and of an instance, whose sockets the daemon makes."""
    wanted = box.run("systemctl", "show", "-P", "SupplementaryGroups", "gestured-bridge@house").stdout.split()
    groups = ",".join(box.run("getent", "group", name).stdout.split(":")[2] for name in wanted)

    def ask(path: str, **request: object) -> str:
        as_bridge = ("setpriv", "--reuid=4001", "--regid=4001", f"--groups={groups}")
        done = box.run(*as_bridge, "python3", "-c", ASK, path, json.dumps(request), check=False)
        return done.stdout + done.stderr

    try:
        box.follow(example("test_a_bridge_may_close_its_gate_and_can_command_nothing"))
        closing = {"verb": "inhibit", "bridge": "mqtt", "gate": "mqtt", "seconds": 30}
        assert '"ok":true' in ask("/run/gestured/gates.sock", **closing)
        assert 'unknown \\"reload\\", expected one of inhibit, allow' in ask("/run/gestured/gates.sock", verb="reload")
        box.run("systemctl", "start", "gestured@left")
        for folder in ("/run/gestured", "/run/gestured-left"):
            assert '"type":"hello"' in ask(f"{folder}/events.sock", subscribe={})
            for verb in ("reload", "tap", "enrol", "recalibrate", "status", "allow"):
                said = ask(f"{folder}/events.ctl", verb=verb)
                assert "Permission denied" in said or "only root, the daemon's user and its group" in said, said
    finally:
        box.run("systemctl", "disable", "--now", "gestured-gates.socket", check=False)
        box.run("systemctl", "stop", "gestured@left", "gestured.service", *SOCKETS, check=False)
