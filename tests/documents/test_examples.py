"""The examples marked `run: here`: run against a real daemon, but for the addresses."""

import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pythonosc.osc_message import OscMessage

from gestured.client.control import Control
from gestured.core.messages import parse_subscription
from gestured.model.shipped import shipped
from tests.daemon.harness import RATE_HZ, Daemon, Hand, Sensor
from tests.deploy.compilers import CPP, POSIX, C, compiled
from tests.documents.blocks import ROOT, Block, blocks
from tests.sockets import GESTURE, HELLO, FakeDaemon, free_address

WRAPPER = '#!/bin/sh\nPYTHONPATH={root} exec {python} -m gestured.{package} "$@"\n'
COMPILERS = pytest.mark.parametrize(("compiler", "standard"), [("gcc", C), ("g++", CPP)])
# A phrase that only this example has, and so its name.
ENDING, LOOP = "--types gesture,unknown --count 2", "--json --reconnect | while"
PHRASES = {
    ENDING,
    LOOP,
    "across its restarts",
    "gestured_open",
    "BlockingOSCUDPServer",
    "measure()",
    "for row in matrix",
    "makefile()",
    "gestured_packet",
    "np.load",
    "gestured.Hub",
    'sensors=["armrest"]) as events',
    "was_shown",
    "starts where one touches",
}


def example(phrase: str) -> Block:
    """The example with a phrase in it."""
    (found,) = [block for block in blocks("run", "here") if phrase in block.text]
    return found


def test_no_example_is_forgotten():
    assert {example(phrase) for phrase in PHRASES} == set(blocks("run", "here"))


class Place:
    """A daemon, and the examples' addresses turned into its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = free_address().port
        flags = ("--clock", "sensor", "--touch", "true", "--metrics", "127.0.0.1:0")
        self.daemon = Daemon.start(folder, "cnn_lstm", *flags, "--publish", f"osc://127.0.0.1:{self.port}")
        for program, package in (("gestured", "daemon"), ("gesturectl", "control")):
            path = folder / program
            path.write_text(WRAPPER.format(root=ROOT, python=sys.executable, package=package))
            path.chmod(0o755)

    def here(self, text: str) -> str:
        """An example with this daemon's addresses."""
        text = text.replace("/run/gestured/events.sock", str(self.daemon.socket)).replace("9001", str(self.port))
        return text.replace("9000", str(self.daemon.address[1]))

    @contextmanager
    def gestures(self) -> Iterator[None]:
        """Somebody swipes to the left again and again: made-up events, for who subscribes late misses the first."""
        stop = threading.Event()

        def emit() -> None:
            with Control(self.daemon.socket.with_suffix(".ctl")) as control:
                while not stop.wait(0.1):
                    control.ask("emit", gesture="swipe_left", sensor="armrest")

        thread = threading.Thread(target=emit)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()

    def first_line(self, *command: str) -> str:
        """What a program that never ends prints first."""
        with self.running(*command) as process:
            assert process.stdout is not None
            return next(line for line in process.stdout if "swipe" in line)

    def ran(self, phrase: str) -> "subprocess.CompletedProcess[str]":
        """An example that ends by itself."""
        command = [sys.executable, "-c", example(phrase).text]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, timeout=60)

    @contextmanager
    def running(self, *command: str) -> "Iterator[subprocess.Popen[str]]":
        """A program that never ends, until it is no longer needed."""
        environment = os.environ | {"GESTURED_SOCKET": str(self.daemon.socket)}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=self.folder, env=environment) as process:
            try:
                yield process
            finally:
                process.kill()


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    if not shipped()["cnn_lstm"].exists():
        pytest.skip(f"{shipped()['cnn_lstm']} is not there")
    place = Place(tmp_path_factory.mktemp("examples"))
    yield place
    assert place.daemon.stop() == 0, place.daemon.stderr()


def c_program(folder: Path, phrase: str, compiler: str, standard: str) -> str:
    """An example in C as a program; no warning."""
    source = folder / f"example.{'c' if standard == C else 'cpp'}"
    source.write_text(example(phrase).text)
    return str(compiled(compiler, standard, folder / "example", POSIX, source))


