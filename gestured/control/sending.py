"""A tape to a daemon over UDP."""

import socket
import time
from collections.abc import Iterator

from gestured.client import osc_out
from gestured.client.sensor import connected, sent_after_refusal
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.record.tape import Packet, Tape

BUNDLE = b"#bundle\0"


def send(found: Tape, to: Address, speed: float) -> int:
    """Send each packet, so many times as fast; how many were refused by a closed port. Raises GesturedError.

    Each sender of the tape gets a socket of its own: a sensor belongs to its source.
    """
    senders: dict[tuple[str, int], socket.socket] = {}
    unheard = 0
    try:
        for packet, data in _paced(found, speed):
            if packet.source not in senders:
                senders[packet.source] = connected(to)
            unheard += sent_after_refusal(senders[packet.source], data)
    except OSError as error:  # such as a packet that is longer than UDP allows
        raise GesturedError(f"a packet for {to} cannot be sent: {error.strerror}") from error
    finally:
        for sender in senders.values():
            sender.close()
    return unheard


def _paced(found: Tape, speed: float) -> Iterator[tuple[Packet, bytes]]:
    """Packets at their times; at another pace they say themselves when they were felt."""
    first, start = found.packets[0].t_ns, time.monotonic()
    for packet in found.packets:
        wait = start + (packet.t_ns - first) / 1e9 / speed - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        tagged = speed != 1 and not packet.data.startswith(BUNDLE)
        yield packet, osc_out.dated(packet.t_ns / 1e9, packet.data) if tagged else packet.data
