"""The decoder of packets: from OSC messages to the frames of sensors, with their touches.

Reasons of the ProtocolErrors here: those of `osc`, `address` (no sensor's), `types`, `size` (not the grid of
the sensor), `not_finite`, `too_many_touches`.
"""

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gestured.core import osc
from gestured.core.address import NAME_LETTERS, is_sensor
from gestured.core.errors import ProtocolError
from gestured.core.frames import Touch
from gestured.core.osc import Argument, Layout, Layouts, Message, Slot

MAX_TOUCHES = 3  # touches of one trajectory message
# How the values of a blob are encoded, by its bytes for each taxel; a blob of any other size is refused.
_BLOBS: dict[float, np.dtype[Any]] = {4: np.dtype(">f4"), 2: np.dtype(">u2"), 1: np.dtype(">u1")}
_MAX_ROUTES = 4096  # addresses that are remembered; a sensor has one or two, so 2000 sensors have room
_MAX_PENDING = 256  # sensors whose touches wait for a frame: a sender could invent names without end
FEW = 4  # from so many packets of one form on, reading them together is cheaper


@dataclass(frozen=True, slots=True)
class Addresses:
    """The patterns of the addresses that sensors send to; `{sensor}` stands for the sensor's name.

    Raises ValueError naming the pattern.
    """

    pressure: str = "/{sensor}/pressure"
    trajectory: str = "/{sensor}/trajectory"

    def __post_init__(self) -> None:
        for key, pattern in (("pressure", self.pressure), ("trajectory", self.trajectory)):
            rest = pattern.replace("{sensor}", "", 1)
            if not pattern.startswith("/") or rest == pattern or not _plain(rest):
                raise ValueError(
                    f"{key}: expected an OSC address with one {{sensor}} and no wildcards, found {pattern!r}"
                )
        (before, after), (other_before, other_after) = (
            pattern.split("{sensor}") for pattern in (self.pressure, self.trajectory)
        )
        if _rest(before, other_before, str.removeprefix) and _rest(after, other_after, str.removesuffix):
            expected = f"an address that can be told from pressure {self.pressure!r}"
            raise ValueError(f"trajectory: expected {expected}, found {self.trajectory!r}")

    def match(self, address: str) -> tuple[str, str] | None:
        """`("pressure" or "trajectory", sensor)`, or None for an address that is no sensor's."""
        for kind, pattern in (("pressure", self.pressure), ("trajectory", self.trajectory)):
            before, after = pattern.split("{sensor}")
            name = address[len(before) : len(address) - len(after)]
            if is_sensor(name) and address == before + name + after:
                return kind, name
        return None


def _plain(text: str) -> bool:
    return all("!" <= c <= "~" and c not in "#*,?[]{}" for c in text)


def _rest(a: str, b: str, cut: Callable[[str, str], str]) -> bool:
    """Whether `cut` takes the shorter text off the longer, and leaves what could be part of a sensor's name."""
    short, long = sorted((a, b), key=len)
    rest = cut(long, short)
    return len(rest) == len(long) - len(short) and NAME_LETTERS.issuperset(rest)


_new = tuple.__new__  # Arrival(...) takes twice the time


class Arrival(NamedTuple):
    """A frame as it was sent, not yet stamped."""

    sensor: str
    values: NDArray[np.float32] | NDArray[np.float64]  # (R, C) counts; float64 for int32, which float32 cannot hold
    counter: int | None  # the sensor's running frame number
    timetag: float | None  # s since the Unix epoch, of its bundle; None without one
    touches: tuple[Touch, ...]


class Block(NamedTuple):
    """The frames of n packets, all of one grid, with counters and time tags or all without."""

    packets: list[int]  # the packets' indices among all that were found waiting, in rising order
    sensors: list[str]
    values: NDArray[np.float32] | NDArray[np.float64]  # (n, R, C) counts, as in `Arrival`
    counters: NDArray[np.int64] | None
    tags: NDArray[np.float64] | None  # s since the Unix epoch; NaN for "immediately"

    def only(self, places: NDArray[np.intp]) -> "Block":
        """The block of the frames in these places of this one."""
        packets, sensors = ([each[n] for n in places.tolist()] for each in (self.packets, self.sensors))
        counters = None if self.counters is None else self.counters[places]
        return Block(packets, sensors, self.values[places], counters, None if self.tags is None else self.tags[places])

    def arrival(self, n: int) -> Arrival:
        """The frame in place `n`, by itself."""
        counter = None if self.counters is None else int(self.counters[n])
        tag = None if self.tags is None or math.isnan(self.tags[n]) else float(self.tags[n])
        return Arrival(self.sensors[n], self.values[n], counter, tag, ())