def shell(place: Place, phrase: str) -> "subprocess.Popen[str]":
    """An example in a shell whose environment names this daemon's socket, as a leader of its processes."""
    environment = {"PATH": f"{place.folder}:/usr/bin:/bin", "GESTURED_SOCKET": str(place.daemon.socket)}
    command = ["bash", "-euo", "pipefail", "-c", example(phrase).text]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, start_new_session=True)


def test_shell(place: Place):
    with place.gestures(), shell(place, ENDING) as process:
        assert "swipe_left" in process.communicate(timeout=60)[0]
    assert process.returncode == 0


def test_a_loop_in_a_shell_goes_on(place: Place):
    with place.gestures(), shell(place, LOOP) as process:
        assert process.stdout is not None
        try:
            assert all("the next track" in process.stdout.readline() for _ in range(4))
        finally:
            os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize(
    ("phrase", "says"),
    [
        ("across its restarts", "armrest swipe_left 1.00 0 missed\n"),
        ("makefile()", "armrest swipe_left 1.0\n"),
        ("BlockingOSCUDPServer", "armrest swipe_left 1.00 "),
        ('sensors=["armrest"]) as events', "swipe_left from armrest\n"),
    ],
)
def test_python_subscriber(place: Place, phrase: str, says: str):
    code = example(phrase).text
    for request in re.findall(r"b'({\"subscribe\".*})", code):  # one that is refused leaves a client with all events
        parse_subscription(request.encode(), {"gestures": (), "zones": ()})
    with place.gestures():
        line = place.first_line(sys.executable, "-c", place.here(code))
    assert line.startswith(says)


@COMPILERS
def test_c_subscriber(place: Place, tmp_path: Path, compiler: str, standard: str):
    program = c_program(tmp_path, "gestured_open", compiler, standard)
    with place.gestures():
        assert place.first_line(program, str(place.daemon.socket)) == "armrest swipe_left 1.00\n"


def test_a_subscriber_that_does_something_before_the_answer(place: Place):
    command = (sys.executable, "-c", place.here(example("was_shown").text))
    with place.gestures(), place.running(*command) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(20)]
    first = lines.index("show swipe_left\n")
    assert lines[first : first + 4] == ["show swipe_left\n", "do swipe_left\n"] * 2


def test_a_slider_that_follows_the_finger(place: Place):
    text = place.here(example("starts where one touches").text)
    with place.running(sys.executable, "-c", text) as process:
        sensor = Sensor(place.daemon, "console").begin()
        assert process.stdout is not None
        while not select.select([process.stdout], [], [], 0.1)[0]:
            assert process.poll() is None
            sensor.perform("right")
        sensor.perform("right", "left")  # the first one may have been under way already
        lines: list[list[str]] = []
        while [line[0] for line in lines].count("up") < 2:
            lines.append(process.stdout.readline().split())
    swipe = lines[[line[0] for line in lines].index("up") + 1 :]
    assert [line[0] for line in swipe] == ["down", *["move"] * (len(swipe) - 2), "up"]
    (absolute, relative), (to, by) = (map(float, line[1:]) for line in (swipe[0], swipe[-1]))
    assert abs(to - absolute) > 50 and by == pytest.approx(min(max(relative + to - absolute, 0), 100), abs=2)


def heard(place: Place, folder: Path, phrase: str, *connections: tuple[object, ...]) -> list[str]:
    """What an example prints that hears these lines, one connection after the other."""
    fake = FakeDaemon(folder / "events.sock")
    text = example(phrase).text.replace("/run/gestured/events.sock", str(fake.path))
    with fake.listener, place.running(sys.executable, "-uc", text) as process:
        for hello, *lines in connections:
            fake.accept(hello)
            fake.request()
            fake.say(*lines)
            fake.close()
        fake.accept()  # by now it has read what came before
        process.kill()
        assert process.stdout is not None
        return process.stdout.readlines()


