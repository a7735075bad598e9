"""One source that sends far too much: `python -m tests.hostile.flood 127.0.0.1:9000 frames --seconds 5`."""

import argparse
import socket
import sys
import time
from contextlib import ExitStack

import numpy as np

from gestured.core.address import Address
from tests import encoding

PAUSE_S = 0.001  # between two looks at the clock, so that packets come as evenly as they can
OWNERS = 58  # names, and so sensors, of the kinds "owners" and "claims"
CALM_S = 1.0  # for which they are sensors like any other, so that they own their names


def packets(kind: str) -> list[bytes]:
    """What is sent in turn."""
    values = np.full(81, 20.0, np.float32)
    if kind == "rubbish":
        return [b"x" * 340]
    if kind == "frames":  # of one sensor
        return [encoding.message("/flood/pressure", "f" * 81, (values,))]
    if kind == "sensors":  # of a new sensor each time
        return [encoding.message(f"/flood{i}/pressure", "f" * 81, (values,)) for i in range(1000)]
    names = [f"/flood{i}" for i in range(OWNERS)] if kind in ("owners", "claims") else ["/flood"]
    frames = [encoding.message(f"{name}/pressure", "b", (bytes(81),)) for name in names]
    return [encoding.bundle([frame] * 500) for frame in frames]  # as many frames as a packet can hold


def main() -> int:
    """Send at the rate, or as fast as it goes; print how many packets a second went out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("to", type=Address.parse)
    parser.add_argument("kind", choices=("rubbish", "frames", "sensors", "full", "owners", "claims"))
    parser.add_argument("--rate", type=float, default=50_000.0, help="packets a second")
    parser.add_argument("--ports", type=int, default=1, help="sent from so many ports in turn (default: 1)")
    parser.add_argument("--seconds", type=float, default=5.0)
    args = parser.parse_args()
    what, sent = packets(args.kind), 0
    with ExitStack() as stack:
        socks = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(args.ports)]
        for sock in socks:
            sock.connect(args.to)
        for _ in range(round(10 * CALM_S) if args.kind == "owners" else 0):
            for n, sock in enumerate(socks):
                sock.send(encoding.message(f"/flood{n % OWNERS}/pressure", "b", (bytes(81),)))
            time.sleep(0.1)
        start = time.monotonic()
        while (passed := time.monotonic() - start) < args.seconds:
            if sent > passed * args.rate:
                time.sleep(PAUSE_S)
                continue
            for _ in range(max(1, int(args.rate * PAUSE_S))):
                socks[sent % len(socks)].send(what[sent % len(what)])
                sent += 1
    print(f"{args.kind}: {sent / args.seconds:.0f} packets/s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
