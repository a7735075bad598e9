"""Sensors on pseudo-terminals: from the simulator through the bridge to the real daemon, and what may go wrong."""

import argparse
import os
import pty
import select
import signal
import socket
import stat
import struct
import subprocess
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from serial import SerialTimeoutException

from gestured.bridge import serial
from gestured.bridge.counts import Counts
from gestured.bridge.serial import AGAIN_S, Serial
from gestured.client.osc_out import dated
from gestured.core.address import Address
from gestured.core.wire import Addresses, Decoder
from tests.bridge.conftest import Process, page, served, wait
from tests.bridge.test_protocols import message, slip_encoded, written
from tests.daemon.harness import DEADLINE_S, Daemon, Hand, Sensor, blob, floats
from tests.sockets import free_address

pytest.importorskip("serial", reason="the bridge from serial lines needs the extra [serial]")

GRID = {"flexitac": "9x9", "csv": "9x9", "osc-slip": "9x9", "e256": "16x16"}


class Line:
    """A serial line: the sensor's end is ours, the other one a link in a folder, as udev makes them."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.plug()

    def plug(self) -> None:
        """A new device; the old one is unplugged."""
        self.end, other = pty.openpty()
        tty.setraw(self.end)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(other))
        os.close(other)

    def unplug(self) -> None:
        """Gone, and its name with it."""
        os.close(self.end)
        self.link.unlink()

    def say(self, data: bytes) -> None:
        """As the sensor."""
        while data:
            data = data[os.write(self.end, data) :]

    def flood(self, process: Process, data: bytes) -> None:
        """The same again and again, until the bridge has ended."""
        os.set_blocking(self.end, False)
        while process.process.poll() is None:
            with suppress(BlockingIOError):  # it does not read any more
                os.write(self.end, data)
            select.select([], [self.end], [], 0.05)

    def hear(self, count: int) -> bytes:
        """So many bytes that the bridge says to the sensor."""
        found = b""
        while len(found) < count:
            readable, _, _ = select.select([self.end], [], [], DEADLINE_S)
            assert readable, found
            found += os.read(self.end, count - len(found))
        return found


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Line]:
    line = Line(tmp_path / "ttyUSB0")
    yield line
    os.close(line.end)


def begin(
    bridge: Callable[..., Process],
    line: Line,
    protocol: str,
    udp: socket.socket,
    *more: object,
    sensor: str = "armrest",
) -> Process:
    """A bridge on the line that sends to a socket, open."""
    to = f"127.0.0.1:{udp.getsockname()[1]}"
    grid = () if "--grid" in more else ("--grid", GRID[protocol])
    process = bridge("serial", line.link, "--protocol", protocol, "--sensor", sensor, "--to", to, *grid, *more)
    assert process.ready()["device"] == str(line.link)
    return process


class Out:
    """The frames that reach the socket, by the daemon's own decoder."""

    def __init__(self, udp: socket.socket, shape: tuple[int, int] = (9, 9)) -> None:
        self.udp, self._decoder = udp, Decoder(Addresses(), lambda sensor: shape)

    def next(self) -> Any:
        """The next frame as it arrives."""
        (arrival,), faults = self._decoder.decode(self.udp.recv(65536))
        assert not faults and arrival.sensor == "armrest"
        return arrival


