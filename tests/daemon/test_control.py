"""The control socket of a real daemon: who may, what is refused, and what each verb does."""

import json
import os
import re
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_message import OscMessage
from pythonosc.osc_packet import OscPacket

from gestured.client.control import Control
from gestured.client.lines import Refused, Unreachable
from gestured.daemon.bound import bind_all
from gestured.daemon.request import Refusal, Verb, parse_request
from gestured.daemon.sockets import AddressError
from tests.daemon import tiny_model
from tests.daemon.harness import Daemon, Sensor, running
from tests.daemon.parts import settings_of

SLOW = ("--stale-s", 30)  # on a busy machine no sensor is stale


@pytest.fixture(scope="module")
def daemon(model: Path, tmp_path_factory: pytest.TempPathFactory):
    """One for the verbs that leave no trace that another test could trip over."""
    with running(tmp_path_factory.mktemp("control"), model, "--flight-recorder", 1, *SLOW) as daemon:
        yield daemon


@pytest.mark.parametrize(
    ("socket", "gates", "said"),
    [
        ("a.ctl", "g", "control: .*a.ctl is another socket of this daemon, choose another path with --control"),
        ("a.sock", "a.sock", "gates: .*a.sock is another socket of this daemon, choose another path with --gates"),
        ("a.sock", "a.ctl", "gates: .*a.ctl is another socket of this daemon, choose another path with --gates"),
    ],
)
def test_no_socket_can_stand_where_another_one_stands(tmp_path: Path, socket: str, gates: str, said: str) -> None:
    flags = ("--listen", "127.0.0.1:0", "--socket", tmp_path / socket, "--gates", tmp_path / gates)
    with pytest.raises(AddressError, match=said):
        bind_all(settings_of(*flags)[0])
    assert list(tmp_path.iterdir()) == []


def test_a_stranger_is_refused_even_where_the_file_lets_him_in(start, nobody) -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        daemon = start("--control", f"{folder}/control")
        path = Path(daemon.ready["control"])
        with nobody(), pytest.raises(Unreachable, match="Permission denied"):
            Control(path)
        os.chmod(path, 0o666)
        with nobody():
            control = Control(path)
        with control, pytest.raises(Refused, match="group"):
            control.ask("status")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"hello\n", ("JSON object",)),
        (b"[]\n", ("verb",)),
        (b'{"verb":"launch"}\n', ("verb", '"launch"', "status")),
        (b'{"verb":"emit"}\n', ("emit.gesture", "missing")),
        (b'{"verb":"emit","gesture":7}\n', ("emit.gesture", "7", "a text")),
        (b'{"verb":"emit","gesture":"wink"}\n', ("wink", "one_tap")),
        (b'{"verb":"emit","gesture":"one_tap","sensor":"a b"}\n', ("emit.sensor", '"a b"')),
        (b'{"verb":"emit","gesture":"one_tap","loud":true}\n', ("emit", '"loud"', "gesture, sensor")),
        (b'{"verb":"status","x":1}\n', ("status", '"x"', "no key")),
        (b'{"verb":"recalibrate","sensor":"nobody"}\n', ("nobody",)),
        (b"[" * 4000 + b"\n", ("JSON object",)),
        (b"\xff\n", ("JSON object",)),
    ],
)
def test_a_bad_request_is_answered_and_the_connection_goes_on(daemon: Daemon, line: bytes, said: tuple[str]) -> None:
    with daemon.control() as control:
        control.socket.sendall(line)
        answer = next(control.lines())
        assert answer["ok"] is False and all(word in answer["reason"] for word in said), answer
        assert control.ask("status")["state"] in ("ok", "no_data")


def test_a_request_that_is_too_long_is_refused(daemon: Daemon) -> None:
    with daemon.control() as control, pytest.raises(Refused, match="4096"):
        control.ask("emit", gesture="x" * 100_000)


