"""What the bench counts of a scene: one number for each packet, and the packages that the scene alone brings."""

import socket
import time
from statistics import median

import pytest

from benchmarks.scenes_counted import Count, counted, table
from gestured.client.osc_out import dated
from gestured.client.sensor import Form
from gestured.core.frames import Frame
from gestured.lab.stability.path import swipes
from gestured.model.shipped import shipped


def test_every_packet_is_counted_and_a_scene_brings_its_packages() -> None:
    if not shipped()["cnn_lstm"].exists():
        pytest.skip("the shipped models are not there")
    form, epoch = Form("counted", plain=True), time.time()
    made, _ = swipes(1)
    stream = [
        dated(epoch + float(t), form.packet(Frame(0.0, values), 0, 0.0))
        for t, values in zip(made.times, made.frames, strict=True)
    ]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        flags = ("--publish", f"osc://127.0.0.1:{listener.getsockname()[1]}")
        least, more = counted("cnn_lstm", (), stream, 1), counted("cnn_lstm", flags, stream, 1)
    assert len(least.frames) == len(more.frames) == len(stream)
    assert min(least.frames) > 100 and max(least.frames) > 1.5 * median(least.frames)  # one frame makes a segment
    assert more.packages - least.packages == {"pythonosc"}


def test_a_table_stands_beside_its_first_scene() -> None:
    found = {"minimal": Count(frozenset({"a", "b"}), (100, 200)), "other": Count(frozenset({"b", "c"}), (110, 230))}
    _, _, first, second = table(found).splitlines()
    assert first == "| minimal | 150 | +0 | 150 | - | - |"
    assert second == "| other | 170 | +20 | 170 | c | a |"
