"""Other people's OSC clients, in real time: frames count when they arrive."""

import select
import shutil
import subprocess
from collections.abc import Callable
from typing import Any

import pytest

from tests.daemon.harness import Client, Daemon, Frame, Hand

STEP_S = 1 / 60  # faster than a real sensor, so that the test is
TRIES = 5  # a machine that stands still in a swipe leaves a hole in it


def stream(client: Client, send: Callable[[Frame], None], sensor: str) -> dict[str, Any]:
    """Be a sensor: quiet until it is known, then a swipe until one is recognised, each with quiet until its answer."""
    hand, tries = Hand(), 0
    client.subscribe("gesture", "unknown", "cancelled", "status", sensors=[sensor])
    swipe: list[Frame] | None = None
    while True:
        # The pace of a sensor, kept by waiting for what the daemon says.
        if select.select([client.sock], [], [], STEP_S)[0]:
            line = client.line()
            if line["type"] != "status":
                if line.get("gesture") == "swipe_right" or tries == TRIES:
                    return line
                swipe = None
            elif line["sensors"].get(sensor) == "ok" and swipe is None:
                tries += 1
                swipe = [hand.frame(4.0, 1 + i / 4) for i in range(25)]
        send(swipe.pop(0) if swipe else hand.frame())


def test_oscsend(start) -> None:
    program = shutil.which("oscsend")
    if program is None:
        pytest.skip("oscsend is not here (Debian: liblo-tools)")
    daemon: Daemon = start("--metrics", "127.0.0.1:0")
    host, port = daemon.address

    def send(frame: Frame) -> None:
        values = [f"{value:g}" for value in frame.ravel()]
        subprocess.run([program, host, str(port), "/lo/pressure", "f" * frame.size, *values], check=True)

    event = stream(daemon.client(), send, "lo")
    assert (event["type"], event.get("gesture")) == ("gesture", "swipe_right")
    # Each came from another port, or nearly: the kernel may give one port out again at once.
    assert daemon.metric("gestured_dropped_total", reason="second_source") <= 3
