"""What each scene costs, counted: bytecode instructions for a frame, and the packages that it loads."""

import json
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import mean, median
from typing import Any

from benchmarks.process import Program, free_socket
from gestured.core.address import Address

AGAIN = 5  # counts of each frame, of which the lowest is used: waiting on a busy machine takes more instructions


@dataclass(frozen=True)
class Count:
    """The packages that one scene loads, and the instructions of each frame with all that follows from it."""

    packages: frozenset[str]
    frames: tuple[int, ...]


def table(found: Mapping[str, Count]) -> str:
    """The table of counts, each scene beside the first."""
    least = next(iter(found.values()))
    lines = [
        "| scene | instructions of a frame, mean | beside minimal | of the median frame | packages more | fewer |",
        "|---|---|---|---|---|---|",
    ]
    for name, count in found.items():
        more, fewer = count.packages - least.packages, least.packages - count.packages
        lines.append(
            f"| {name} | {mean(count.frames):.0f} | {mean(count.frames) - mean(least.frames):+.0f} "
            f"| {median(count.frames):.0f} | {', '.join(sorted(more)) or '-'} | {', '.join(sorted(fewer)) or '-'} |"
        )
    return "\n".join(lines)


def counted(model: str, flags: tuple[str, ...], stream: list[bytes], again: int = AGAIN) -> Count:
    """Count a daemon with these flags; each packet of the stream is sent once the one before is done with."""
    found = [_once(model, flags, stream) for _ in range(again)]
    packages = frozenset(name.split(".")[0] for name in found[0][1])
    return Count(packages, tuple(map(min, zip(*(frames for frames, _ in found), strict=True))))


def _once(model: str, flags: tuple[str, ...], stream: list[bytes]) -> tuple[list[int], list[str]]:
    where = ("--model", model, "--listen", "127.0.0.1:0", "--socket", free_socket(), "--grid", "9x9")
    quiet = () if "--log-level" in flags else ("--log-level", "error")
    each: list[int] = []
    with (
        Program("counted", *where, "--clock", "sensor", *quiet, *flags) as program,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock,
    ):
        sock.connect(("127.0.0.1", Address.parse(program.ready["listen"])[1]))
        for packet in stream:
            sock.send(packet)
            found, waiting, instructions = _line(program)
            while waiting or not found:
                packets, waiting, more = _line(program)
                found, instructions = found + packets, instructions + more
            each.append(instructions)
        program.process.terminate()
        last = _line(program)
        while last and isinstance(last[0], int):  # readings that found nothing
            last = _line(program)
    return each, last


def _line(program: Program) -> Any:
    assert program.process.stdout is not None
    return json.loads(program.process.stdout.readline())
