"""Golden tapes: packets as they were found waiting, at times that are written down, and the scene that they play in.

A group of tapes stands in one compressed file. A file keeps equal things together (all times, all lengths, all
packets), which compresses well, and tapes that damage the same session cost little more than one of them. They are
data, and are not made anew: programs of the commits up to e5caf71 drew them from the simulator.
"""

import hashlib
import json
import lzma
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FOLDER = Path(__file__).parent / "tapes"
GROUPS = tuple(sorted(path.stem for path in FOLDER.glob("*.xz")))
TICK_NS = 250_000_000  # the daemon's loop comes round at least so often
REST_NS = 2_500_000_000  # that a daemon goes on after the last packet
Source = tuple[str, int]  # host and port of a sender


class Packet(NamedTuple):
    """A datagram, and when it was read."""

    t_ns: int  # on the monotonic clock; packets of one time were found waiting together
    source: Source
    data: bytes


@dataclass(frozen=True)
class Tape:
    """What came, and the settings that decide what becomes of it."""

    name: str
    about: str  # one line: what it is there for
    packets: tuple[Packet, ...]  # in order of time
    ticks: tuple[int, ...]  # ns, when the daemon looked for silent sensors; after what was read at the same time
    end_ns: int  # when the daemon stops
    settings: Mapping[str, Any] = field(default_factory=dict)  # as in a configuration file

    def steps(self) -> Iterator[tuple[float, list[tuple[bytes, Source]] | None]]:
        """(s, packets that were found waiting), or (s, None) for a look for silent sensors, in order."""
        reads = [(t, 0, [(p.data, p.source) for p in group]) for t, group in groupby(self.packets, lambda p: p.t_ns)]
        for t, _, waiting in sorted([*reads, *((t, 1, None) for t in self.ticks)], key=lambda step: step[:2]):
            yield t / 1e9, waiting

    def digest(self) -> str:
        """SHA-256 of all that decides."""
        told = json.dumps([self.name, self.settings, self.ticks, self.end_ns], sort_keys=True)
        found = hashlib.sha256(told.encode())
        for packet in self.packets:
            found.update(f"{packet.t_ns} {packet.source} {len(packet.data)} ".encode() + packet.data)
        return found.hexdigest()


def arrived(name: str, about: str, packets: Iterable[Packet], settings: Mapping[str, Any]) -> Tape:
    """A tape of packets at a daemon that never stands still and goes on for a while; times count from the first."""
    every = list(packets)
    found = tuple(packet._replace(t_ns=packet.t_ns - every[0].t_ns) for packet in every)
    end = found[-1].t_ns + REST_NS
    return Tape(name, about, found, tuple(range(TICK_NS, end + 1, TICK_NS)), end, settings)


def write(name: str, tapes: Sequence[Tape], folder: Path = FOLDER) -> int:
    """Keep tapes in the file `name`; says how many bytes it has."""
    heads, columns = [], [bytearray() for _ in range(5)]
    for tape in tapes:
        sources = sorted({packet.source for packet in tape.packets})
        heads.append(
            {
                "name": tape.name, "about": tape.about, "settings": tape.settings, "sources": sources,
                "packets": len(tape.packets), "ticks": len(tape.ticks), "end_ns": tape.end_ns,
            }
        )  # fmt: skip
        columns[0] += np.diff([0, *(p.t_ns for p in tape.packets)]).astype("<i8").tobytes()
        columns[1] += np.diff([0, *tape.ticks]).astype("<i8").tobytes()
        columns[2] += np.array([sources.index(p.source) for p in tape.packets], "<u2").tobytes()
        columns[3] += np.array([len(p.data) for p in tape.packets], "<u4").tobytes()
        columns[4] += b"".join(p.data for p in tape.packets)
    head = json.dumps(heads).encode() + b"\n"
    packed = lzma.compress(head + b"".join(columns), preset=9 | lzma.PRESET_EXTREME)
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.xz").write_bytes(packed)
    return len(packed)


def read(name: str, folder: Path = FOLDER) -> list[Tape]:
    """The tapes of the file `name`."""
    head, _, rest = lzma.decompress((folder / f"{name}.xz").read_bytes()).partition(b"\n")
    heads = json.loads(head)
    packets, looks = sum(h["packets"] for h in heads), sum(h["ticks"] for h in heads)
    at = 0

    def column(dtype: str, count: int) -> Any:
        nonlocal at
        found = np.frombuffer(rest, dtype, count, at)
        at += found.nbytes
        return found

    times, moments = column("<i8", packets), column("<i8", looks)
    senders, lengths = column("<u2", packets), column("<u4", packets)
    tapes, packet, look = [], 0, 0
    for h in heads:
        mine = slice(packet, packet := packet + h["packets"])
        sources = [(host, port) for host, port in h["sources"]]
        found = []
        for t, sender, length in zip(np.cumsum(times[mine]), senders[mine], lengths[mine], strict=True):
            found.append(Packet(int(t), sources[sender], rest[at : at + int(length)]))
            at += int(length)
        every = tuple(np.cumsum(moments[look : (look := look + h["ticks"])]).tolist())
        tapes.append(Tape(h["name"], h["about"], tuple(found), every, h["end_ns"], h["settings"]))
    return tapes
