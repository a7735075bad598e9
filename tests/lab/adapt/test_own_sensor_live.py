"""docs/own-sensor.md: its live steps run, in its order, with the real daemon and a sensor that no model knows."""

import itertools
import json
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

import pytest

from gestured.client.sensor import Form, Sensor
from gestured.control.play import frames
from gestured.core.address import Address
from gestured.core.frames import Frame
from gestured.lab.own.play import repeated
from gestured.lab.own.signs import sign
from gestured.lab.recordings.protocol import order
from gestured.model.shipped import shipped
from gestured.record.arrays import read
from gestured.simulator import GESTURES, Participant, Performance, generator, perform
from tests.daemon.harness import Daemon
from tests.documents.blocks import blocks
from tests.lab.adapt.recorded import unknown_sensor
from tests.sockets import free_address
from tests.terminal import Terminal

HERE = "tests/lab/adapt/test_own_sensor_live.py::test_the_live_steps_lead_to_an_own_gesture"
IDLE_S = 1.2  # around a gesture
LEARNED_S = 2.5  # of an idle sensor, for a program that has just begun


class Textile:
    """A sensor with somebody in front of it. What it sends has its own times, which go on from part to part."""

    def __init__(self) -> None:
        self.nature, self.person = unknown_sensor(3), Participant(903)
        self.t, self.counter = 0.0, 0
        plan = sign("letter_m", self.person, generator(6, 1), extent=self.nature.extent)
        self._again = (repeated(plan, generator(6, 2, n), self.nature.extent) for n in range(99))

    def rests(self, seconds: float = LEARNED_S) -> Iterator[tuple[int, Frame]]:
        """Nobody touches it."""
        return self._part([], seconds)

    def feels(self, gesture: str) -> Iterator[tuple[int, Frame]]:
        """One gesture, and rest around it; one of its user's own is a letter M."""
        if gesture in GESTURES:
            made = perform(gesture, self.person, generator(6, 3), "normal", 1, self.nature.extent)
        else:
            made = next(self._again)
        return self._part([(IDLE_S, made)], 2 * IDLE_S + made.duration_s)

    def _part(self, performed: list[tuple[float, Performance]], seconds: float) -> Iterator[tuple[int, Frame]]:
        take = self.nature.record(performed, seconds, generator(6, 4, self.counter))
        for _, frame in frames(self.t, take):
            self.counter += 1
            yield self.counter, frame
        self.t += seconds


class Hasty:
    """Sends as fast as it can, with the times of its frames: for programs that go by these."""

    def __init__(self, to: Address) -> None:
        self.textile, self._to, self._epoch = Textile(), to, float(int(time.time()))
        self._socket, self._form = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), Form("armrest")

    def sends(self, *parts: Iterator[tuple[int, Frame]]) -> None:
        """Send them all."""
        for counter, frame in itertools.chain(*parts):
            self._socket.sendto(self._form.packet(frame, counter, self._epoch + frame.t), self._to)

    def close(self) -> None:
        """Send no more."""
        self._socket.close()


class Streaming:
    """Sends as in life, and rests where nothing is asked of it: for programs that go by the arrival."""

    def __init__(self, to: Address) -> None:
        self._textile, self._sensor = Textile(), Sensor(to, Form("armrest"))
        self._wanted: SimpleQueue[str] = SimpleQueue()
        self._thread = Thread(target=self._stream)
        self._thread.start()

    def perform(self, gesture: str) -> None:
        """As soon as it can."""
        self._wanted.put(gesture)

    def _stream(self) -> None:
        while not self._sensor.stop.is_set():
            try:
                part = self._textile.feels(self._wanted.get_nowait())
            except Empty:
                part = self._textile.rests(0.5)
            self._sensor.send(part)

    def close(self) -> None:
        """Send no more."""
        self._sensor.stop.set()
        self._thread.join()
        self._sensor.close()


@pytest.fixture
def place() -> Address:
    """A port that nobody has, where the document says 9000."""
    return free_address()


@pytest.fixture
def sensor(place: Address) -> Iterator[Hasty]:
    with closing(Hasty(place)) as made:
        yield made


class Lines:
    """The commands of the document, one after the other, and each was run in the end."""

    def __init__(self, place: Address) -> None:
        text = "".join(block.text for block in blocks("run", HERE))
        self.left = [shlex.split(line.replace("0.0.0.0:9000", str(place))) for line in text.splitlines()]

    def next(self, *beginning: str) -> list[str]:
        """The arguments of the next one, which begins so."""
        words = self.left.pop(0)
        assert words[: len(beginning)] == list(beginning)
        return words[1:]


def gesturectl(arguments: list[str], *more: object, **options: Any) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "gestured.control", *arguments, *map(str, more)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options,
    )  # fmt: skip


def ended(process: "subprocess.Popen[str]") -> str:
    """What it printed; it must have ended well."""
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err + out
    return out