@pytest.fixture(scope="module")
def knows_grids(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that knows the sensors of the test below, which are named by their protocols."""
    folder = tmp_path_factory.mktemp("grids")
    grids = {name: grid for protocol, grid in GRID.items() for name in (protocol, f"direct-{protocol}")}
    settings = "".join(f'[sensors.{name}]\ngrid = "{grid}"\n' for name, grid in grids.items())
    (folder / "gestured.toml").write_text(settings)
    yield from served(folder, model, "--config", folder / "gestured.toml")


@pytest.mark.parametrize("protocol", sorted(GRID))
def test_simulator_to_pty_to_bridge_to_daemon_gives_the_events_of_udp(bridge, line, udp, knows_grids, protocol):
    """Each frame goes to one sensor by UDP and to another one through the line, with the same time."""
    daemon = knows_grids
    process = begin(bridge, line, protocol, udp, sensor=protocol)
    client = daemon.client().subscribe("gesture", "unknown", "cancelled")
    hand = Hand()
    direct = Sensor(daemon, f"direct-{protocol}", floats if protocol in ("csv", "osc-slip") else blob("u1"))
    around = Sensor(daemon, protocol).sock
    performed = [*hand.idle(2.0)]
    for motion in (hand.swipe("left"), hand.tap(), hand.swipe("up"), hand.swipe("down")):
        performed += [*motion, *hand.idle(1.0)]
    if protocol == "csv":
        line.say(b"cut off\n")
    for frame in performed:
        if protocol == "e256":
            frame = np.pad(frame, ((3, 4), (3, 4)), "edge")
            assert line.hear(10) == b"\xc0/r\0\0,\0\0\0\xc0"
        sent = direct.packet(frame)
        direct.sock.send(sent)
        line.say(written(protocol, frame))
        packet = udp.recv(65536)
        around.send(packet[:8] + sent[8:16] + packet[16:])  # at the same time
    events = {direct.name: [], protocol: []}
    while min(map(len, events.values())) < 4:
        event = client.line()
        events[event["sensor"]].append(
            {key: event.get(key) for key in ("type", "gesture", "id", "confidence", "scores", "frames", "lost")}
        )
    assert events[direct.name] == events[protocol]
    assert [event["gesture"] for event in events[protocol]] == ["swipe_left", "one_tap", "swipe_up", "swipe_down"]
    assert process.stop() == 0


def frame(value: int, shape: tuple[int, int] = (9, 9)) -> np.ndarray:
    return np.full(shape, value, np.uint8)


def test_a_sensor_without_a_counter_gets_one_and_one_with_a_counter_keeps_it(bridge, line, udp):
    out = Out(udp)
    process = begin(bridge, line, "flexitac", udp, "--metrics", "127.0.0.1:0")
    where = process.told["metrics"]
    line.say(b"rubbish")
    for n in range(1, 5):
        line.say(written("flexitac", frame(n)))
        arrival = out.next()
        assert (arrival.values == n).all() and arrival.counter == n
    wait(lambda: 'gestured_bridge_frames_total{bridge="serial",result="sent"} 4.0' in page(where))
    assert 'gestured_bridge_bytes_total{bridge="serial",result="passed"} 7.0' in page(where)
    process.stop()
    begin(bridge, line, "csv", udp)
    line.say(b"\n" + ",".join(["900", *["1.5"] * 81]).encode() + b"\n")
    arrival = out.next()
    assert (arrival.values == 1.5).all() and arrival.counter == 900


def test_a_sensor_without_a_time_of_its_own_gets_none_and_one_with_a_time_keeps_it(bridge, line, udp):
    """The time at which the bridge reads a frame is later than its own when this host was slow."""
    out = Out(udp)
    begin(bridge, line, "osc-slip", udp)
    line.say(written("osc-slip", frame(1)))
    assert out.next().timetag is None
    line.say(slip_encoded(dated(1000.5, message("/x", *map(float, range(81))))))
    assert out.next().timetag == 1000.5


def test_a_slow_host_gets_the_latest_frames(bridge, line, udp):
    out = Out(udp)
    process = begin(bridge, line, "flexitac", udp)
    line.say(written("flexitac", frame(0)))
    out.next()
    process.process.send_signal(signal.SIGSTOP)
    for n in range(1, 41):  # as many as a terminal's buffer takes
        line.say(written("flexitac", frame(n)))
    process.process.send_signal(signal.SIGCONT)
    arrivals = [out.next()]
    while not (arrivals[-1].values == 40).all():
        arrivals.append(out.next())
    assert arrivals[-1].counter == 41
    assert len(arrivals) < 20
    for arrival in arrivals:  # who is missing can be counted
        assert (arrival.values == arrival.counter - 1).all()


def test_an_unplugged_sensor_is_waited_for(bridge, line, udp):
    out = Out(udp)
    process = begin(bridge, line, "flexitac", udp)
    line.say(written("flexitac", frame(1)))
    out.next()
    line.unplug()
    process.until("waiting for it")
    line.plug()
    process.until("is open", 2)
    line.say(written("flexitac", frame(2)))
    arrival = out.next()
    assert (arrival.values == 2).all() and arrival.counter == 2


def test_a_sensor_that_is_plugged_in_later_is_waited_for(bridge, tmp_path):
    link = tmp_path / "ttyUSB0"
    process = bridge("serial", link, "--protocol", "csv", "--sensor", "armrest", "--to", "127.0.0.1:1")
    process.until(f"{link} is not there: No such file or directory; waiting for it")
    line = Line(link)
    process.ready()
    os.close(line.end)


def test_a_sensor_that_does_not_answer_is_asked_again(bridge, line, udp):
    begin(bridge, line, "e256", udp)
    assert line.hear(20) == 2 * b"\xc0/r\0\0,\0\0\0\xc0"


def test_a_device_that_takes_no_request_is_given_time_before_it_is_opened_again(monkeypatch, capfd) -> None:
    opened: list[str] = []
    slept: list[float] = []

    class Stuck:
        def __init__(self, device: str, *_: object, **__: object) -> None:
            opened.append(device)
            if len(opened) == 3:
                bridge.stop()

        def __enter__(self) -> "Stuck":
            return self

        def __exit__(self, *_: object) -> None: ...

        def write(self, _: bytes) -> None:
            raise SerialTimeoutException("Write timeout")

    monkeypatch.setattr("serial.Serial", Stuck)
    monkeypatch.setattr(serial, "time", SimpleNamespace(monotonic=lambda: 0.0, sleep=slept.append))
    told = {"device": os.devnull, "baud": None, "grid": None, "to": Address("127.0.0.1", 9), "metrics": None}
    bridge = Serial(argparse.Namespace(protocol="e256", sensor="skin", **told), Counts("serial"))
    bridge.work()
    assert "it takes no request" in capfd.readouterr().err
    assert slept == [AGAIN_S] * 2  # once between two attempts


@pytest.mark.parametrize("step", ["tcgetattr", "tcsetattr", "tcflush"])
def test_a_device_that_is_unplugged_while_it_is_opened_is_waited_for(line, monkeypatch, capfd, step: str) -> None:
    """As with a loose plug; pyserial says it in three ways."""
    real = getattr(termios, step)

    def unplugged(*arguments: Any) -> Any:
        os.close(line.end)
        line.end = os.open(os.devnull, os.O_RDWR)
        return real(*arguments)

    monkeypatch.setattr(termios, step, unplugged)
    told = {"device": str(line.link), "baud": None, "grid": None, "to": Address("127.0.0.1", 9), "metrics": None}
    assert Serial(argparse.Namespace(protocol="csv", sensor="skin", **told), Counts("serial"))._open() is None
    assert "ttyUSB0 is not there: Input/output error; waiting for it" in capfd.readouterr().err


def test_bytes_of_another_protocol_are_recognised(bridge, line, udp):
    process = begin(bridge, line, "flexitac", udp)
    line.flood(process, b"".join(written("csv", frame(n)) for n in range(1, 60)))
    assert process.end() == 1
    said = process.said().splitlines()[-1]
    assert "no flexitac frame of 9x9" in said
    assert "these bytes look like csv with 81 numbers a line (a line is a frame)" in said


def test_nobody_who_listens_is_said_and_heals(bridge, line):
    to = free_address()
    process = bridge("serial", line.link, "--protocol", "flexitac", "--sensor", "a", "--grid", "9x9", "--to", to)
    process.ready()

    def refused() -> bool:
        line.say(written("flexitac", frame(1)))
        return "nobody listens" in process.said()

    wait(refused, process.said)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(to)
        receiver.settimeout(DEADLINE_S)
        line.say(written("flexitac", frame(2)))
        while bytes([2] * 81) not in receiver.recv(65536):
            pass


@pytest.mark.parametrize(
    ("device", "more", "words"),
    [
        ("/dev/null", [], "/dev/null: is no serial device"),
        ("FILE", [], "is no serial device"),
        ("/dev/null", ["--sensor", "a/b"], "argument --sensor: 'a/b'"),
        ("/dev/null", ["--protocol", "e256", "--grid", "8x8"], "16x16"),
        ("/dev/null", ["--grid", "1x1"], "ROWSxCOLUMNS"),
        ("/dev/null", ["--baud", "0"], "argument --baud: '0': expected"),
        ("/dev/null", ["--baud", "5000000000"], "argument --baud: '5000000000': expected"),
        ("/dev/null", ["--to", "nowhere.invalid:9000"], "cannot send to nowhere.invalid:9000"),
    ],
)
def test_bad_input_is_one_sentence(refused, tmp_path: Path, device: str, more: list[str], words: str):
    path = tmp_path / "a.txt" if device == "FILE" else Path(device)
    if device == "FILE":
        path.touch()
    assert words in refused("serial", path, "--protocol", "csv", "--sensor", "armrest", *more)


def test_a_device_of_another_program_and_one_that_is_not_ours(bridge, line):
    import serial

    with serial.Serial(str(line.link), exclusive=True):
        process = bridge("serial", line.link, "--protocol", "csv", "--sensor", "armrest")
        assert process.end() == 1
        assert "another program has it open" in process.said()
    assert stat.S_ISCHR(os.stat(line.link).st_mode)


def test_a_log_on_a_full_disk_ends_no_bridge(line: Line, udp: socket.socket) -> None:
    command = [sys.executable, "-m", "gestured.bridge", "serial", str(line.link), "--protocol", "csv", "--sensor", "s"]
    with Path("/dev/full").open("wb") as full:
        to = Address(*udp.getsockname())
        process = subprocess.Popen(
            [*command, "--grid", "9x9", "--to", str(to)], stdout=subprocess.PIPE, stderr=full, text=True
        )
    try:
        assert process.stdout is not None and '"ready"' in process.stdout.readline()
        line.say(b"\n" + (b"100 " * 81 + b"\n") * 2)
        udp.settimeout(DEADLINE_S)
        assert b"/s/pressure" in udp.recv(65_536)
        line.unplug()  # which is said, too
        line.plug()

        def goes_on() -> bool:
            """Whether the sensor that was plugged in again, and says what the first one never did, is heard."""
            line.say((b"7 " * 81 + b"\n") * 2)
            return bool(select.select([udp], [], [], 0.2)[0]) and struct.pack(">f", 7.0) in udp.recv(65_536)

        wait(goes_on, lambda: f"status {process.poll()}")
    finally:
        process.terminate()
        assert process.wait(DEADLINE_S) == 0
