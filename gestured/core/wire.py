"""The contract's wire: packets -> frames that arrived and when they were felt; events -> OSC and JSON lines.

Reasons of the ProtocolErrors here: those of `osc`, `address` (none of ours), `types`, `size` (not the grid of
the sensor), `not_finite`, `too_many_touches`, `subscription`. `Stamper` drops a `duplicate` or `late` frame.
"""

import json
import math
from collections import deque
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal, NamedTuple, cast, get_args

import numpy as np
from numpy.typing import NDArray

from gestured.core import osc
from gestured.core.errors import ProtocolError
from gestured.core.events import Event, Gesture, Status
from gestured.core.frames import Touch

MAX_TOUCHES = 3
MAX_NAME = 64
MAX_LINE = 4096  # bytes of a client's request
_NAME = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-")
_MAX_ROUTES = 256
_MAX_PENDING = 256


def is_sensor(name: str) -> bool:
    """Whether `name` can be a sensor's: `[A-Za-z0-9_-]{1,64}`."""
    return 0 < len(name) <= MAX_NAME and _NAME.issuperset(name)


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
            raise ValueError(
                f"trajectory: {self.trajectory!r} cannot be told from pressure {self.pressure!r}"
            )

    def match(self, address: str) -> tuple[str, str] | None:
        """`("pressure" or "trajectory", sensor)`, or None for an address that is not ours."""
        for kind, pattern in (("pressure", self.pressure), ("trajectory", self.trajectory)):
            before, after = pattern.split("{sensor}")
            name = address[len(before) : len(address) - len(after)]
            if is_sensor(name) and address == before + name + after:
                return kind, name
        return None


def _plain(text: str) -> bool:
    return all("!" <= c <= "~" and c not in "#*,?[]{}" for c in text)


def _rest(a: str, b: str, cut: Callable[[str, str], str]) -> bool:
    """Whether one ends (or begins) with the other, and what is left could be part of a sensor's name."""
    short, long = sorted((a, b), key=len)
    rest = cut(long, short)
    return len(rest) == len(long) - len(short) and _NAME.issuperset(rest)


class Arrival(NamedTuple):
    """A frame as it was sent, not yet stamped."""

    sensor: str
    values: (
        NDArray[np.float32] | NDArray[np.float64]
    )  # (R, C) counts; float64 for int32, which float32 cannot hold
    counter: int | None  # the sensor's running frame number
    timetag: float | None  # s since the Unix epoch, of its bundle; None without one
    touches: tuple[Touch, ...]


class _Route(NamedTuple):
    """What an address with these type tags means."""

    sensor: str
    grid: tuple[int, int] | None  # None for a trajectory
    counted: bool
    fault: tuple[str, str] | None  # reason and text, where it means nothing