@contextmanager
def started(folder: Path, *flags: object) -> Iterator[Daemon]:
    """A daemon that goes by the sensor's clock: here the sensor sends faster than in life, and rests for longer."""
    daemon = Daemon(folder, *flags, "--socket", folder / "events.sock", "--clock", "sensor", "--stale-s", 30)
    try:
        assert daemon.process.stdout is not None
        daemon.ready = json.loads(daemon.process.stdout.readline())
        yield daemon
        assert daemon.stop() == 0, daemon.stderr()
    finally:
        daemon.process.kill()


def collected(lines: Lines, place: Address, names: tuple[str, ...]) -> None:
    """Consent, one take, and an early end."""
    first = order("07", 0, list(names), 1)[0]
    with closing(Terminal("gestured.lab.cli", *lines.next("gestured-lab", "collect"), "--countdown", "0")) as person:
        person.sees("Do you agree?")
        person.types("yes\n")
        with closing(Streaming(place)) as sensor:
            person.sees("Sensor armrest: 12 x 10 at")
            person.sees("Enter when it is in place")
            person.types("\n")
            person.sees(f"{first}")
            person.sees("now!")
            sensor.perform(first.gesture)
            person.types("y" if person.sees("keep? [y/N]", "Enter keep") == "keep? [y/N]" else "\n")
            person.sees("kept, ")
            person.types("q")
            assert person.ends() == 0


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_live_steps_lead_to_an_own_gesture(
    tmp_path: Path, sensor: Hasty, place: Address, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = Lines(place)

    sniff = gesturectl(lines.next("gesturectl", "sniff"))
    assert sniff.stderr is not None and "listening" in sniff.stderr.readline()
    sensor.sends(sensor.textile.rests(), sensor.textile.feels("swipe_right"))
    proposed = ended(sniff)[-40:].partition("\n\n")[2]
    assert proposed == '[sensors.armrest]\ngrid = "12x10"\n'

    with started(tmp_path, *lines.next("gestured")) as daemon:
        client = daemon.client().subscribe("gesture")
        sensor.sends(sensor.textile.rests(), sensor.textile.feels("swipe_right"))
        assert client.events("gesture", "armrest")[0]["gesture"] == "swipe_right"
        found = ended(gesturectl(lines.next("gesturectl", "doctor"), "--control", daemon.ready["control"]))
        assert "ok      sensor armrest: 15.0 Hz" in found and "\nbad " not in found

    collected(lines, place, GESTURES)
    collected(lines, place, ("knock",))
    kept = read(Path("own/07.npz"))
    assert (kept.labels.tolist(), kept.frames.shape[1:]) == (["knock"], (12, 10))
    assert read(Path("recordings/07.npz")).labels[0] in GESTURES

    shutil.copy(shipped()["lstm"], "my.onnx")  # in place of an adapted one, which takes minutes
    settings = Path("gestured.toml")
    settings.write_text(f'model = "cnn_lstm"\nlisten = "{place}"\n{proposed}')
    with started(tmp_path, "--config", settings, "--own-gestures", tmp_path / "own.json") as daemon:
        control = ("--control", daemon.ready["control"])
        recorder = gesturectl(lines.next("gesturectl", "record"), *control)
        assert recorder.stderr is not None and "recording into" in recorder.stderr.readline()
        client = daemon.client().subscribe("gesture")
        sensor.sends(sensor.textile.rests(), sensor.textile.feels("swipe_right"))
        client.events("gesture", "armrest")
        recorder.send_signal(signal.SIGINT)
        ended(recorder)
        replay = lines.next("gesturectl", "replay")
        ended(gesturectl([word.replace("/etc/gestured", str(tmp_path)) for word in replay]))  # 0: no difference
        settings.write_text(f'model = "{tmp_path}/my.onnx"\nlisten = "{place}"\n{proposed}')
        assert "my answers" in ended(gesturectl(lines.next("gesturectl", "reload"), *control))

        client, status = daemon.client().subscribe("gesture", "unknown"), daemon.client().subscribe("status")
        enrol = gesturectl(lines.next("gesturectl", "enrol"), *control)
        while daemon.ask("gestures")["own"]["enrolling"] is None:
            status.line()
        while daemon.ask("gestures")["own"]["enrolling"] is not None:  # until three are kept
            sensor.sends(sensor.textile.feels("knock"))
            client.until(lambda line: line["type"] in ("gesture", "unknown"))
        assert "enrolled knock with 3 examples" in ended(enrol)
        assert "knock" in ended(gesturectl(lines.next("gesturectl", "gestures"), *control))
        sensor.sends(sensor.textile.feels("knock"))
        event = client.events("gesture", "armrest")[0]
        assert (event["gesture"], event["own"]) == ("knock", True)
    assert not lines.left