def test_a_slider_follows_the_next_finger_if_an_up_was_lost(place: Place, tmp_path: Path):
    """A daemon that is killed with a finger down, or a client that is too slow, leaves a `down` without its `up`."""
    finger = {"type": "touch", "sensor": "console", "t": 1.0, "y": 0.5, "dx": 0.0, "dy": 0.0, "pressure": 9.0}
    finger |= {"area": 4, "zone": None}
    before = (HELLO, finger | {"id": 41, "touch": 1, "phase": "down", "x": 0.5})
    fingers = ((0, "down"), (1, "down"), (1, "up"), (0, "up"))
    after = (finger | {"id": 1, "touch": touch, "phase": phase, "x": touch} for touch, phase in fingers)
    said = heard(place, tmp_path, "starts where one touches", before, (HELLO | {"instance": "another"}, *after))
    assert said == ["down 50 50\n", "down 0 50\n", "up 0 50\n"]


def test_what_was_missed_between_two_connections_is_counted(place: Place, tmp_path: Path):
    """A client that does not read is cut off; then the hello names gestures of which it has not heard.

    A gesture that comes a minute late is neither missed nor done.
    """
    fresh, late = (GESTURE | {"decided": time.time() + s} for s in (60.0, -60.0))  # however slow this machine is
    said = heard(
        place,
        tmp_path,
        "across its restarts",
        (HELLO | {"sensors": {"armrest": 4}}, fresh | {"sequence": 5}, late | {"sequence": 6}),
        (HELLO | {"sensors": {"armrest": 9}}, fresh | {"sequence": 10}),
        (HELLO | {"instance": "another", "sensors": {"armrest": 2}}, fresh | {"sequence": 3}),
    )
    assert [line.split(" ", 3)[3] for line in said] == ["0 missed\n", "3 missed\n", "0 missed\n"]


def test_one_sensor_in_a_process_of_ones_own(place: Place):
    hand = Hand()
    frames = np.array([*hand.idle(2.0), *hand.swipe("left"), *hand.idle(1.0), *hand.swipe("up"), *hand.idle(1.0)])
    np.savez(place.folder / "session.npz", frames=frames, times=np.arange(len(frames)) / RATE_HZ)
    done = place.ran("np.load")
    assert done.returncode == 0, done.stderr
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["swipe_left", "swipe_up"]


def test_many_sensors_in_a_process_of_ones_own(place: Place):
    address = free_address()
    code = example("gestured.Hub").text.replace("9000", str(address.port))
    with place.running(sys.executable, "-c", code) as process:
        sensor = Sensor(SimpleNamespace(address=address), "armrest")
        while refused(sensor.sock):
            assert process.poll() is None
        sensor.begin().perform("left")
        assert process.stdout is not None
        assert process.stdout.readline().startswith("armrest swipe_left ")


def refused(sock: socket.socket) -> bool:
    """Whether nobody is at the address to which a UDP socket is connected; the second packet is told so."""
    try:
        sock.send(b"anybody?")
        sock.send(b"anybody?")
    except ConnectionRefusedError:
        return True
    return False


@pytest.mark.parametrize(("phrase", "name", "count"), [("measure()", "armrest", 30), ("for row in matrix", "seat", 1)])
def test_python_sensor(place: Place, phrase: str, name: str, count: int):
    """A name belongs to the first program that sends it, so each has one of its own."""
    before = place.daemon.frames()
    code = place.here(example(phrase).text.replace("/armrest/", f"/{name}/"))
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)
    while place.daemon.frames() < before + count:
        pass
    assert name in place.daemon.get("/readyz")[1]


@COMPILERS
def test_c_sensor(tmp_path: Path, compiler: str, standard: str):
    program = c_program(tmp_path, "gestured_packet", compiler, standard)
    packet = subprocess.run([program], capture_output=True, check=True, timeout=30).stdout
    message = OscMessage(packet)
    assert (message.address, len(packet)) == ("/armrest/pressure", 416)
    assert message.params == [0, b"\0\x14" + bytes(382)]