class Decoder:
    """Packets in, frames out. `grids` says the grid (R, C) of a sensor, as it is sent.

    Without `keep_touches`, trajectories are passed over at the address.
    """

    def __init__(
        self, addresses: Addresses, grids: Callable[[str], tuple[int, int]], *, keep_touches: bool = True
    ) -> None:
        self._addresses = addresses
        self._grids = grids
        self._keep_touches = keep_touches
        self._routes: dict[tuple[str, str], _Route | None] = {}  # a memo, bounded
        self._pending: dict[tuple[Hashable, str], tuple[Touch, ...]] = {}  # touches that wait for their frame

    def decode(self, packet: bytes, source: Hashable = None) -> tuple[list[Arrival], list[ProtocolError]]:
        """The frames of one packet in order, and what was wrong with the rest of it. Raises nothing.

        Touches belong to the frame in the same bundle (before or after it), else to the sensor's next frame
        from the same `source`.
        """
        errors: list[ProtocolError] = []
        found: list[tuple[int, str, Arrival | tuple[Touch, ...]]] = []  # the bundle's number, the sensor
        touched = bool(self._pending)
        for message in osc.decode(packet, errors):
            key = message.address, message.types
            try:
                route = self._routes.get(key) or self._learn(*key)
                if route.fault is not None:
                    raise ProtocolError(*route.fault)
                if route.grid is not None:
                    found.append((message.bundle, route.sensor, _frame(message, route)))
                elif self._keep_touches:
                    found.append((message.bundle, route.sensor, _touches(message.args)))
                    touched = True
            except ProtocolError as error:
                errors.append(error)
        if touched:
            return self._join(found, source), errors
        return [cast(Arrival, what) for _, _, what in found], errors

    def _learn(self, address: str, types: str) -> _Route:
        if len(self._routes) >= _MAX_ROUTES:
            self._routes.clear()
        route = self._routes[address, types] = self._route(address, types)
        return route

    def _route(self, address: str, types: str) -> _Route:
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
            return _Route(sensor, None, False, fault if self._keep_touches else None)
        rows, columns = self._grids(sensor)
        size = rows * columns
        if types in ("f" * size, "i" * size, "b"):
            return _Route(sensor, (rows, columns), False, None)
        if types in ("i" + "f" * size, "i" * (size + 1), "ib"):
            return _Route(sensor, (rows, columns), True, None)
        if types and (not types.strip("i") or not types.removeprefix("i").strip("f")):
            text = f"{address}: expected {rows}x{columns} values, found {len(types)} numbers"
            return _Route(sensor, None, False, ("size", text))
        text = f"{address}: expected numbers or one blob, found type tags {types[:16]!r}"
        return _Route(sensor, None, False, ("types", text))

    def _join(
        self, found: list[tuple[int, str, Arrival | tuple[Touch, ...]]], source: Hashable
    ) -> list[Arrival]:
        """Give touches to their frames; what is left over waits."""
        together: dict[tuple[int, str], list[int]] = {}
        for i, (bundle, sensor, _) in enumerate(found):
            together.setdefault((bundle, sensor), []).append(i)
        arrivals = {i: what for i, (_, _, what) in enumerate(found) if isinstance(what, Arrival)}
        for (_, sensor), members in together.items():
            frames = [i for i in members if i in arrivals]
            touches = [cast(tuple[Touch, ...], found[i][2]) for i in members if i not in arrivals]
            waiting = self._pending.pop((source, sensor), None)
            if not frames:
                if len(self._pending) >= _MAX_PENDING:
                    self._pending.pop(next(iter(self._pending)))
                self._pending[source, sensor] = touches[-1]
            elif len(frames) == len(touches):  # one each, in whatever order
                for i, theirs in zip(frames, touches, strict=True):
                    arrivals[i] = arrivals[i]._replace(touches=theirs)
            else:
                for i in members:
                    if i not in arrivals:
                        waiting = cast(tuple[Touch, ...], found[i][2])
                    elif waiting is not None:
                        arrivals[i] = arrivals[i]._replace(touches=waiting)
                        waiting = None
                if waiting is not None and not arrivals[frames[-1]].touches:
                    arrivals[frames[-1]] = arrivals[frames[-1]]._replace(touches=waiting)
        return list(arrivals.values())


def _frame(message: osc.Message, route: _Route) -> Arrival:
    """Raises ProtocolError."""
    assert route.grid is not None
    rows, columns = route.grid
    size = rows * columns
    counter: int | None = None
    sent = message.args[-1]
    if isinstance(sent, bytes):
        dtype = {4 * size: ">f4", 2 * size: ">u2", size: ">u1"}.get(len(sent))
        if dtype is None:
            text = f"expected {rows}x{columns} float32, uint16 or uint8, found {len(sent)} bytes"
            raise ProtocolError("size", f"{message.address}: {text}")
        raw = np.frombuffer(sent, dtype)
    else:
        raw = cast(NDArray[Any], sent)
    if route.counted:
        counter = int(cast(int, message.args[0] if len(message.args) == 2 else raw[0]))
        raw = raw[-size:]
    values: NDArray[Any]
    if raw.dtype.kind == "i":
        values = raw.astype(np.float64)
    else:
        values = raw.astype(np.float32)
        if not np.isfinite(values).all():
            raise ProtocolError("not_finite", f"{message.address}: NaN or infinity in a frame")
    return Arrival(route.sensor, values.reshape(rows, columns), counter, message.timetag, ())


def _touches(args: tuple[osc.Argument, ...]) -> tuple[Touch, ...]:
    """Raises ProtocolError."""
    numbers = cast(tuple[Any, ...], args)
    if not all(map(math.isfinite, numbers)):
        raise ProtocolError("not_finite", "NaN or infinity in a touch")
    return tuple(Touch(*numbers[i : i + 3]) for i in range(0, len(numbers), 3))


class Stamp(NamedTuple):
    """When a frame was felt, and what its counter says."""

    t: float  # s on the stream's clock, strictly increasing; NaN for a dropped frame
    lost: int  # frames that went missing just before this one
    dropped: Literal["", "duplicate", "late"]  # why the frame must not be used
    restarted: bool  # the sensor began anew: what was learned of it no longer holds
    implausible: bool  # clock "sensor": the time tag was missing or impossible, the arrival counts


