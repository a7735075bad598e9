"""Frames in, events out: what a client of a healthy daemon sees."""

import select
import socket
import time
from pathlib import Path
from typing import Any

import pytest
from pythonosc.osc_message import OscMessage

from tests.daemon import harness
from tests.daemon.harness import Daemon, Sensor


def test_a_swipe_is_one_gesture_with_all_fields(shared: Daemon) -> None:
    client = shared.client()
    before = time.time()
    Sensor(shared, "fields").begin().perform("left")
    (event,) = client.events("gesture", "fields")
    assert list(event) == [
        "type", "sensor", "id", "gesture", "confidence", "sequence", "onset", "offset", "decided", "frames",
        "lost", "model", "degraded", "scores", "provisional", "where",
    ]  # fmt: skip
    where = event["where"]
    assert list(where) == ["start", "end", "way", "pressure", "snr", "contacts", "bridged", "zone"]
    assert where["start"]["x"] > 0.7 and where["end"]["x"] < 0.3 and where["way"] > 0.4
    assert event["provisional"] is None
    assert (event["gesture"], event["sequence"], event["frames"], event["lost"]) == ("swipe_left", 1, 7, 0)
    assert 0.5 < event["confidence"] <= 1 and event["degraded"] is False and event["model"] == "tiny"
    assert set(event["scores"]) == set(client.hello["gestures"])
    assert event["offset"] - event["onset"] == pytest.approx(6 / 15, abs=1e-3)
    assert 0.1 <= event["decided"] - event["offset"] < 0.3
    # The sensor's clock begins at the arrival of its first frame, whatever its time tags say.
    assert before + 1.5 < event["onset"] < time.time() + 10


def test_status_comes_by_itself_and_names_each_sensor(shared: Daemon) -> None:
    client = shared.client().subscribe("status")
    sensor = Sensor(shared, "living")
    seen = []
    while "ok" not in seen:
        while not select.select([client.sock], [], [], 0.2)[0]:
            sensor.send(sensor.hand.idle(0.2))  # it must not fall silent between two signs of life
        line = client.line()
        seen.append(line["sensors"].get("living", "absent"))
    assert "starting" in seen and line["state"] == "ok"
    assert line["model"] == "tiny" and abs(line["time"] - time.time()) < 5
    client.until(lambda line: line["sensors"]["living"] == "stale")


def test_osc_goes_out_to_every_destination(start) -> None:
    outs = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    flags: list[object] = []
    for out in outs:
        out.bind(("127.0.0.1", 0))
        out.settimeout(harness.DEADLINE_S)
        flags += ["--publish", f"osc://127.0.0.1:{out.getsockname()[1]}"]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        nobody.bind(("127.0.0.1", 0))
        flags += ["--publish", f"osc://127.0.0.1:{nobody.getsockname()[1]}"]
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", *flags)
    assert OscMessage(outs[0].recv(9999)).address == "/gestured/status"
    client = daemon.client()
    Sensor(daemon, "arm").begin().perform("up")
    (event,) = client.events("gesture", "arm")
    for out in outs:
        seen: dict[str, list[Any]] = {}
        while len(seen) < 3:
            message = OscMessage(out.recv(9999))
            seen[message.address] = message.params
        assert [address for address in seen if "arm" in address] == ["/gestured/arm/gesture", "/gestured/arm/where"]
        where = event["where"]
        told = [where["start"]["x"], where["start"]["y"], where["end"]["x"], where["end"]["y"], where["way"]]
        told += [where["pressure"], where["contacts"]]
        assert seen["/gestured/arm/where"] == [1, *(pytest.approx(value, rel=1e-6) for value in told)]
        assert seen["/gestured/status"] in (["no_data", 0], ["ok", 1])
        label, confidence, sequence, onset, offset = seen["/gestured/arm/gesture"]
        assert (label, sequence) == ("swipe_up", 1)
        assert confidence == pytest.approx(event["confidence"], abs=1e-6)
        assert (onset, offset) == pytest.approx((event["onset"], event["offset"]), abs=0.05)
    while daemon.metric("gestured_osc_messages_total", result="refused") == 0:
        outs[0].recv(9999)  # a port where nobody listens is told apart, once a second
    assert daemon.metric("gestured_osc_messages_total", result="sent") > 0


def test_a_subscriber_of_one_zone_hears_what_began_there(start, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text("[sensors.arm.zones]\nright = {at = [0.5, 0.0, 1.0, 1.0]}\nleft = {at = [0.0, 0.0, 0.5, 1.0]}\n")
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", "--config", config)
    client = daemon.client().subscribe("gesture", zones=["right"])
    everything = daemon.client()
    Sensor(daemon, "arm").begin().perform("right", "left", "right", "left")
    told = [(event["gesture"], event["where"]["zone"]) for event in everything.events("gesture", "arm", 4)]
    assert told == [("swipe_right", "left"), ("swipe_left", "right")] * 2
    assert [event["sequence"] for event in client.events("gesture", "arm", 2)] == [2, 4]
    assert daemon.metric("gestured_zone_gestures_total", sensor="arm", zone="right") == 2
    client.ask({"subscribe": {"zones": ["rigth"]}})
    assert client.line() == {"type": "error", "reason": 'subscribe.zones: unknown "rigth", expected any of right, left'}


def test_metrics_count_what_happened(shared: Daemon) -> None:
    client = shared.client()
    before = shared.metric("gestured_gestures_total", gesture="swipe_left")
    Sensor(shared, "counting").begin().perform("left")
    client.events("gesture", "counting")
    assert shared.metric("gestured_gestures_total", gesture="swipe_left") == before + 1
    assert shared.metric("gestured_inference_seconds_count", model="tiny") >= 1
    assert shared.metric("gestured_latency_seconds_count") >= 1
    assert shared.metric("gestured_active_model_info", model="tiny", version=client.hello["version"]) == 1
    assert shared.metric("gestured_confidence_count") >= 1
    assert shared.metric("gestured_sensors") >= 1 and shared.metric("gestured_model_rung") == 0


def test_the_names_of_metrics_are_an_interface(shared: Daemon) -> None:
    """`metrics.txt` holds name, type and help of each; a change shows in its diff, and in the changelog."""
    found = [line for line in shared.get("/metrics")[1].splitlines() if line.startswith("#")]
    assert "\n".join(found) + "\n" == (Path(__file__).parent / "metrics.txt").read_text()