def test_a_test_event_is_marked_on_every_output_and_keeps_the_numbers(start, udp: socket.socket) -> None:
    to = f"osc://127.0.0.1:{udp.getsockname()[1]}"
    daemon = start("--clock", "sensor", "--publish", to, "--publish-provisional", "true")
    client = daemon.client().subscribe("gesture", "onset", "release")
    assert daemon.ask("emit", gesture="swipe_up", sensor="arm")["sequence"] == 1
    assert [(e["type"], e["id"], e["test"]) for e in (client.line() for _ in range(3))] == [
        ("onset", 1, True), ("gesture", 1, True), ("release", 1, True),
    ]  # fmt: skip
    found: list[OscMessage] = []
    while len(found) < 5:
        messages = [timed.message for timed in OscPacket(udp.recv(9999)).messages]
        found += [message for message in messages if message.address != "/gestured/status"]
    assert [(message.address, message.params[:3]) for message in found] == [
        ("/gestured/test", ["arm"]), ("/gestured/arm/provisional", ["swipe_up", 1.0, 1]),
        ("/gestured/test", ["arm"]), ("/gestured/arm/gesture", ["swipe_up", 1.0, 1]),
        ("/gestured/arm/where", [1, 0.5, 0.5]),
    ]  # fmt: skip
    assert daemon.client().hello["sensors"] == {"arm": 1}
    Sensor(daemon, "arm").begin().perform("left")  # the sensor comes: its gestures are numbered on, unmarked
    (event,) = client.events("gesture", "arm")
    assert (event["gesture"], event["id"], event["sequence"]) == ("swipe_left", 2, 2) and "test" not in event
    assert daemon.ask("emit", gesture="one_tap", sensor="arm")["sequence"] == 3


def test_recalibration_is_refused_while_touched(daemon: Daemon) -> None:
    client = daemon.client().subscribe("onset", "gesture", "unknown", sensors=["arm"])
    sensor = Sensor(daemon, "arm").begin()
    sensor.send([sensor.hand.frame(4.0) for _ in range(5)])
    client.events("onset", "arm")
    with daemon.control() as control:
        with pytest.raises(Refused, match=r"touched: arm"):
            control.ask("recalibrate")
        with pytest.raises(Refused, match=r"arm is touched"):
            control.ask("emit", gesture="one_tap", sensor="arm")
        sensor.send(sensor.hand.idle(2.0))
        client.until(lambda line: line["type"] in ("gesture", "unknown"))
        assert control.ask("recalibrate", sensor="arm") == {"ok": True, "sensors": ["arm"]}
        assert control.ask("status")["sensors"]["arm"]["state"] == "starting"