class Stamper:
    """When the frames of one sensor were felt.

    `clock` "arrival": when they arrived. "sensor": by the increments of the time tags, as long as these go
    forward by at most `MAX_STEP_S`; else by the arrival. Frames of one call that have one time are spaced
    backwards from it, by the counter or evenly, at the rate seen so far (`rate_hz` until it is known), and
    after the frame before. So read all waiting packets before you stamp: a stall then does no harm.
    """

    MAX_STEP_S = 10.0
    MIN_STEP_S = 1e-6  # where the clock did not move; a double still tells this after 30 years
    REORDER = 16  # a frame that is so many back may have been overtaken ...
    REORDER_S = 0.5  # ... but not after such a pause
    STREAK = 3  # and so many in a row, in order, are a new start
    LEAP = 10_000  # a counter that jumps further has lost nothing, it began anew: ten seconds at 1000 Hz

    def __init__(self, clock: Literal["arrival", "sensor"] = "arrival", rate_hz: float = 15.0) -> None:
        self._by_tag = clock == "sensor"
        self._period = 1.0 / rate_hz
        self._intervals: deque[float] = deque(maxlen=15)
        self._last: float | None = None  # the last stamp
        self._arrived = 0.0  # and the arrival of its frame
        self._tag: float | None = None
        self._counter: int | None = None
        self._late: tuple[int, int] = (0, 0)  # counter of the last late frame, and how many came in a row

    def at(self, t: float) -> float:
        """The stream's time at the arrival time `t` s, for `flush`: the last stamp plus what passed since."""
        return t if self._last is None else self._last + max(0.0, t - self._arrived)

    def stamp(self, arrivals: Sequence[Arrival], t: float) -> list[Stamp]:
        """One stamp for each of this sensor's frames that were waiting at the arrival time `t` s."""
        stamps: list[Stamp] = []
        run: list[tuple[int, int]] = []  # frames with one time: index, periods since the frame before
        for i, arrival in enumerate(arrivals):
            pause = 0.0 if run else t - self._arrived
            steps, dropped, restarted = self._count(arrival.counter, pause)
            stamps.append(Stamp(math.nan, max(0, steps - 1), dropped, restarted, False))
            if dropped:
                continue
            if self._by_tag and run and arrival.timetag != arrivals[run[-1][0]].timetag:
                self._place(arrivals, stamps, run, t)
                run = []
            run.append((i, steps))
        if run:
            self._place(arrivals, stamps, run, t)
        return stamps

    def _count(self, counter: int | None, pause: float) -> tuple[int, Literal["", "duplicate", "late"], bool]:
        """(periods since the frame before, why it is dropped, whether the sensor restarted)."""
        before, self._counter = self._counter, counter
        if counter is None or before is None:
            return 1, "", False
        step = (counter - before + 2**31) % 2**32 - 2**31  # an int32 that wraps
        if 0 < step <= self.LEAP:
            self._late = (0, 0)
            return step, "", False
        if step == 0:
            return 0, "duplicate", False
        late, streak = self._late
        streak = streak + 1 if streak and counter == late + 1 else 1
        if -step <= self.REORDER and step < 0 and pause <= self.REORDER_S and streak < self.STREAK:
            self._counter, self._late = before, (counter, streak)
            return 0, "late", False
        self._late = (0, 0)
        return 1, "", True

    def _place(
        self, arrivals: Sequence[Arrival], stamps: list[Stamp], run: list[tuple[int, int]], t: float
    ) -> None:
        """Stamp frames that share one time."""
        tag = arrivals[run[-1][0]].timetag
        total = sum(steps for _, steps in run)
        implausible = False
        if self._last is None:
            end, spacing = t, self._typical()
            implausible = self._by_tag and tag is None
        else:
            step = t - self._arrived
            if self._by_tag:
                by_tag = tag - self._tag if tag is not None and self._tag is not None else 0.0
                if 0 < by_tag <= self.MAX_STEP_S:
                    step = by_tag
                else:
                    implausible = tag is None or self._tag is not None
            end = self._last + step if self._by_tag else t
            share = (end - self._last) / total
            spacing = min(self._typical(), share) if len(run) > 1 else share
            if share > 0:
                self._intervals.append(share)
        last = self._last
        for i, steps in run:
            total -= steps
            at = end - total * spacing
            if last is not None and at < last + self.MIN_STEP_S:
                at = last + self.MIN_STEP_S
            last = at
            stamps[i] = stamps[i]._replace(t=at, implausible=implausible)
        self._last, self._arrived, self._tag = last, t, tag

    def _typical(self) -> float:
        """Seconds between two frames: the median, since a late frame must not count."""
        return sorted(self._intervals)[len(self._intervals) // 2] if self._intervals else self._period


def gesture_osc(event: Gesture, epoch: float) -> bytes:
    """The OSC message of a gesture; stream time + `epoch` s = time since the Unix epoch."""
    return osc.encode_message(
        f"/gestured/{event.sensor}/gesture",
        "sfidd",
        (event.gesture, event.confidence, event.sequence, event.onset + epoch, event.offset + epoch),
    )


def status_osc(state: str, sensors: int) -> bytes:
    """The OSC sign of life: "ok", "degraded" or "no_data", and how many sensors there are."""
    return osc.encode_message("/gestured/status", "si", (state, sensors))


def event_type(event: Event) -> str:
    """What an event is called on the wire: "gesture", "onset" ..."""
    return type(event).__name__.lower()


EVENT_TYPES = tuple(cls.__name__.lower() for cls in get_args(Event))
_STREAM_TIMES = frozenset(("onset", "offset", "decided"))


def to_json(event: Event, epoch: float) -> bytes:
    """One JSON line; stream time + `epoch` s = time since the Unix epoch.

    Raises ValueError for a NaN or an infinity, which no event may hold.
    """
    line: dict[str, Any] = {"type": event_type(event)}
    for field in fields(event):
        value = getattr(event, field.name)
        line[field.name] = value + epoch if field.name in _STREAM_TIMES else value
    return _line(line)


def hello_json(
    version: str, instance: str, model: str, gestures: Sequence[str], sensors: Mapping[str, int]
) -> bytes:
    """The first line to a client; `sensors` has the last sequence of each."""
    return _line(
        {
            "type": "hello",
            "protocol": 1,
            "version": version,
            "instance": instance,
            "model": model,
            "gestures": list(gestures),
            "sensors": dict(sensors),
        }
    )


def lost_json(count: int) -> bytes:
    """Tells a client how many lines it was too slow for."""
    return _line({"type": "lost", "count": count})


def error_json(reason: str) -> bytes:
    """Tells a client what was wrong with its request."""
    return _line({"type": "error", "reason": reason})


def _line(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False, default=_plain_value).encode() + b"\n"


def _plain_value(value: Any) -> Any:
    """Mappings of any kind, and numpy's numbers."""
    return dict(value) if isinstance(value, Mapping) else value.item()


@dataclass(frozen=True, slots=True)
class Subscription:
    """What a client wants to hear; None is no filter."""

    types: frozenset[str] = frozenset(("gesture",))
    sensors: frozenset[str] | None = None
    gestures: frozenset[str] | None = None

    def matches(self, event: Event) -> bool:
        """`sensors` filters what is one sensor's, `gestures` what has a gesture's name; the rest passes."""
        if event_type(event) not in self.types:
            return False
        if self.sensors is not None and not isinstance(event, Status) and event.sensor not in self.sensors:
            return False
        return self.gestures is None or not isinstance(event, Gesture) or event.gesture in self.gestures


def parse_subscription(line: bytes) -> Subscription:
    """A client's request, `{"subscribe": {...}}`; raises ProtocolError whose text says what was expected."""
    if len(line) > MAX_LINE:
        raise _refused(f"a request has at most {MAX_LINE} bytes, found {len(line)}")
    try:
        request = json.loads(line.decode())
    except UnicodeDecodeError:
        raise _refused("a request is UTF-8") from None
    except (ValueError, RecursionError):
        raise _refused('expected one JSON object a line, as {"subscribe":{"types":["gesture"]}}') from None
    wanted = request.get("subscribe") if isinstance(request, dict) and len(request) == 1 else None
    if not isinstance(wanted, dict):
        raise _refused('expected one key "subscribe" with an object, as {"subscribe":{"types":["gesture"]}}')
    given: dict[str, frozenset[str]] = {}
    for key, value in wanted.items():
        if key not in ("types", "sensors", "gestures"):
            raise _refused(f"subscribe: unknown key {_short(key)}, expected types, sensors or gestures")
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise _refused(f"subscribe.{key}: expected a list of strings")
        for item in value:
            if key == "types" and item not in EVENT_TYPES:
                raise _refused(
                    f"subscribe.types: unknown {_short(item)}, expected any of {', '.join(EVENT_TYPES)}"
                )
            if key == "sensors" and not is_sensor(item):
                raise _refused(f"subscribe.sensors: {_short(item)} cannot be a sensor's name")
        given[key] = frozenset(value)
    return Subscription(**given)


def _refused(text: str) -> ProtocolError:
    return ProtocolError("subscription", text)


def _short(text: str) -> str:
    text = json.dumps(text)
    return text if len(text) <= 60 else text[:57] + "..."
