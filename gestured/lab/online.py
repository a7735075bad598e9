"""Continuous sessions over UDP to a real daemon, and its events judged against what was performed."""

import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any

from gestured.client.engine import Engine
from gestured.client.lines import read_ahead
from gestured.client.sensor import Form, Sensor
from gestured.client.subscriber import Subscriber
from gestured.core.errors import GesturedError
from gestured.core.frames import Frame
from gestured.record import judge
from gestured.record.judge import Outcome, Performed, Tally
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session

SESSION_S = 120.0
NON_GESTURE_SHARE = 0.2  # share of what is performed


def takes(minutes: float, seed: int) -> Iterator[Take]:
    """Sessions of one new participant each on the nominal sensor."""
    for n in range(round(minutes * 60 / SESSION_S)):
        person = seed + n
        rng = generator(person, 0x0E)
        yield session(Participant(person), SimulatedSensor.nominal(day=person), rng, SESSION_S, NON_GESTURE_SHARE)


def play(model: str, take: Take, speed: float) -> tuple[list[dict[str, Any]], float]:
    """Send a take, `speed` times as fast as it was recorded, to a daemon of its own.

    Returns the daemon's events, and the epoch time of the sensor's time 0. The daemon stamps the first frame with its
    arrival, and the later ones by the sensor's clock.
    """
    rows, columns = take.frames.shape[1:]
    with (
        Engine(model, rows, columns, "--clock", "sensor") as engine,
        Subscriber(engine.socket, types=["gesture", "unknown"], reconnect=False) as subscriber,
        closing(Sensor(engine.listen, Form("lab"))) as sensor,
    ):
        heard = read_ahead(line for _, line in subscriber.lines())
        heard.get()  # after the hello no event is missed
        epoch, start = time.time(), time.monotonic()
        first = float(take.sensor_times[0])
        for n in range(len(take.frames)):
            t = float(take.sensor_times[n])
            wait = start + (t - first) / speed - time.monotonic()
            if wait > 0.002:  # in small bursts: a sleep for each frame would be the slowest part
                time.sleep(wait)
            sensor.socket.send(sensor.form.packet(Frame(t, take.frames[n]), int(take.counter[n]), epoch + t))
        engine.close()  # the daemon flushes what is open, and hangs up
        events = [line for line in iter(heard.get, None) if line["type"] in ("gesture", "unknown")]
    if sensor.unheard:
        raise GesturedError(f"{sensor.unheard} packets were refused by the daemon's port")
    return events, epoch - first


def tallied(take: Take, zero: float, events: list[dict[str, Any]]) -> tuple[Tally, list[Outcome]]:
    """The tally of a take whose time 0 was at `zero` (epoch seconds), and the outcomes of its events."""
    performed = [Performed(act.label, act.kind, zero + act.onset_s, zero + act.offset_s) for act in take.events]
    return judge.tallied(performed, events)