def test_a_reload_names_what_only_a_restart_changes_until_it_is_as_before(start, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text("")
    daemon = start("--config", config)
    with daemon.control() as control:
        for text, named in (
            ("tap_gap_s = 0.3", []),
            ("flight_recorder = 4", ["flight_recorder"]),
            ("flight_recorder = 4\ntap_gap_s = 0.4", ["flight_recorder"]),
            ("tap_gap_s = 0.4", []),
            ("tap_gap_s = 0.4\n[gates]\nstart = ['door']\nsocket = '/tmp/gates'", ["gates"]),
        ):
            config.write_text(text)
            assert control.ask("reload")["awaiting_restart"] == named
        assert control.ask("status")["gates"] == []


def test_the_flight_recorder_gives_what_it_held(daemon: Daemon, shared: Daemon) -> None:
    client = daemon.client()
    Sensor(daemon, "flown").begin().perform("left")
    client.events("gesture", "flown")
    with daemon.control() as control:
        answer = control.ask("flight")
        lines = []
        for line in control.lines():
            if line["type"] == "end":
                break
            lines.append(line)
    assert len(lines) == answer["lines"]
    assert sum(line["type"] == "packet" for line in lines) >= 2 * 15 + 7
    assert "swipe_left" in {line.get("gesture") for line in lines}
    with shared.control() as control, pytest.raises(Refused, match="flight_recorder"):
        control.ask("flight")


def test_a_tap_that_nobody_reads_loses_packets_is_told_and_holds_nobody_up(start) -> None:
    daemon = start("--clock", "sensor")
    with daemon.control() as control:
        control.ask("tap")
        packet = os.urandom(30_000)
        with socket.socket(type=socket.SOCK_DGRAM) as sender:
            sender.connect(daemon.address)
            with daemon.control() as other:
                taken = 0  # packets that the daemon has read: on a busy machine the kernel drops some before
                while taken < 300:  # as lines 12 MiB, more than the daemon keeps for a tap that does not read
                    for _ in range(30):
                        sender.send(packet)
                    status = other.ask("status")
                    assert status["taps"] == 1
                    taken = sum(status["input"]["dropped"].values())
        client = daemon.client()
        Sensor(daemon, "arm").begin().perform("left")
        assert client.events("gesture", "arm")
        lost = next(line["count"] for line in control.lines() if line["type"] == "lost")
        assert 0 < lost < taken + 100


def test_a_sensor_of_the_file_that_was_never_heard_has_no_data(start, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text("[sensors.door]\ngrid = '5x5'\n")
    daemon = start("--config", config, "--metrics", "127.0.0.1:0")
    status = daemon.client().subscribe("status").line()
    assert (status["state"], status["sensors"]) == ("no_data", {"door": "no_data"})
    assert daemon.metric("gestured_sensor_state", sensor="door", state="no_data") == 1
    sensor = daemon.ask("status")["sensors"]["door"]
    assert (sensor["state"], sensor["grid"], sensor["rate_hz"]) == ("no_data", "5x5", 0.0)


def test_gestures_unlike_those_of_the_training_are_said_to_be(start, tmp_path: Path) -> None:
    ranges = {"at": [0.01, 0.99], "strength": [1, 1e6], "duration_s": [2.0, 3.0], "area": [0.0, 1.0]}
    model = tiny_model.make(tmp_path / "slow.onnx", quantiles=json.dumps(ranges))  # knows slow gestures alone
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", model=model)
    client = daemon.client()
    sensor = Sensor(daemon, "arm").begin()
    for _ in range(5):  # one more than must be: what is looked at comes after its event
        sensor.perform(*["left", "right", "up", "down", "left"])
        client.events("gesture", "arm", 5)
    assert daemon.metric("gestured_shift_ratio", quantity="duration_s") == 1.0
    assert daemon.metric("gestured_shift_ratio", quantity="area") == 0.0
    assert json.loads(daemon.get("/readyz")[1])["shift"] == ["duration_s"]
    assert daemon.ask("status")["shift"]["unlike"] == ["duration_s"]


words = st.sampled_from(["verb", "emit", "gesture", "status"])
flat = st.none() | st.booleans() | st.integers() | st.text(max_size=9) | words
values = flat | st.lists(flat, max_size=4) | st.dictionaries(words, flat | st.lists(flat, max_size=2), max_size=4)


@given(st.binary(max_size=200) | values.map(lambda value: json.dumps(value).encode()))
def test_any_line_is_a_request_that_fits_the_table_or_is_refused(line: bytes) -> None:
    async def status(connection):
        return {}

    async def emit(connection, gesture: str):
        return {}

    table = {"status": Verb(status), "emit": Verb(emit)}
    try:
        name, parameters = parse_request(line, table)
    except Refusal as refusal:
        assert str(refusal)
    else:
        assert (name, list(parameters)) in (("status", []), ("emit", ["gesture"]))
        assert all(isinstance(value, str) for value in parameters.values())


DOCUMENT = (Path(__file__).resolve().parents[2] / "docs" / "control.md").read_text()


def test_the_table_of_verbs_in_the_documents(daemon: Daemon) -> None:
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \|", DOCUMENT, re.MULTILINE)
    described = {verb: tuple(re.findall(r"`(\w+)`", keys)) for verb, keys in rows}
    with daemon.control() as control:
        with pytest.raises(Refused) as unknown:
            control.ask("?")
        assert set(str(unknown.value).partition("expected one of ")[2].split(", ")) == set(described)
        for verb, keys in described.items():
            with pytest.raises(Refused, match=f'unknown key "x", expected {", ".join(keys) or "no key"}$'):
                control.ask(verb, x=1)


def test_the_example_in_the_documents(daemon: Daemon) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL)
    code = code.replace("/run/gestured/events.ctl", daemon.ready["control"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.stdout.split()[1:] == ["tiny"], done.stderr