class _Route(NamedTuple):
    """What an address with these type tags means."""

    sensor: str
    grid: tuple[int, int] | None  # None for a trajectory
    counted: bool  # whether the frame's counter comes first
    fault: tuple[str, str] | None  # reason and text of the ProtocolError, if address or type tags are wrong


class _Meaning(NamedTuple):
    """What a packet of one layout means, if it holds one frame and nothing else that is wanted."""

    route: _Route
    slot: Slot  # of the frame's message
    dtype: np.dtype[Any]  # of the frame's values as they are sent
    form: int  # the same number for layouts with heads and frame in the same places, of the same type and grid
    heads: bytes  # the heads of all its messages, and the size of a blob, joined
    places: tuple[tuple[int, int], ...]  # the bytes at which each of them begins and ends in the packet
    touches: tuple[int, ...]  # the bytes at which each finger's x and y begin


# Packets of one form: their indices among all, the meaning of the first, their sensors, and their heads, joined.
_Group = tuple[list[int], _Meaning, list[str], bytes]


class Decoder:
    """Packets in, frames out. `grids` says the grid (R, C) of a sensor, as it is sent.

    Without `keep_touches`, a trajectory is checked and then forgotten.
    """

    def __init__(
        self, addresses: Addresses, grids: Callable[[str], tuple[int, int]], *, keep_touches: bool = True
    ) -> None:
        self._addresses = addresses
        self._grids = grids
        self._keep_touches = keep_touches
        self._layouts = Layouts()
        self._route = lru_cache(_MAX_ROUTES)(self._find_route)
        self._forms: dict[tuple[object, ...], int] = {}  # a number for each form, since numbers compare faster
        self._numbers = count()
        # The layouts, lengths and groups of the packets of the last read, since the next read is often laid out alike.
        self._seen: tuple[list[Layout | None], list[int]] = [], []
        self._groups: list[_Group] = []
        self._pending: dict[tuple[Hashable, str], tuple[Touch, ...]] = {}  # touches that wait for their frame

    def decode(self, packet: bytes, source: Hashable = None) -> tuple[list[Arrival], list[ProtocolError]]:
        """The frames of one packet in order, and what was wrong with the rest of it. Raises nothing.

        Touches belong to the frame in the same bundle (before or after it), else to the sensor's next frame
        from the same `source`.
        """
        errors: list[ProtocolError] = []
        arrivals: list[Arrival] = []
        found: list[tuple[int, str, Arrival | tuple[Touch, ...]]] = []  # by message: bundle, sensor, content
        touched = bool(self._pending)
        for message in osc.decode(packet, errors, self._layouts):
            try:
                route = self._route(message.address, message.types)
                if route.fault is not None:
                    raise ProtocolError(*route.fault)
                if route.grid is not None:
                    arrivals.append(arrival := _frame(message, route))
                    if self._keep_touches:
                        found.append((message.bundle, route.sensor, arrival))
                else:
                    touches = _touches(message.args)
                    if self._keep_touches:
                        found.append((message.bundle, route.sensor, touches))
                        touched = True
            except ProtocolError as error:
                errors.append(error)
        return (self._join(found, source) if touched else arrivals), errors

    def together(self, packets: Sequence[bytes]) -> list[Block]:
        """The frames of packets whose layouts are known, in one block for each kind of frames.

        A block holds what `decode` gives of each of its packets, in a fraction of the time. The caller has to give
        `decode` the packets that are in no block: few others are laid out as they are, or a value is not finite.
        """
        layouts, lengths = self._layouts.guess(packets), [len(packet) for packet in packets]
        if (layouts, lengths) != self._seen:
            self._seen, self._groups = (layouts, lengths), self._group(layouts, lengths)
        found: dict[tuple[object, ...], list[Block]] = {}
        for group in self._groups:
            one = _block(packets, group)
            key = one.values.shape[1:], one.values.dtype, one.counters is None, one.tags is None
            found.setdefault(key, []).append(one)
        return [_joined(blocks) for blocks in found.values()]

    def _group(self, layouts: list[Layout | None], lengths: list[int]) -> list[_Group]:
        """The groups of packets that may have these layouts, and have these lengths."""
        alike: dict[int, list[tuple[int, _Meaning]]] = {}
        for i, layout in enumerate(layouts):
            if layout is not None and layout.length == lengths[i]:
                meaning: _Meaning | Literal[False] = layout.meaning
                if meaning is None:
                    meaning = layout.meaning = self._meaning(layout)
                if meaning:
                    alike.setdefault(meaning.form, []).append((i, meaning))
        several = (zip(*members, strict=True) for members in alike.values() if len(members) >= FEW)
        return [
            (list(found), meanings[0], [m.route.sensor for m in meanings], b"".join([m.heads for m in meanings]))
            for found, meanings in several
        ]

    def _meaning(self, layout: Layout) -> _Meaning | Literal[False]:
        """The meaning of packets of a layout; False if each of them has to be read by itself."""
        routes = [self._route(slot.address, slot.types) for slot in layout.slots]
        frames = [(r, p) for r, p in zip(routes, layout.slots, strict=True) if r.grid is not None]
        if self._keep_touches or any(route.fault for route in routes) or len(frames) != 1:
            return False
        route, slot = frames[0]
        rows, columns = route.grid or (0, 0)
        dtype = slot.dtype if slot.dtype is not None else _BLOBS.get(slot.length / (rows * columns))
        if dtype is None or any(other.blob for other in layout.slots if other is not slot):
            return False
        heads = [(other.start, other.head) for other in layout.slots]
        if slot.blob:  # the size that stands before it
            heads.append((slot.run - 4, slot.length.to_bytes(4, "big")))
        places = tuple([(start, start + len(head)) for start, head in heads])
        # A trajectory's arguments are scalars of 4 bytes, three for each finger.
        touches = tuple(
            [o.scalars + at for o in layout.slots if o is not slot for at in range(4, 4 * len(o.types), 12)]
        )
        form = layout.length, places, touches, slot.run, slot.length, slot.blob, dtype.kind, route.grid, route.counted
        if len(self._forms) >= _MAX_ROUTES:
            self._forms.clear()
        number = self._forms.setdefault(form, next(self._numbers))
        return _Meaning(route, slot, dtype, number, b"".join([head for _, head in heads]), places, touches)

    def _find_route(self, address: str, types: str) -> _Route:
        matched = self._addresses.match(address)
        if matched is None:
            return _Route("", None, False, ("address", f"{address!r} is no sensor's address"))
        kind, sensor = matched
        if kind == "trajectory":
            fault = None
            if types != "iff" * (len(types) // 3):
                fault = "types", f"{address}: expected i f f for each touch, found {types[:16]!r}"
            elif len(types) > 3 * MAX_TOUCHES:
                fault = "too_many_touches", f"{address}: at most {MAX_TOUCHES}, found {len(types) // 3}"
            return _Route(sensor, None, False, fault)
        rows, columns = self._grids(sensor)
        size = rows * columns
        if types in ("f" * size, "i" * size, "b"):
            return _Route(sensor, (rows, columns), False, None)
        if types in ("i" + "f" * size, "i" * (size + 1), "ib"):
            return _Route(sensor, (rows, columns), True, None)
        if types and (not types.strip("i") or not types.removeprefix("i").strip("f")):
            text = f"{address}: expected {rows}x{columns} values, found {len(types)} numbers"
            return _Route(sensor, None, False, ("size", text))
        text = f"{address}: expected the type tags f, i or one b, found {types[:16]!r}"
        return _Route(sensor, None, False, ("types", text))

    def _join(self, found: list[tuple[int, str, Arrival | tuple[Touch, ...]]], source: Hashable) -> list[Arrival]:
        """Give touches to their frames; touches without a frame wait for the next one."""
        together: dict[tuple[int, str], list[int]] = {}
        for i, (bundle, sensor, _) in enumerate(found):
            together.setdefault((bundle, sensor), []).append(i)
        arrivals = {i: what for i, (_, _, what) in enumerate(found) if isinstance(what, Arrival)}
        for (_, sensor), members in together.items():
            frames = [i for i in members if i in arrivals]
            touches: list[Any] = [found[i][2] for i in members if i not in arrivals]
            waiting: Any = self._pending.pop((source, sensor), None)
            if not frames:
                if len(self._pending) >= _MAX_PENDING:
                    self._pending.pop(next(iter(self._pending)))
                self._pending[source, sensor] = touches[-1]
            elif len(frames) == len(touches):  # each frame has its touches, in whatever order they came
                for i, theirs in zip(frames, touches, strict=True):
                    arrivals[i] = arrivals[i]._replace(touches=theirs)
            else:
                for i in members:
                    if i not in arrivals:
                        waiting = found[i][2]
                    elif waiting is not None:
                        arrivals[i] = arrivals[i]._replace(touches=waiting)
                        waiting = None
                if waiting is not None and not arrivals[frames[-1]].touches:
                    arrivals[frames[-1]] = arrivals[frames[-1]]._replace(touches=waiting)
        return list(arrivals.values())


def _frame(message: Message, route: _Route) -> Arrival:
    """The frame of a message whose address and type tags are those of `route`. Raises ProtocolError."""
    assert route.grid is not None
    rows, columns = route.grid
    size = rows * columns
    args: tuple[Any, ...] = message.args
    raw = args[-1]
    if isinstance(raw, bytes):
        dtype = _BLOBS.get(len(raw) / size)
        if dtype is None:
            text = f"expected {rows}x{columns} float32, uint16 or uint8, found {len(raw)} bytes"
            raise ProtocolError("size", f"{message.address}: {text}")
        raw = np.frombuffer(raw, dtype)
    counter: int | None = None
    if route.counted:
        counter = int(args[0] if len(args) == 2 else raw[0])
        raw = raw[-size:]
    values: NDArray[Any]
    if raw.dtype.kind == "i":
        values = raw.astype(np.float64)
    else:
        values = raw.astype(np.float32)
        if raw.dtype.kind == "f" and 0 in np.isfinite(values).tobytes():  # half the price of .all() at this size
            raise ProtocolError("not_finite", f"{message.address}: NaN or infinity in a frame")
    return _new(Arrival, (route.sensor, values.reshape(rows, columns), counter, message.timetag, ()))


def _block(packets: Sequence[bytes], group: _Group) -> Block:
    """The frames of packets that may be of one form, without packets with other heads or values that are not finite."""
    found, (route, slot, dtype, _, _, places, touches), sensors, expected = group
    assert route.grid is not None
    taxels, size = math.prod(route.grid), slot.length if slot.blob else slot.length * dtype.itemsize
    block = np.frombuffer(b"".join([packets[i] for i in found]), np.uint8).reshape(len(found), -1)
    raw = block[:, slot.run : slot.run + size].view(dtype)
    values: NDArray[Any] = raw[:, -taxels:].astype(np.float64 if dtype.kind == "i" else np.float32)
    finite = np.isfinite(values)
    for at in touches:
        finite = np.concatenate([finite, np.isfinite(block[:, at : at + 8].view(">f4"))], axis=1)
    heads = np.concatenate([block[:, begin:end] for begin, end in places], axis=1)
    counters = tags = None
    if route.counted:
        first = raw if slot.unpack is None else block[:, slot.scalars : slot.scalars + 4].view(">i4")
        counters = first[:, 0].astype(np.int64)
    if slot.start:  # outside of a bundle a message begins at 0
        tags = osc.timetags(block[:, 8:16])
    read = Block(found, sensors, values.reshape(-1, *route.grid), counters, tags)
    if heads.tobytes() == expected and 0 not in finite.tobytes():  # much faster than row by row
        return read
    same = heads == np.frombuffer(expected, np.uint8).reshape(heads.shape)
    return read.only((same.all(axis=1) & finite.all(axis=1)).nonzero()[0])


def _joined(blocks: list[Block]) -> Block:
    """Several blocks as one, in the order of their packets; sensors' names of different lengths make several forms."""
    if len(blocks) == 1:
        return blocks[0]
    packets, sensors, values, counters, tags = zip(*blocks, strict=True)
    every = Block(
        sum(packets, []), sum(sensors, []), np.concatenate(values),
        None if counters[0] is None else np.concatenate(counters), None if tags[0] is None else np.concatenate(tags),
    )  # fmt: skip
    return every.only(np.argsort(every.packets))


def _touches(args: tuple[Argument, ...]) -> tuple[Touch, ...]:
    """The fingers of a trajectory's arguments, three for each. Raises ProtocolError."""
    numbers: tuple[Any, ...] = args
    if not all(map(math.isfinite, numbers)):
        raise ProtocolError("not_finite", "NaN or infinity in a touch")
    return tuple(Touch(*numbers[i : i + 3]) for i in range(0, len(numbers), 3))
