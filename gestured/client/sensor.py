"""The firmware of a simulated sensor: frames and finger positions as OSC packets, sent at their times over UDP."""

import errno
import os
import socket
import struct
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.client import osc_out
from gestured.client.address import look_up
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.core.frames import Frame

BLOBS: dict[str, np.dtype[Any]] = {
    "float32": np.dtype(">f4"),
    "uint16": np.dtype(">u2"),
    "uint8": np.dtype(">u1"),
}


@dataclass(frozen=True)
class Form:
    """The form of a simulated sensor's packets. `values` is "floats", "ints" or one of BLOBS; `plain` has no bundle."""

    sensor: str
    values: str = "floats"
    plain: bool = False

    def packet(self, frame: Frame, counter: int, moment: float | None) -> bytes:
        """The packet of a frame: pressure with the counter, and touches, in a bundle; for `moment` see `dated`."""
        pressure = self._pressure(frame.values, None if self.plain else counter)
        if self.plain:
            return pressure
        args = [value for touch in frame.touches[:3] for value in (touch.id, touch.x, touch.y)]
        types = "iff" * (len(args) // 3)
        head = osc_out.head(f"/{self.sensor}/trajectory", types)
        return osc_out.dated(moment, pressure, head + struct.pack(">" + types, *args))

    def _pressure(self, values: NDArray[np.generic], counter: int | None) -> bytes:
        address = f"/{self.sensor}/pressure"
        flat = np.ravel(values)
        types, args = ("", []) if counter is None else ("i", [(counter + 2**31) % 2**32 - 2**31])  # wraps
        if self.values in ("floats", "ints"):
            tag, numbers = ("f", flat.astype(">f4")) if self.values == "floats" else ("i", np.rint(flat).astype(">i4"))
            head = osc_out.head(address, types + tag * flat.size)
            return head + struct.pack(">" + types, *args) + numbers.tobytes()
        dtype = BLOBS[self.values]
        if dtype.kind == "u":
            flat = np.clip(np.rint(flat), 0, np.iinfo(dtype).max)
        blob: bytes = osc_out.message(address, types + "b", [*args, flat.astype(dtype).tobytes()]).dgram
        return blob


def connected(to: tuple[str, int]) -> socket.socket:
    """A UDP socket that sends to an address. Raises GesturedError if the address cannot be used."""
    try:
        family, where = look_up(to, socket.SOCK_DGRAM)
        sock = socket.socket(family, socket.SOCK_DGRAM)
        sock.connect(where)
    except OSError as error:
        raise GesturedError(f"cannot send to {Address(*to)}: {error.strerror or error}") from None
    return sock


def sent_after_refusal(sock: socket.socket, packet: bytes) -> bool:
    """Send on a connected UDP socket. Returns whether a closed port has refused an earlier packet.

    The kernel reports each refusal once, instead of sending. A connected socket also keeps this machine's address of
    the time when it was connected; if that is gone, a new socket takes its place. Raises OSError if sending fails.
    """
    try:
        sock.send(packet)
    except ConnectionRefusedError:
        sock.send(packet)
        return True
    except OSError as error:
        if error.errno != errno.ENETUNREACH:
            raise
        with socket.socket(sock.family, socket.SOCK_DGRAM) as made:
            made.connect(sock.getpeername())
            os.dup2(made.fileno(), sock.fileno(), inheritable=False)
        sock.send(packet)
    return False


class Sensor:
    """Sends frames at their times, in seconds from `start`. Raises GesturedError if the address cannot be used."""

    def __init__(self, to: tuple[str, int], form: Form) -> None:
        self.socket = connected(to)
        self.to, self.form = Address(*to), form
        self.sent = 0
        self.unheard = 0  # packets that a closed port has refused
        self.start = time.monotonic()
        self.epoch = time.time()
        self.stop = threading.Event()

    def send(self, frames: Iterable[tuple[int, Frame]]) -> None:
        """Send each (counter, frame) until `stop` is set; a late frame is sent at once. Raises GesturedError."""
        for counter, frame in frames:
            wait = self.start + frame.t - time.monotonic()
            time.sleep(max(wait, 0.0))  # a wait for `stop` may keep its lock after Ctrl-C, and `close` needs that lock
            if self.stop.is_set():
                return
            packet = self.form.packet(frame, counter, self.moment(frame.t))
            try:
                self.unheard += sent_after_refusal(self.socket, packet)
            except OSError as error:
                raise GesturedError(f"cannot send to {self.to}: {error.strerror}") from error
            self.sent += 1

    def moment(self, t: float) -> float:
        """The time `t` of a frame in seconds since the Unix epoch."""
        return self.epoch + t

    def close(self) -> None:
        """Stop sending, and close the socket."""
        self.stop.set()
        self.socket.close()
