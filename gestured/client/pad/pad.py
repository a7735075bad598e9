"""A pad as a sensor: its contacts become frames at the sensor's rate, sent to a daemon as OSC."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from gestured.client.pad.contacts import Contacts
from gestured.client.sensor import Form, Sensor
from gestured.client.subscriber import Subscriber
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.core.frames import Frame
from gestured.simulator import SimulatedSensor
from gestured.simulator.live import LiveTextile

LATE_S = 0.06  # a frame shows the contacts of so long ago, of which the browser has sent the samples by now
AGAIN_S = 1.0  # s until the next attempt after a packet could not be sent
SEEN = 0.1  # the weight of each untouched frame in what is learned of the idle sensor

Tell = Callable[[str, dict[str, Any]], None]  # sends an event to the page: its kind and content


class Pad:
    """A simulated sensor that is touched in a browser. Raises GesturedError if nothing can be sent to `to`."""

    def __init__(self, to: Address, name: str, grid: tuple[int, int], rate_hz: float) -> None:
        nominal = SimulatedSensor.nominal()
        rows, columns = grid
        pitch = min(nominal.extent) / min(grid)
        sensor = replace(nominal, rows=rows, columns=columns, pitch_mm=pitch, rate_hz=rate_hz)
        self.to, self.name, self.grid, self.rate_hz = to, name, grid, rate_hz
        self.contacts = Contacts(sensor)
        self.lock = threading.Lock()  # for the contacts
        self._textile = LiveTextile(sensor, time.time_ns())
        self._sender = Sensor(to, Form(name))
        self._wrong = ""  # why the last frame was not sent or not heard
        self._unnamed = ""  # why there are no names

    def begin(self, tell: Tell, events: Subscriber | None = None) -> None:
        """Send frames from now on; `tell` gets each frame and each event for the page.

        `events` asks for the status, too, and has a timeout longer than the second between two statuses.
        """
        self._tell = tell
        threading.Thread(target=self._send, daemon=True).start()
        if events is not None:
            threading.Thread(target=self._hear, args=(events,), daemon=True).start()

    def close(self) -> None:
        """Send nothing more."""
        self._sender.close()

    def _send(self) -> None:
        frames, stop = self._frames(), self._sender.stop
        while not stop.is_set():
            try:
                self._sender.send(frames)
            except GesturedError as error:
                self._wrong = str(error)
                stop.wait(AGAIN_S)

    def _hear(self, events: Subscriber) -> None:
        while not self._sender.stop.is_set():
            try:
                event = next(events)
            except TimeoutError:
                hangs = f"the daemon on {events.path} hangs, or the machine is very busy"
                absent = f"no daemon on {events.path}: start gestured, or name its --socket"
                self._unnamed = f"No names: {hangs if events.connected else absent}"
            except StopIteration:
                return
            except GesturedError as error:
                self._unnamed = f"No names: {error}"
                return
            else:
                if event["type"] != "status":
                    self._tell("event", event)
                elif event["sensors"].get(self.name, "no_data") == "no_data":
                    self._unnamed = f"No names: the daemon takes no frames of {self.name}; gesturectl doctor says why"
                else:
                    self._unnamed = ""

    def _frames(self) -> Iterator[tuple[int, Frame]]:
        """Each frame at its time, with its counter; frames for which the machine was too slow are left out."""
        dt, start, stop = 1.0 / self.rate_hz, self._sender.start, self._sender.stop
        counter, idle, sender = 0, None, self._sender
        while not stop.is_set():
            counter = max(counter + 1, int((time.monotonic() - start) / dt))
            stop.wait(max(start + counter * dt - time.monotonic(), 0.0))
            t = start + counter * dt - LATE_S
            with self.lock:
                presses, touches = self.contacts.presses(t, time.monotonic())
            values = self._textile.frame(t, presses).astype(np.float64)
            if idle is None or not presses:
                idle = values if idle is None else idle + SEEN * (values - idle)
            felt = np.rint(values - idle).astype(int)
            self._tell("frame", {"values": felt.ravel().tolist(), "wrong": self._wrong or self._unnamed})
            sent, unheard = sender.sent, sender.unheard
            yield counter, Frame(counter * dt, values, touches)
            if sender.sent > sent:
                self._wrong = f"nobody listens on {self.to}" if sender.unheard > unheard else ""
