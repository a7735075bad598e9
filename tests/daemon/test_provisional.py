"""Provisional events of a real daemon: who is told what, before the answer and with it."""

import socket
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pythonosc.osc_message import OscMessage

import gestured
from gestured.core.address import Address
from gestured.core.events import Gesture, Provisional
from gestured.daemon.metrics import Metrics
from gestured.daemon.sinks import OscSink
from tests.daemon import tiny_model
from tests.daemon.harness import Client, Daemon, Hand, Sensor, running
from tests.hostile.grammar import TYPES, violations

ALL = (*TYPES, "provisional")


@pytest.fixture(scope="module")
def early(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small model, with thresholds for contacts that are not over."""
    return tiny_model.make(tmp_path_factory.mktemp("early") / "early.onnx", provisional=tiny_model.PROVISIONAL)


@pytest.fixture(scope="module")
def daemon(early: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    flags = ("--metrics", "127.0.0.1:0", "--max-sensors", 500)
    with running(tmp_path_factory.mktemp("daemon"), early, *flags) as daemon:
        yield daemon


def said(client: Client, sensor: str, last: int = 1) -> list[str]:
    """What a client is told of a sensor, each line in a word, until the release of contact `last`."""
    lines = client.until(lambda line: (line["type"], line.get("sensor"), line.get("id")) == ("release", sensor, last))
    return words(lines, sensor)


def words(lines: list[dict[str, Any]], sensor: str) -> list[str]:
    found = []
    for line in lines:
        if line.get("sensor") == sensor:
            mark = "?" if line["type"] == "provisional" else ""
            verdict = f" {line['provisional']}" if line.get("provisional") else ""
            found.append(f"{line.get('gesture', line['type'])}{mark}{verdict}")
    return found


def swipe(sensor: Sensor, client: Client, direction: str, *then: list[Any]) -> list[dict[str, Any]]:
    """A swipe that goes on until something is said of it, for which the daemon has time once nothing waits."""
    sensor.send(sensor.hand.swipe(direction))
    lines = client.until(lambda line: (line["type"], line.get("sensor")) == ("provisional", sensor.name))
    sensor.send(*then, sensor.hand.idle(1.0))
    return lines


def two_taps(sensor: Sensor) -> None:
    sensor.send(sensor.hand.tap(), sensor.hand.idle(0.2), sensor.hand.tap(), sensor.hand.idle(1.0))


def test_it_comes_before_the_answer_which_confirms_it(daemon: Daemon) -> None:
    client = daemon.client().subscribe(*ALL, sensors=["confirmed"])
    plain = daemon.client().subscribe("gesture", sensors=["confirmed"])
    sensor = Sensor(daemon, "confirmed").begin()
    lines = swipe(sensor, client, "left")
    sensor.perform("tap")
    lines += client.until(lambda line: line["type"] == "release" and line["id"] == 2)
    assert words(lines, "confirmed") == [
        "onset", "swipe_left?", "swipe_left confirmed", "release", "onset", "one_tap?", "one_tap confirmed", "release",
    ]  # fmt: skip
    assert violations(lines) == []
    early, answer = lines[1], lines[2]
    assert list(early) == ["type", "sensor", "id", "gesture", "confidence", "onset", "decided"]
    assert early["id"] == answer["id"] and early["onset"] == pytest.approx(answer["onset"], abs=1e-4)
    assert early["onset"] + 0.1 < early["decided"] < answer["offset"] + 1e-4
    first, second = plain.events("gesture", "confirmed", 2)  # that somebody asked is all that others see of it
    assert (first, second) == (answer, lines[6]) and first["provisional"] == "confirmed"


def test_whoever_was_sent_it_is_sent_the_answer(daemon: Daemon) -> None:
    only = daemon.client().subscribe("provisional", sensors=["owed"])
    taps = daemon.client().subscribe("provisional", gestures=["one_tap"])
    changed = daemon.client().subscribe("provisional", sensors=["owed"])
    sensor = Sensor(daemon, "owed").begin()
    lines = swipe(sensor, only, "left")
    two_taps(sensor)
    lines += only.until(lambda line: line.get("gesture") == "double_tap")
    lines += swipe(sensor, only, "up")
    expected = ["swipe_left?", "swipe_left confirmed", "one_tap?", "double_tap revoked", "swipe_up?"]
    assert words(lines, "owed") == expected
    lines = taps.until(lambda line: line["type"] == "gesture")
    assert words(lines, "owed") == ["one_tap?", "double_tap revoked"]
    hand = sensor.hand
    sensor.send(hand.swipe("left"))
    changed.until(lambda line: (line["type"], line.get("id")) == ("provisional", 4))
    changed.subscribe("status")  # what it asks for now changes nothing of what it was told
    sensor.send(hand.idle(1.0))
    (answer,) = changed.events("gesture", "owed")
    assert (answer["id"], answer["provisional"]) == (4, "confirmed")


def test_nobody_asks_and_nothing_is_said(daemon: Daemon) -> None:
    before = daemon.metric("gestured_provisional_total", result="given")
    client = daemon.client().subscribe("gesture", "release")
    gone = daemon.client().subscribe("provisional")
    gone.close()
    other = daemon.client().subscribe("provisional", sensors=["another"])
    client.subscribe("gesture", "release")  # by now the daemon knows who went
    Sensor(daemon, "unasked").begin().perform("left")
    (answer,) = client.events("gesture", "unasked")
    assert answer["provisional"] is None
    assert daemon.metric("gestured_provisional_total", result="given") == before
    other.close()


def test_it_is_counted(daemon: Daemon) -> None:
    def counts() -> list[float]:
        return [daemon.metric("gestured_provisional_total", result=r) for r in ("given", "confirmed", "revoked")]

    before, lead = counts(), daemon.metric("gestured_provisional_lead_seconds_count")
    client = daemon.client().subscribe(*ALL, sensors=["counted"])
    sensor = Sensor(daemon, "counted").begin()
    swipe(sensor, client, "left")
    two_taps(sensor)
    said(client, "counted", 2)
    assert [new - old for new, old in zip(counts(), before, strict=True)] == [2, 1, 1]
    assert daemon.metric("gestured_provisional_lead_seconds_count") == lead + 1
    told = daemon.ask("status")["provisional"]
    assert [told[key] for key in ("given", "confirmed", "revoked")] == counts()


def test_a_made_up_gesture_is_said_before_too(daemon: Daemon) -> None:
    client = daemon.client().subscribe(*ALL, sensors=["made_up"])
    with daemon.control() as control:
        control.ask("emit", gesture="swipe_left", sensor="made_up")
        lines = client.until(lambda line: line["type"] == "release")
        assert words(lines, "made_up") == ["onset", "swipe_left?", "swipe_left confirmed", "release"]
        assert all(line["test"] is True for line in lines) and violations(lines) == []
        plain = daemon.client().subscribe("gesture", sensors=["made_up_2"])
        control.ask("emit", gesture="swipe_left", sensor="made_up_2")
        assert plain.line()["provisional"] is None


@pytest.mark.parametrize("goes_on", [True, False])
def test_what_was_said_over_osc_is_revoked_across_a_reload(start, early: Path, udp: socket.socket, goes_on) -> None:
    config = early.with_suffix(".toml")
    config.write_text("publish_provisional = true")
    to = f"osc://127.0.0.1:{udp.getsockname()[1]}"
    daemon = start("--clock", "sensor", "--stale-s", 30, "--publish", to, "--config", config, model=early)

    def heard() -> tuple[str, list[Any]]:
        while (message := OscMessage(udp.recv(9999))).address in ("/gestured/status", "/gestured/arm/where"):
            pass
        return message.address.removeprefix("/gestured/arm/"), message.params[:1]

    sensor = Sensor(daemon, "arm").begin()
    sensor.send(sensor.hand.tap(), sensor.hand.idle(0.2))
    assert heard() == ("provisional", ["one_tap"])
    config.write_text(f"publish_provisional = {str(goes_on).lower()}")
    daemon.ask("reload")
    sensor.send(sensor.hand.tap(), sensor.hand.idle(1.0))
    assert [heard() for _ in range(2)] == [("revoked", ["one_tap"]), ("gesture", ["double_tap"])]


@pytest.mark.parametrize("wanted", [True, False])
def test_over_osc_it_is_said_and_revoked_where_the_setting_has_it(udp: socket.socket, wanted: bool) -> None:
    sink = OscSink(Address(*udp.getsockname()), Metrics(), provisional=wanted)
    sink.publish(Provisional("arm", 7, "one_tap", 0.5, 0.0, 0.1), 0.0)
    sink.publish(Gesture("arm", 7, "double_tap", 0.5, 3, 0.0, 1.0, 2.0, 3, 0, "tiny", False, {}, "revoked"), 0.0)
    sink.close()
    early = [("provisional", ",sfi", ["one_tap", 0.5, 7]), ("revoked", ",si", ["one_tap", 7])]
    for what, types, params in (*early * wanted, ("gesture", ",sfidd", ["double_tap", 0.5, 3, 0.0, 1.0])):
        message = OscMessage(udp.recv(9999))
        told = message.dgram[message.dgram.index(b",") :].split(b"\0")[0].decode()
        assert (message.address, told, message.params) == (f"/gestured/arm/{what}", types, params)


def test_in_a_process_of_ones_own(early: Path) -> None:
    hand = Hand()
    frames = [*hand.idle(2.0), *hand.swipe("left"), *hand.idle(1.0), *hand.tap(), *hand.idle(1.0)]
    told = []
    for asked in (True, False):
        recognizer = gestured.open(early, provisional=asked, tap_gap_s=0.35)
        told.append([event for n, frame in enumerate(frames) for event in recognizer.push(n / 15, frame)])
    said = [event for event in told[0] if isinstance(event, gestured.Provisional)]
    assert [event.gesture for event in said] == ["swipe_left", "one_tap"]
    answers = [[event for event in events if isinstance(event, gestured.Gesture)] for events in told]
    assert [[event.provisional for event in events] for events in answers] == [["confirmed"] * 2, [None] * 2]
    assert [replace(event, provisional=None) for event in answers[0]] == answers[1]
    assert answers[0][1].decided - answers[0][1].offset == pytest.approx(1 / 15 + 0.35, abs=0.01)
