"""The wire: packets to frames, stamps, events to OSC and JSON, clients' requests."""

import json
import math
import typing
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_message import OscMessage

from gestured.core import events, osc, wire
from gestured.core.errors import ProtocolError
from gestured.core.events import Event, Gesture, Onset, Status
from gestured.core.frames import Touch
from gestured.core.wire import Addresses, Arrival, Decoder, Stamp, Stamper

GRID = (3, 4)
SIZE = 12
names = st.text("ABCXYZabcxyz0189_-", min_size=1, max_size=64)


def decoder(**options: bool) -> Decoder:
    return Decoder(Addresses(), lambda sensor: GRID, **options)


def pressure(values: Sequence[float], counter: int | None = None, sensor: str = "s", tag: str = "f") -> bytes:
    counted = counter is not None
    args = [counter, np.array(values)] if counted else [np.array(values)]
    if counted and tag == "i":
        args = [np.array([counter, *values])]
    return osc.encode_message(f"/{sensor}/pressure", "i" * counted + tag * len(values), args)


def blob(data: bytes, counter: int | None = None) -> bytes:
    counted = counter is not None
    return osc.encode_message("/s/pressure", "i" * counted + "b", [counter, data] if counted else [data])


def trajectory(*touches: tuple[int, float, float], sensor: str = "s") -> bytes:
    return osc.encode_message(f"/{sensor}/trajectory", "iff" * len(touches), [x for t in touches for x in t])


def one(packet: bytes) -> Arrival:
    arrivals, errors = decoder().decode(packet)
    assert errors == []
    return arrivals[0]


def fault(packet: bytes) -> str:
    arrivals, errors = decoder().decode(packet)
    assert arrivals == [] and len(errors) == 1
    return errors[0].reason


# --- addresses


@given(names)
def test_a_sensors_name_is_read_from_its_address(name: str) -> None:
    for addresses, address in (
        (Addresses(), f"/{name}/pressure"),
        (Addresses(pressure="/{sensor}"), f"/{name}"),
        (Addresses(pressure="/x/seat-{sensor}.raw"), f"/x/seat-{name}.raw"),
    ):
        assert addresses.match(address) == ("pressure", name)
    assert Addresses().match(f"/{name}/trajectory") == ("trajectory", name)


@given(st.text("/{sensor}*?ap", max_size=20) | st.text(max_size=20))
def test_an_address_that_is_not_ours_names_no_sensor(address: str) -> None:
    matched = Addresses().match(address)
    assert matched is None or address == f"/{matched[1]}/{matched[0]}" and wire.is_sensor(matched[1])


@pytest.mark.parametrize(
    "address",
    [
        "/pressure",
        "//pressure",
        "/a/b/pressure",
        "/a b/pressure",
        "/*/pressure",
        f"/{'a' * 65}/pressure",
        "/ä/pressure",
    ],
)
def test_these_are_unknown_addresses(address: str) -> None:
    assert Addresses().match(address) is None


@pytest.mark.parametrize(
    "pattern",
    [
        "",
        "/pressure",
        "{sensor}/pressure",
        "/{sensor}/{sensor}",
        "/{sensor}/p*",
        "/{sensor} /p",
        "/{Sensor}/p",
        "/{sensor}/ä",
    ],
)
def test_patterns_that_cannot_work_are_refused(pattern: str) -> None:
    with pytest.raises(ValueError, match=r"^pressure: .*\{sensor\}"):
        Addresses(pressure=pattern)


@pytest.mark.parametrize(
    ("pressure", "trajectory"),
    [
        ("/{sensor}", "/{sensor}"),
        ("/{sensor}", "/{sensor}-touch"),
        ("/a{sensor}", "/{sensor}b"),
        ("/{sensor}", "/t_{sensor}"),
    ],
)
def test_patterns_that_one_address_fits_both_are_refused(pressure: str, trajectory: str) -> None:
    with pytest.raises(ValueError, match="cannot be told"):
        Addresses(pressure, trajectory)


# --- frames


