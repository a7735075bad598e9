"""A gate that a real broker closes and opens, of a real daemon, through the bridge."""

import json
import shutil
import socket
import subprocess
import threading
import time
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gestured.bridge.broker import SILENT
from gestured.bridge.counts import Counts
from gestured.bridge.gates import OFF, ON, Gate
from gestured.bridge.mqtt_session import Mqtt
from gestured.client.control import Control
from gestured.client.lines import Refused
from tests.bridge.conftest import Broker, Process, guarded, page, served, wait
from tests.bridge.test_mqtt import Listener
from tests.daemon.harness import Client, Daemon, Sensor

SET, GATES = "gestured/car/armrest/gate/set", "gestured/car/armrest/gates"
ACCESS = """\
user car
topic write gestured/car/#
topic write homeassistant/+/gestured_car/#
topic read gestured/car/+/gate/set
user house
topic readwrite #
"""


@pytest.fixture(scope="module")
def shared(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon with a socket for bridges."""
    folder = tmp_path_factory.mktemp("gated")
    yield from served(folder, model, "--gates", folder / "gates.sock")


@pytest.fixture(scope="module")
def arm(shared: Daemon) -> Sensor:
    """Its sensor `armrest`."""
    return Sensor(shared, "armrest")


@pytest.fixture
def gated(shared: Daemon) -> Iterator[Daemon]:
    """The same daemon, whose gates are all open before each test."""
    yield shared
    with Control(Path(shared.ready["control"])) as operator:
        for gate in {name for told in operator.ask("status")["sensors"].values() for name in told["closed"]}:
            operator.ask("allow", gate=gate)


@pytest.fixture
def at(broker: Callable[..., Broker], tmp_path: Path) -> Broker:
    """A broker that knows the bridge and a house."""
    return broker(*guarded(tmp_path, "car:secret\nhouse:open\n", ACCESS))


@pytest.fixture
def house(at: Broker) -> Iterator[Listener]:
    """Whoever has the switch."""
    with closing(Listener(at.port, GATES, login=("house", "open"))) as house:
        yield house


def say(house: Listener, payload: str, topic: str = SET, *, retain: bool = False) -> None:
    """Publish a command, and wait until the broker has it."""
    house.client.publish(topic, payload, qos=1, retain=retain).wait_for_publish(timeout=20)


def start(bridge: Callable[..., Process], at: Broker, daemon: Daemon, *more: object) -> tuple[Process, dict[str, Any]]:
    """A bridge that hears commands."""
    sockets = ("--socket", daemon.socket, "--gates", daemon.ready["gates"])
    process = bridge(
        "mqtt", "--broker", at.address, "--host", "car", *sockets, *more,
        env={"MQTT_USER": "car", "MQTT_PASSWORD": "secret"},
    )  # fmt: skip
    ready = process.ready()
    wait(lambda: "Sending SUBACK to gestured-car" in at.said(), at.said)
    return process, ready


def known(daemon: Daemon, arm: Sensor) -> Client:
    """Who hears of a sensor that the daemon knows."""
    client = daemon.client().subscribe("gesture", "unknown", "gate")
    arm.begin().perform("left")
    assert client.line()["gesture"] == "swipe_left"
    return client


def test_what_the_bus_closes_it_opens_and_shows(bridge, at, gated, arm, house) -> None:
    client = known(gated, arm)
    start(bridge, at, gated, "--gate", "house")
    for command, closed in ((OFF, ["house"]), (ON, [])):
        say(house, command)
        assert client.line()["closed"] == closed
        house.until(GATES, json.dumps({"armed": None, "closed": closed, "until": None}))


def test_retained_and_senseless_commands_do_nothing(bridge, at, gated, arm, house) -> None:
    client = known(gated, arm)
    say(house, OFF, retain=True)  # before the bridge comes
    process, ready = start(bridge, at, gated, "--metrics", "127.0.0.1:0")
    say(house, OFF, retain=True)
    say(house, "off")
    say(house, OFF, "gestured/car/elbow/gate/set")
    say(house, "RECALIBRATE", "gestured/car/armrest/gate/set")
    with Control(Path(gated.ready["control"])) as operator:
        operator.ask("inhibit", gate="door")
    say(house, ON)  # opens its own gate alone, which is open
    counted = 'gestured_bridge_commands_total{bridge="mqtt",result="%s"} %s.0'
    wait(
        lambda: all(counted % each in page(ready["metrics"]) for each in (("retained", 1), ("wrong", 3), ("obeyed", 1)))
    )
    with Control(Path(gated.ready["control"])) as operator:
        assert operator.ask("status")["sensors"]["armrest"]["closed"] == ["door"]
    assert client.line()["closed"] == ["door"]
    for ignored in ("OFF", "off"):
        assert f"{SET}: {ignored!r} is ignored" in process.said(), "whoever sends it would look for its effect in vain"


def test_a_bridge_gives_signs_of_life_which_change_no_gate(gated: Daemon, arm: Sensor, monkeypatch) -> None:
    client = known(gated, arm)
    gate = Gate(Path(gated.ready["gates"]), "mqtt", Counts("mqtt"))
    monkeypatch.setattr("gestured.bridge.gates.ALIVE_S", 0.001)
    gate.obey("armrest", OFF)
    with Control(Path(gated.ready["control"])) as operator:
        wait(lambda: operator.ask("status")["overdue"])
        monkeypatch.setattr("gestured.bridge.gates.ALIVE_S", 60.0)
        gate.renew()
        assert operator.ask("status")["overdue"] == {}
        operator.ask("allow", gate="mqtt")
        operator.ask("inhibit", gate="mqtt", seconds=0.2)
        monkeypatch.setattr("gestured.bridge.gates.RENEWED_S", 0.0)
        gate._due = 0.0
        gate.renew()
        told = [client.line() for _ in range(4)]
        assert [bool(line["until"]) for line in told] == [False, False, True, False], "it opened by itself"
        assert told[-1]["closed"] == []
        gate.renew()
        assert operator.ask("status")["sensors"]["armrest"]["closed"] == []


@pytest.mark.parametrize(
    "answer", [{}, {"sensors": []}, {"sensors": {}}, {"sensors": {"armrest": 5}}, {"sensors": {"armrest": [5]}}]
)
def test_an_answer_of_a_mad_daemon_is_a_command_that_failed(tmp_path: Path, answer: dict[str, Any]) -> None:
    path = tmp_path / "gates.sock"
    with socket.create_server(str(path), family=socket.AF_UNIX) as server:

        def serve() -> None:
            with server.accept()[0] as connection:
                connection.recv(4096)
                connection.sendall(json.dumps({"ok": True, **answer}).encode() + b"\n")

        threading.Thread(target=serve).start()
        with pytest.raises(Refused, match="does not say which gates are closed"):
            Gate(path, "mqtt", Counts("mqtt")).obey("armrest", OFF)


def unconnected(monkeypatch: pytest.MonkeyPatch) -> Mqtt:
    """A bridge with a gate, and with neither a broker nor a daemon."""
    monkeypatch.setenv("MQTT_USER", "car")
    args = Namespace(
        host="car", broker="127.0.0.1", tls=False, ca=None, cert=None, sensors=None, gestures=None, gates=Path("none"),
        gate="mqtt", discovery="homeassistant", no_discovery=True,
    )  # fmt: skip
    return Mqtt(args, Counts("mqtt"))


def test_a_broker_that_falls_silent_is_not_taken_for_one_with_tls(monkeypatch: pytest.MonkeyPatch) -> None:
    broker, silence = unconnected(monkeypatch)._broker, SimpleNamespace(value=SILENT)
    assert broker.why(silence, 60.0) == "it no longer answers"
    assert "--tls" in broker.why(silence, None)


def test_a_command_that_comes_while_another_is_taken_is_obeyed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The broker's thread looks whether one waits, just as the bridge takes that one."""
    session, obeyed = unconnected(monkeypatch), list[str]()

    class Commands(dict[str, str]):
        def __contains__(self, sensor: object) -> bool:
            found = super().__contains__(sensor)
            if found and not obeyed:
                taker.start()
                taker.join(0.2)  # it would be done by now
            return found

    def obey(sensor: str, command: str) -> list[str]:
        obeyed.append(command)
        return []

    session._daemon.states, session._commands = {"armrest": "ok"}, Commands()
    taker = threading.Thread(target=lambda: session._serve(0.0))
    assert session._gate is not None
    session._gate.obey = obey  # type: ignore[method-assign]
    for command in (OFF, ON):
        session._hear(Namespace(topic=SET, payload=command.encode(), retain=False))
    taker.join()
    session._serve(0.0)
    session._hear(Namespace(topic=SET, payload=OFF.encode(), retain=False))
    session._serve(0.0)
    assert obeyed in ([ON, OFF], [OFF, ON, OFF])


def test_no_command_that_still_waits_holds_up_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each may take as long as a daemon that hangs is waited for."""
    session, obeyed = unconnected(monkeypatch), list[str]()

    def obey(sensor: str, command: str) -> list[str]:
        obeyed.append(sensor)
        session.stop()  # as a signal does in the middle of it
        return []

    assert session._gate is not None
    session._daemon.states = {"armrest": "ok", "console": "ok"}
    session._gate.obey = obey  # type: ignore[method-assign]
    for topic in (SET, SET.replace("armrest", "console")):
        session._hear(Namespace(topic=topic, payload=OFF.encode(), retain=False))
    session._due = time.monotonic() + 600  # no broker is called
    session.work()
    assert obeyed == ["armrest"]


def test_a_broker_that_lets_nobody_hear_commands_is_none_for_gates(bridge, broker, gated, tmp_path: Path) -> None:
    """As mosquitto's own plugin refuses it; a switch that did nothing would stand in Home Assistant."""
    plugin = next(Path("/usr/lib").glob("*/mosquitto_dynamic_security.so"), None)
    if plugin is None or shutil.which("mosquitto_ctrl") is None:
        pytest.skip("mosquitto and its plugin are not installed (apt-get install mosquitto)")
    file = tmp_path / "security.json"
    subprocess.run(["mosquitto_ctrl", "dynsec", "init", file, "car"], input=2 * "secret\n", text=True, check=True)
    known = json.loads(file.read_text())
    known["roles"][0]["acls"] = [{"acltype": "publishClientSend", "topic": "#", "allow": True}]
    file.write_text(json.dumps(known))
    at = broker("allow_anonymous false", f"plugin {plugin}", f"plugin_opt_config_file {file}", "user root")
    process = bridge(
        "mqtt", "--broker", at.address, "--host", "car", "--socket", gated.socket, "--gates", gated.ready["gates"],
        env={"MQTT_USER": "car", "MQTT_PASSWORD": "secret"},
    )  # fmt: skip
    assert process.end() == 1
    said = process.said()
    assert "does not let us hear commands" in said and "allow this user to read gestured/car/+/gate/set" in said


def test_without_a_daemon_a_command_fails_as_it_says_each_time_and_the_next_one_is_obeyed(
    bridge, at, gated, arm, house
) -> None:
    process, _ = start(bridge, at, gated)
    client = known(gated, arm)
    path = Path(gated.ready["gates"])

    def has_failed(times: int) -> bool:
        say(house, OFF)
        return process.said().count("start gestured, or name its --gates") >= times

    for times, command, closed in ((1, OFF, ["mqtt"]), (2, ON, [])):
        path.rename(path.with_suffix(".away"))
        wait(partial(has_failed, times))
        path.with_suffix(".away").rename(path)
        say(house, command)
        assert client.line()["closed"] == closed


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ([], "--gates: a broker that knows nobody may close no gate: set MQTT_USER and MQTT_PASSWORD"),
        (["--gate", "a/b"], "argument --gate: 'a/b': expected 1 to 64 of A-Z a-z 0-9 _ -"),
    ],
)
def test_what_cannot_be_is_one_sentence(refused, monkeypatch, tmp_path: Path, flags: list[str], words: str) -> None:
    monkeypatch.setenv("MQTT_USER", "car" if flags else "")  # empty: not set
    said = refused("mqtt", "--broker", "localhost", "--socket", tmp_path / "x.sock", "--gates", tmp_path / "g", *flags)
    assert words in said and "Traceback" not in said
