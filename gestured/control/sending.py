"""A tape to a daemon over UDP, and what the daemon makes of it."""

import queue
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.client import osc_out
from gestured.client.lines import Unreachable, read_ahead
from gestured.client.sensor import sent_after_refusal
from gestured.client.stream import Stream
from gestured.control.diff import ONSET_S, Line
from gestured.core.address import Address
from gestured.core.beside.reading import SILENT
from gestured.core.errors import GesturedError
from gestured.core.messages import EVENT_TYPES
from gestured.core.stamping import Stamper
from gestured.record.replay import Replay
from gestured.record.tape import Packet, Tape

Times = NDArray[np.float64]

BUNDLE = b"#bundle\0"
STATUS_TIMEOUT_S = 10.0  # a daemon says something once a second
BACKLOG_S = 0.5  # how long a daemon needs for a receive buffer that is full
CONTACTS = 1000  # onsets of a sensor that are compared with as many others: 8 MB, and an hour of gestures
TIMES = ("onset", "offset", "decided")


def send(found: Tape, to: Address, speed: float) -> tuple[list[float], int]:
    """When each packet was sent (s since the epoch), and how many were refused by a closed port.

    Each sender of the tape gets a socket of its own: a sensor belongs to its source.
    """
    try:
        family, kind, _, _, where = socket.getaddrinfo(*to, type=socket.SOCK_DGRAM)[0]
    except OSError as error:
        raise GesturedError(f"cannot send to {to}: {error.strerror or error}") from error
    senders: dict[tuple[str, int], socket.socket] = {}
    sent: list[float] = []
    unheard = 0
    try:
        for packet, data in _paced(found, speed):
            if packet.source not in senders:
                senders[packet.source] = socket.socket(family, kind)
                senders[packet.source].connect(where)
            unheard += sent_after_refusal(senders[packet.source], data)
            sent.append(time.time())
    finally:
        for sender in senders.values():
            sender.close()
    return sent, unheard


def _paced(found: Tape, speed: float) -> Iterator[tuple[Packet, bytes]]:
    """Packets at their times; at another pace they say themselves when they were felt."""
    first, start = found.packets[0].t_ns, time.monotonic()
    for packet in found.packets:
        wait = start + (packet.t_ns - first) / 1e9 / speed - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        tagged = speed != 1 and not packet.data.startswith(BUNDLE)
        yield packet, osc_out.dated(packet.t_ns / 1e9, packet.data) if tagged else packet.data


def retimed(heard: Sequence[Line], sent: Sequence[float], found: Tape, rehearsal: Replay) -> list[Line]:
    """What a daemon said, in the recording's time: what was `found` was `sent` at these times (s since the epoch).

    A daemon's times of a sensor run on from whatever it heard of that sensor before, so where they begin is found by
    laying its onsets over those of the same frames in `rehearsal`, which must have been played to its end.
    """
    arrivals = [packet.t_ns / 1e9 - rehearsal.epoch for packet in found.packets]
    tables = {}
    for name, stream in rehearsal.played.items():
        arrived, felt = np.array(stream.stamps).T
        told, waited = np.diff(felt), np.diff(np.interp(arrived, arrivals, sent))
        # A daemon believes no longer step of a sensor's clock, and takes that of the arrivals.
        steps = np.where(told <= Stamper.MAX_STEP_S, told, waited)
        played = np.concatenate([[0.0], np.cumsum(steps)])
        here = np.interp(stream.onsets, felt, played)
        there = np.array([line["onset"] for line in heard if line["type"] == "onset" and line["sensor"] == name])
        tables[name] = played + _shift(here, there), felt + rehearsal.epoch
    return [
        {**line, **{k: float(np.interp(line[k], *tables[line["sensor"]])) for k in TIMES if k in line}}
        for line in heard
    ]


def _shift(here: Times, there: Times) -> float:
    """Seconds by which most of `there` (M,) follow `here` (N,); 0 where one is empty."""
    apart = np.sort(np.subtract.outer(there[:CONTACTS], here[:CONTACTS]).ravel())
    if not len(apart):
        return 0.0
    alike = np.searchsorted(apart, apart + ONSET_S, "right") - np.arange(len(apart))
    first = int(alike.argmax())
    return float(np.median(apart[first : first + alike[first]]))


class Hearing:
    """What the daemon on an event socket says of some sensors; a thread reads. Raises Unreachable, GesturedError."""

    def __init__(self, path: Path, sensors: frozenset[str]) -> None:
        """Begins once the daemon says all that is asked for, and nobody else feeds these sensors."""
        self._sensors = sensors
        self._stream = Stream(path, {"types": EVENT_TYPES})
        self._heard = read_ahead(self._stream)
        end = time.monotonic() + STATUS_TIMEOUT_S
        while live := self._live():  # a first status says that the subscription holds
            if time.monotonic() > end:
                self.close()
                raise GesturedError(f"{', '.join(live)}: is being sent to that daemon already; end that first")

    def all(self, since: float) -> list[dict[str, Any]]:
        """The lines of these sensors, once all that was sent before `since` (s since the epoch) was answered."""
        found: list[dict[str, Any]] = []
        open_contacts: set[tuple[str, int]] = set()
        while True:
            line = self._next()
            if line["type"] == "lost":
                raise GesturedError("events were lost: this machine is too slow for that --speed")
            if line["type"] == "status":
                if line["time"] >= since + BACKLOG_S and not open_contacts:
                    self._expect(line["sensors"])
                    return found
            elif line.get("sensor") in self._sensors and not line.get("test"):
                key = line["sensor"], line["id"]
                if line["type"] == "onset":
                    open_contacts.add(key)
                elif line["type"] == "release":
                    open_contacts.discard(key)
                found.append(line)

    def close(self) -> None:
        """Close the connection to the daemon."""
        self._stream.close()

    def _live(self) -> list[str]:
        """The sensors that the next status has as being fed."""
        while (line := self._next())["type"] != "status":
            pass
        return sorted(name for name in self._sensors if line["sensors"].get(name, SILENT[0]) not in SILENT)

    def _expect(self, states: Mapping[str, str]) -> None:
        deaf = sorted(self._sensors - set(states))
        if deaf:
            raise GesturedError(
                f"the daemon on {self._stream.path} took no frame of {', '.join(deaf)}: "
                "is it the one that listens there, and with that grid? gesturectl doctor says what it dropped"
            )

    def _next(self) -> dict[str, Any]:
        try:
            line = self._heard.get(timeout=STATUS_TIMEOUT_S)
        except queue.Empty:
            raise Unreachable(f"the daemon on {self._stream.path} says nothing for {STATUS_TIMEOUT_S:g} s") from None
        if line is None:
            raise Unreachable(f"the daemon on {self._stream.path} closed the connection")
        return line