@given(st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=SIZE, max_size=SIZE))
def test_floats_arrive_as_they_were_sent(values: list[float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # large values must not overflow on the way
        sent = np.array(values, np.float32).reshape(GRID)
        for packet in (pressure(values), blob(sent.astype(">f4").tobytes())):
            arrival = one(packet)
            assert arrival.values.dtype == np.float32 and arrival.values.dtype.isnative
            assert np.array_equal(arrival.values, sent)
            assert arrival.counter is None


@given(
    st.lists(st.integers(-(2**31), 2**31 - 1), min_size=SIZE, max_size=SIZE), st.integers(-(2**31), 2**31 - 1)
)
def test_integers_arrive_exactly(values: list[int], counter: int) -> None:
    sent = np.array(values).reshape(GRID)
    assert np.array_equal(one(pressure(values, tag="i")).values, sent)
    arrival = one(pressure(values, counter, tag="i"))
    assert np.array_equal(arrival.values, sent) and arrival.counter == counter


@pytest.mark.parametrize("counter", [None, 0, -(2**31), 2**31 - 1])
@pytest.mark.parametrize("dtype", [">f4", ">u2", ">u1"])
def test_a_blob_is_told_apart_by_its_length(dtype: str, counter: int | None) -> None:
    sent = (20 * np.arange(SIZE)).astype(dtype).reshape(GRID)
    arrival = one(blob(sent.tobytes(), counter))
    assert np.array_equal(arrival.values, sent) and arrival.values.dtype == np.float32
    assert arrival.counter == counter


@pytest.mark.parametrize("grid", [(2, 2), (2, 3), (27, 15), (64, 64)])
def test_every_grid_takes_every_form(grid: tuple[int, int]) -> None:
    sent = (np.arange(grid[0] * grid[1]) % 251).reshape(grid)
    packets = [pressure(sent.ravel(), n, tag=tag) for n in (None, 9) for tag in "if"]
    packets += [blob(sent.astype(dtype).tobytes(), n) for n in (None, 9) for dtype in (">f4", ">u2", ">u1")]
    for packet in packets:
        (arrival,), errors = Decoder(Addresses(), lambda sensor: grid).decode(packet)
        assert not errors and np.array_equal(arrival.values, sent)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("at", range(SIZE))
def test_a_frame_with_a_value_that_is_not_finite_is_refused(value: float, at: int) -> None:
    values = [1.0] * SIZE
    values[at] = value
    assert fault(pressure(values)) == "not_finite"
    assert fault(pressure(values, 5)) == "not_finite"
    assert fault(blob(np.array(values, ">f4").tobytes())) == "not_finite"


@pytest.mark.parametrize(
    ("packet", "reason"),
    [
        (pressure([0.0] * (SIZE - 1)), "size"),
        (pressure([0.0] * (SIZE + 1)), "size"),
        (pressure([0.0] * (SIZE + 1), 3), "size"),
        (pressure([0] * (SIZE + 1), 3, tag="i"), "size"),
        (pressure([0] * (SIZE - 1), tag="i"), "size"),
        (blob(b""), "size"),
        (blob(bytes(SIZE + 1)), "size"),
        (blob(bytes(8 * SIZE)), "size"),
        (osc.encode_message("/s/pressure", ""), "types"),
        (osc.encode_message("/s/pressure", "s", ("x",)), "types"),
        (osc.encode_message("/s/pressure", "bi", (bytes(SIZE), 1)), "types"),
        (osc.encode_message("/s/pressure", "bb", (bytes(SIZE), bytes(SIZE))), "types"),
        (osc.encode_message("/s/pressure", "d" * SIZE, [0.0] * SIZE), "types"),
        (osc.encode_message("/s/pressure", "f" * (SIZE - 1) + "i", [0.0] * (SIZE - 1) + [1]), "types"),
        (osc.encode_message("/s/trajectory", "if", (1, 1.0)), "types"),
        (osc.encode_message("/s/trajectory", "iif", (1, 1, 1.0)), "types"),
        (trajectory(*[(i, 0.0, 0.0) for i in range(4)]), "too_many_touches"),
        (trajectory((1, math.nan, 0.0)), "not_finite"),
        (trajectory((1, 0.0, math.inf)), "not_finite"),
        (pressure([0.0] * SIZE, sensor="a/b"), "address"),
        (pressure([0.0] * SIZE, sensor="*"), "address"),
        (osc.encode_message("/tuio/2Dcur", "s", ("alive",)), "address"),
        (b"\x00\x01", "not_osc"),
        (pressure([0.0] * SIZE)[:-4], "truncated"),
    ],
)
def test_what_is_wrong_is_refused_by_reason(packet: bytes, reason: str) -> None:
    assert fault(packet) == reason


def test_good_messages_survive_bad_siblings() -> None:
    good = [pressure([float(n)] * SIZE, n) for n in range(3)]
    bad = [pressure([math.nan] * SIZE, 7), blob(b"x"), b"/x\0\0", trajectory((1, math.nan, 0.0))]
    packet = osc.encode_bundle([good[0], bad[0], good[1], *bad[1:], good[2]])
    arrivals, errors = decoder().decode(packet)
    assert [a.counter for a in arrivals] == [0, 1, 2]
    assert sorted(e.reason for e in errors) == ["not_finite", "not_finite", "size", "types"]


@given(st.binary(max_size=100), st.integers(0, 200))
def test_whatever_arrives_nothing_is_raised_and_the_stream_goes_on(junk: bytes, at: int) -> None:
    decode = decoder()
    packet = osc.encode_bundle([pressure([1.0] * SIZE, 1), trajectory((1, 1.0, 2.0))])
    for damaged in (junk, packet[:at] + junk, packet[:at] + junk + packet[at + len(junk) :]):
        for error in decode.decode(damaged)[1]:
            assert error.reason.isidentifier()
    arrivals, errors = decode.decode(packet)
    assert len(arrivals) == 1 and errors == []


def test_invented_addresses_cost_no_memory() -> None:
    decode = decoder()
    for n in range(2000):
        decode.decode(trajectory((1, 1.0, 1.0), sensor=f"s{n}"), source=n)
        decode.decode(osc.encode_message(f"/x{n}", ""))
    assert len(decode._routes) <= wire._MAX_ROUTES and len(decode._pending) <= wire._MAX_PENDING


# --- touches

A, B = Touch(1, 0.0, 2.0), Touch(2, 3.0, 1.0)
FRAME = pressure([1.0] * SIZE)
FINGER, OTHER = trajectory((1, 0.0, 2.0)), trajectory((2, 3.0, 1.0))


@pytest.mark.parametrize(
    ("packets", "expected"),
    [
        ([osc.encode_bundle([FRAME, FINGER])], [(A,)]),
        ([osc.encode_bundle([FINGER, FRAME])], [(A,)]),
        ([osc.encode_bundle([FRAME, FINGER, FRAME, OTHER])], [(A,), (B,)]),
        ([osc.encode_bundle([FINGER, FRAME, OTHER, FRAME])], [(A,), (B,)]),
        ([osc.encode_bundle([FRAME, FRAME, FINGER])], [(), (A,)]),
        (
            [osc.encode_bundle([osc.encode_bundle([FRAME, FINGER]), osc.encode_bundle([OTHER, FRAME])])],
            [(A,), (B,)],
        ),
        ([FINGER, FRAME, FRAME], [(A,), ()]),
        ([FINGER, OTHER, FRAME], [(B,)]),
        ([FINGER, osc.encode_bundle([FRAME, OTHER]), FRAME], [(B,), ()]),
        ([trajectory((1, 0.0, 2.0), (2, 3.0, 1.0)), FRAME], [(A, B)]),
        ([FINGER, trajectory(), FRAME], [()]),
        ([FINGER, pressure([1.0] * SIZE, sensor="other"), FRAME], [(), (A,)]),
        ([osc.encode_bundle([FINGER, pressure([1.0] * SIZE, sensor="other"), FRAME])], [(), (A,)]),
    ],
)  # fmt: skip
def test_touches_find_their_frame(packets: list[bytes], expected: list[tuple[Touch, ...]]) -> None:
    decode = decoder()
    assert [a.touches for packet in packets for a in decode.decode(packet)[0]] == expected


def test_a_strangers_touches_do_not_get_into_a_stream() -> None:
    decode = decoder()
    decode.decode(FINGER, source="stranger")
    assert decode.decode(FRAME, source="owner")[0][0].touches == ()


def test_touches_nobody_wants_are_passed_over() -> None:
    decode = decoder(keep_touches=False)
    packet = osc.encode_bundle([FRAME, FINGER, osc.encode_message("/s/trajectory", "if", (1, 1.0))])
    (arrival,), errors = decode.decode(packet)
    assert arrival.touches == () and errors == []


def test_a_frame_carries_the_time_tag_of_its_bundle() -> None:
    (arrival,), _ = decoder().decode(osc.encode_bundle([FRAME], 1_700_000_000.5))
    assert arrival.timetag == 1_700_000_000.5
    assert one(FRAME).timetag is None


# --- stamps

P = 1 / 15


def felt(counter: int | None = None, timetag: float | None = None) -> Arrival:
    return Arrival("s", np.zeros(GRID, np.float32), counter, timetag, ())


def stamps(stamper: Stamper, *calls: tuple[float, list[Arrival]]) -> list[Stamp]:
    return [stamp for t, arrivals in calls for stamp in stamper.stamp(arrivals, t)]


def times(got: list[Stamp]) -> list[float]:
    return [s.t for s in got if not s.dropped]


waiting = st.tuples(
    st.floats(0, 12) | st.just(P),
    st.lists(
        st.builds(
            felt,
            st.none() | st.integers(-5, 40) | st.integers(-(2**31), 2**31 - 1),
            st.none() | st.floats(0, 60),
        ),
        min_size=1,
        max_size=6,
    ),
)


@given(st.sampled_from(["arrival", "sensor"]), st.lists(waiting, max_size=12), st.floats(0, 1e7))
def test_times_increase_strictly_whatever_is_sent(clock: typing.Any, calls: list, start: float) -> None:
    stamper = Stamper(clock)
    got: list[Stamp] = []
    t = start
    for wait, arrivals in calls:
        t += wait
        new = stamper.stamp(arrivals, t)
        assert len(new) == len(arrivals)
        got += new
    at = times(got)
    assert all(a < b for a, b in zip(at, at[1:], strict=False))
    assert all(s.lost >= 0 and math.isnan(s.t) == bool(s.dropped) for s in got)
    if clock == "arrival" and at:
        assert at[-1] <= t + 1e-3  # never ahead of the clock by more than a step for each frame
        assert not any(s.implausible for s in got)


@given(st.lists(st.floats(0.001, 5), min_size=1, max_size=20))
def test_a_frame_that_comes_alone_is_stamped_when_it_arrives(waits: list[float]) -> None:
    stamper = Stamper()
    arrivals = np.cumsum(waits).tolist()
    assert times(stamps(stamper, *[(t, [felt(n)]) for n, t in enumerate(arrivals)])) == arrivals


@pytest.mark.parametrize("counted", [True, False])
def test_frames_held_up_by_a_stall_are_spread_over_it(counted: bool) -> None:
    stamper = Stamper()
    stamps(stamper, *[(n * P, [felt(n if counted else None)]) for n in range(30)])
    late = stamper.stamp([felt(n if counted else None) for n in range(30, 36)], 35 * P)
    assert times(late) == pytest.approx([n * P for n in range(30, 36)])


def test_frames_that_arrive_together_keep_the_gap_of_the_lost_one() -> None:
    stamper = Stamper()
    stamps(stamper, *[(n * P, [felt(n)]) for n in range(30)])
    got = stamper.stamp([felt(30), felt(33), felt(34)], 34 * P)
    assert times(got) == pytest.approx([30 * P, 33 * P, 34 * P])
    assert [s.lost for s in got] == [0, 2, 0]


def test_frames_after_a_pause_are_not_stretched_over_it() -> None:
    stamper = Stamper()
    stamps(stamper, *[(n * P, [felt()]) for n in range(30)])
    got = stamper.stamp([felt(), felt(), felt()], 100.0)
    assert times(got) == pytest.approx([100 - 2 * P, 100 - P, 100])


def test_a_sender_of_pairs_gets_even_times() -> None:
    stamper = Stamper()
    got = stamps(stamper, *[(n * 0.02, [felt(), felt()]) for n in range(30)])
    assert np.diff(times(got))[8:] == pytest.approx(0.01)


def test_one_late_frame_does_not_change_the_rate() -> None:
    stamper = Stamper()
    stamps(
        stamper,
        *[(n * P, [felt(n)]) for n in range(30)],
        (29 * P + 3, [felt(30)]),
        (29 * P + 3.001, [felt(31)]),
    )
    got = stamper.stamp([felt(32), felt(33)], 29 * P + 4)
    assert got[1].t - got[0].t == pytest.approx(P)


def test_a_clock_that_does_not_move_still_gives_increasing_times() -> None:
    at = times(stamps(Stamper(), *[(5.0, [felt(n)]) for n in range(10)]))
    assert at[0] == 5.0 and all(a < b < 5.001 for a, b in zip(at, at[1:], strict=False))


def counters(*sent: int, wait: float = P) -> list[str]:
    """What becomes of frames with these counters, one at a time."""
    got = stamps(Stamper(), *[(n * wait, [felt(c)]) for n, c in enumerate(sent)])
    return [s.dropped or ("restart" if s.restarted else f"lost {s.lost}" if s.lost else "ok") for s in got]


@pytest.mark.parametrize(
    ("sent", "expected"),
    [
        ((5, 6, 7), ["ok", "ok", "ok"]),
        ((5, 7, 10), ["ok", "lost 1", "lost 2"]),
        ((5, 5, 6), ["ok", "duplicate", "ok"]),
        ((5, 7, 6, 8), ["ok", "lost 1", "late", "ok"]),
        ((5, 8, 7, 6, 9), ["ok", "lost 2", "late", "late", "ok"]),
        ((2**31 - 1, -(2**31), -(2**31) + 1), ["ok", "ok", "ok"]),
        ((2**31 - 2, -(2**31)), ["ok", "lost 1"]),
        ((900, 0, 1), ["ok", "restart", "ok"]),
        ((5000, 2, 4), ["ok", "restart", "lost 1"]),
        ((10, 0, 1, 2, 3), ["ok", "late", "late", "restart", "ok"]),  # three in a row are no overtaken frames
        ((5, 500_000, 500_001), ["ok", "restart", "ok"]),
        ((5, -(2**31) + 5, -(2**31) + 6), ["ok", "restart", "ok"]),
    ],
)
def test_what_a_counter_says(sent: tuple[int, ...], expected: list[str]) -> None:
    assert counters(*sent) == expected


def test_after_a_pause_a_counter_that_goes_back_is_a_restart_at_once() -> None:
    assert counters(10, 0, 1, wait=1.0) == ["ok", "restart", "ok"]


def test_frames_overtaken_during_a_stall_are_no_restart() -> None:
    stamper = Stamper()
    got = stamps(stamper, (0.0, [felt(1)]), (0.9, [felt(3), felt(2), felt(4)]))
    assert [s.dropped for s in got] == ["", "", "late", ""] and not any(s.restarted for s in got)


def test_a_sensor_without_a_counter_is_never_late() -> None:
    got = stamps(Stamper(), *[(n * P, [felt(c)]) for n, c in enumerate((5, None, 3, None, None))])
    assert all(not s.dropped and not s.lost and not s.restarted for s in got)


def test_the_sensors_clock_counts_at_any_speed() -> None:
    stamper = Stamper("sensor")
    got = stamps(stamper, *[(50 + n * 1e-4, [felt(n, 1000 + n * P)]) for n in range(40)])
    assert times(got) == pytest.approx([50 + n * P for n in range(40)])
    assert not any(s.implausible for s in got)
    assert stamper.at(50 + 39e-4 + 2.0) == pytest.approx(50 + 39 * P + 2.0)


@pytest.mark.parametrize("tag", [990.0, 1000.0, 1010.1, 1e9, None])
def test_an_impossible_time_tag_is_replaced_by_the_arrival(tag: float | None) -> None:
    got = stamps(Stamper("sensor"), (50.0, [felt(timetag=1000.0)]), (50.5, [felt(timetag=tag)]))
    assert times(got) == [50.0, 50.5] and [s.implausible for s in got] == [False, True]


def test_ten_seconds_forward_are_plausible() -> None:
    got = stamps(Stamper("sensor"), (50.0, [felt(timetag=1000.0)]), (50.5, [felt(timetag=1010.0)]))
    assert times(got) == [50.0, 60.0] and not got[1].implausible


def test_several_frames_of_one_bundle_share_its_interval() -> None:
    stamper = Stamper("sensor")
    calls = [(50.0, [felt(timetag=1000 + n * 0.3)] * 3) for n in range(20)]
    assert np.diff(times(stamps(stamper, *calls)))[5:] == pytest.approx(0.1)


def test_packets_that_waited_together_keep_their_own_time_tags() -> None:
    stamper = Stamper("sensor")
    got = stamps(
        stamper, (50.0, [felt(timetag=1000.0)]), (51.0, [felt(timetag=1000 + x) for x in (0.1, 0.5, 0.6)])
    )
    assert times(got) == pytest.approx([50.0, 50.1, 50.5, 50.6])


# --- out

word = st.text(min_size=1, max_size=12)
number = st.floats(-1e6, 1e6)
BY_TYPE: dict[object, st.SearchStrategy] = {
    str: word,
    int: st.integers(0, 2**31 - 1),
    float: number,
    bool: st.booleans(),
    Mapping[str, float]: st.dictionaries(word, number),
    Mapping[str, str]: st.dictionaries(word, word),
}


def any_event(cls: type) -> st.SearchStrategy:
    hints = typing.get_type_hints(cls)
    return st.builds(cls, **{f.name: BY_TYPE[hints[f.name]] for f in fields(cls)})


@given(st.one_of([any_event(cls) for cls in get_args(Event)]), st.floats(0, 2e9))
def test_every_event_survives_its_json_line(event: Event, epoch: float) -> None:
    line = wire.to_json(event, epoch)
    assert line.endswith(b"\n") and line.count(b"\n") == 1
    got = json.loads(line)
    assert getattr(events, got.pop("type").capitalize()) is type(event)
    for key in ("onset", "offset", "decided"):
        if key in got:
            assert got[key] == getattr(event, key) + epoch
            got[key] = getattr(event, key)
    assert type(event)(**got) == event


GESTURE = Gesture(
    "armrest", 41, "swipe_up", 0.98, 17, 10.0, 10.5, 10.6, 12, 0, "cnn_lstm", False,
    MappingProxyType({"swipe_up": np.float32(0.5), "circle": 0.5}),
)  # fmt: skip


def test_a_gesture_looks_as_the_contract_says() -> None:
    assert wire.to_json(GESTURE, 1000.0) == (
        b'{"type":"gesture","sensor":"armrest","id":41,"gesture":"swipe_up","confidence":0.98,"sequence":17,'
        b'"onset":1010.0,"offset":1010.5,"decided":1010.6,"frames":12,"lost":0,"model":"cnn_lstm",'
        b'"degraded":false,"scores":{"swipe_up":0.5,"circle":0.5}}\n'
    )
    status = Status("ok", {"armrest": "ok"}, "cnn_lstm", 1234.5)
    assert wire.to_json(status, 1000.0) == (
        b'{"type":"status","state":"ok","sensors":{"armrest":"ok"},"model":"cnn_lstm","time":1234.5}\n'
    )
    assert wire.hello_json("0.1", "x", "m", ("a", "b"), {"armrest": 17}) == (
        b'{"type":"hello","protocol":1,"version":"0.1","instance":"x","model":"m","gestures":["a","b"],'
        b'"sensors":{"armrest":17}}\n'
    )
    assert wire.lost_json(3) == b'{"type":"lost","count":3}\n'
    assert json.loads(wire.error_json('odd "ä"\n')) == {"type": "error", "reason": 'odd "ä"\n'}


@pytest.mark.parametrize("value", [math.nan, math.inf, np.float32("nan")])
def test_no_nan_leaves_the_house(value: float) -> None:
    with pytest.raises(ValueError):
        wire.to_json(Onset("s", 1, value), 0.0)
    with pytest.raises(ValueError):
        wire.to_json(Status("ok", {"s": value}, "m", 1.0), 0.0)  # type: ignore[dict-item]


def test_osc_out_is_read_by_python_osc() -> None:
    message = OscMessage(wire.gesture_osc(GESTURE, 1_700_000_000.0))
    assert message.address == "/gestured/armrest/gesture"
    assert message.params == ["swipe_up", pytest.approx(0.98), 17, 1_700_000_010.0, 1_700_000_010.5]
    status = OscMessage(wire.status_osc("no_data", 2))
    assert (status.address, status.params) == ("/gestured/status", ["no_data", 2])


# --- requests


def request(**wanted: object) -> bytes:
    return json.dumps({"subscribe": wanted}).encode()


def test_what_is_left_out_is_no_filter() -> None:
    default = wire.parse_subscription(request())
    assert default == wire.Subscription()
    assert default.matches(GESTURE) and not default.matches(Onset("armrest", 1, 0.0))


def test_subscriptions_filter() -> None:
    chosen = wire.parse_subscription(
        request(types=["gesture", "onset", "status"], sensors=["armrest"], gestures=["swipe_up"]) + b"\r\n"
    )
    assert chosen.matches(GESTURE) and chosen.matches(Onset("armrest", 1, 0.0))
    assert chosen.matches(Status("ok", {}, "m", 1.0))
    assert not chosen.matches(Onset("door", 1, 0.0))
    assert not chosen.matches(events.Release("armrest", 1, 0.0))
    assert not wire.parse_subscription(request(gestures=["circle"])).matches(GESTURE)
    assert not wire.parse_subscription(request(types=[])).matches(GESTURE)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (b"", "JSON"),
        (b"hello", "JSON"),
        (b"\xff", "UTF-8"),
        (b"[" * 4000, "JSON"),
        (b'{"a":' * 800, "JSON"),
        (b" " * 5000, "4096"),
        (b"[]", '"subscribe"'),
        (b"NaN", '"subscribe"'),
        (b"{}", '"subscribe"'),
        (b'{"subscribe":[]}', '"subscribe"'),
        (b'{"subscribe":{},"x":1}', '"subscribe"'),
        (request(type=["gesture"]), '"type", expected types, sensors or gestures'),
        (request(types="gesture"), "subscribe.types: expected a list of strings"),
        (request(gestures=[1]), "subscribe.gestures: expected a list of strings"),
        (request(sensors=None), "subscribe.sensors: expected a list of strings"),
        (request(types=["tap"]), '"tap", expected any of onset, gesture'),
        (request(sensors=["a b"]), '"a b" cannot be a sensor'),
        (
            b'{"subscribe":{"types":' + b"[" * 300 + b"]" * 300 + b"}}",
            "subscribe.types: expected a list of strings",
        ),
    ],
)
def test_requests_that_are_none_are_answered_with_what_was_expected(line: bytes, says: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        wire.parse_subscription(line)
    assert caught.value.reason == "subscription" and says in str(caught.value)
    json.loads(wire.error_json(str(caught.value)))


keys = st.sampled_from(["subscribe", "types", "sensors", "x"])
leaves = st.none() | st.booleans() | st.floats() | st.text(max_size=5) | st.just("gesture")
trees = st.recursive(leaves, lambda x: st.lists(x, max_size=3) | st.dictionaries(keys, x, max_size=3))


@given(st.binary(max_size=60) | trees.map(lambda x: json.dumps(x).encode()))
def test_any_line_is_a_subscription_or_a_protocol_error(line: bytes) -> None:
    try:
        assert isinstance(wire.parse_subscription(line), wire.Subscription)
    except ProtocolError as error:
        assert error.reason == "subscription"
