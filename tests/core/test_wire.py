"""What comes in: packets to frames, and what becomes of those that are none."""

import math
import warnings
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gestured.core import wire
from gestured.core.address import is_sensor
from gestured.core.frames import Touch
from gestured.core.wire import Addresses, Arrival, Decoder
from tests import encoding

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
    return encoding.message(f"/{sensor}/pressure", "i" * counted + tag * len(values), args)


def blob(data: bytes, counter: int | None = None, sensor: str = "s") -> bytes:
    counted = counter is not None
    return encoding.message(f"/{sensor}/pressure", "i" * counted + "b", [counter, data] if counted else [data])


def trajectory(*touches: tuple[int, float, float], sensor: str = "s") -> bytes:
    return encoding.message(f"/{sensor}/trajectory", "iff" * len(touches), [x for t in touches for x in t])


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
    assert matched is None or address == f"/{matched[1]}/{matched[0]}" and is_sensor(matched[1])


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
    with pytest.raises(ValueError, match="expected an address that can be told"):
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


@given(st.lists(st.integers(-(2**31), 2**31 - 1), min_size=SIZE, max_size=SIZE), st.integers(-(2**31), 2**31 - 1))
def test_integers_arrive_exactly(values: list[int], counter: int) -> None:
    sent = np.array(values).reshape(GRID)
    assert np.array_equal(one(pressure(values, tag="i")).values, sent)
    arrival = one(pressure(values, counter, tag="i"))
    assert np.array_equal(arrival.values, sent) and arrival.counter == counter


@example((64, 64), 1, 8, 0)
@given(
    st.tuples(st.integers(2, 27), st.integers(2, 27)), st.integers(1, 4), st.sampled_from([8, 16]), st.integers(0, 999)
)
def test_the_form_of_frames_changes_nothing(grid: tuple[int, int], count: int, bits: int, seed: int) -> None:
    """Floats, integers and blobs, with a counter and without, in packets of their own or all in one bundle."""
    sent = np.random.default_rng(seed).integers(0, 1 << bits, (count, *grid))
    blobs = (">f4", ">u2", ">u1") if bits == 8 else (">f4", ">u2")
    counters = (None, -(2**31), 2**31 - 1)
    forms = [(n, [pressure(frame.ravel(), n, tag=tag) for frame in sent]) for n in counters for tag in "if"]
    forms += [(n, [blob(frame.astype(dtype).tobytes(), n) for frame in sent]) for n in counters for dtype in blobs]
    for n, packets in (*forms, *((n, [encoding.bundle(form)]) for n, form in forms)):
        decode = Decoder(Addresses(), lambda sensor: grid)
        found = [decode.decode(packet) for packet in packets]
        assert not any(errors for _, errors in found)
        arrivals = [arrival for several, _ in found for arrival in several]
        assert np.array_equal([arrival.values for arrival in arrivals], sent)
        assert {arrival.counter for arrival in arrivals} == {n}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_frame_with_a_value_that_is_not_finite_is_refused(value: float) -> None:
    for at in range(SIZE):
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
        (blob(b""), "size"),
        (blob(bytes(SIZE + 1)), "size"),
        (blob(bytes(8 * SIZE)), "size"),
        (encoding.message("/s/pressure", ""), "types"),
        (encoding.message("/s/pressure", "s", ("x",)), "types"),
        (encoding.message("/s/pressure", "bi", (bytes(SIZE), 1)), "types"),
        (encoding.message("/s/pressure", "bb", (bytes(SIZE), bytes(SIZE))), "types"),
        (encoding.message("/s/pressure", "d" * SIZE, [0.0] * SIZE), "types"),
        (encoding.message("/s/pressure", "f" * (SIZE - 1) + "i", [0.0] * (SIZE - 1) + [1]), "types"),
        (encoding.message("/s/trajectory", "if", (1, 1.0)), "types"),
        (encoding.message("/s/trajectory", "iif", (1, 1, 1.0)), "types"),
        (trajectory(*[(i, 0.0, 0.0) for i in range(4)]), "too_many_touches"),
        (trajectory((1, math.nan, 0.0)), "not_finite"),
        (trajectory((1, 0.0, math.inf)), "not_finite"),
        (pressure([0.0] * SIZE, sensor="a/b"), "address"),
        (pressure([0.0] * SIZE, sensor="*"), "address"),
        (pressure([0.0] * SIZE, sensor="{a,b,c}*"), "types"),
        (encoding.message("/tuio/2Dcur", "s", ("alive",)), "address"),
    ],
)
def test_what_is_wrong_is_refused_by_reason(packet: bytes, reason: str) -> None:
    assert fault(packet) == reason


def test_numbers_of_other_types_are_told_which_are_taken() -> None:
    _, [error] = decoder().decode(encoding.message("/s/pressure", "d" * SIZE, [0.0] * SIZE))
    assert str(error).startswith("/s/pressure: expected the type tags f, i or one b, found 'dddd")


def test_good_messages_survive_bad_siblings() -> None:
    good = [pressure([float(n)] * SIZE, n) for n in range(3)]
    bad = [pressure([math.nan] * SIZE, 7), blob(b"x"), b"/x\0\0", trajectory((1, math.nan, 0.0))]
    packet = encoding.bundle([good[0], bad[0], encoding.bundle([bad[1], good[1], *bad[2:]]), good[2]])
    arrivals, errors = decoder().decode(packet)
    assert [a.counter for a in arrivals] == [0, 1, 2]
    assert sorted(e.reason for e in errors) == ["not_finite", "not_finite", "size", "types"]


def test_invented_addresses_cost_no_memory() -> None:
    decode = decoder()
    for n in range(2000):
        decode.decode(trajectory((1, 1.0, 1.0), sensor=f"s{n}"), source=n)
        decode.decode(encoding.message(f"/x{n}", ""))
    assert decode._route.cache_info().currsize <= wire._MAX_ROUTES and len(decode._pending) <= wire._MAX_PENDING


# --- touches

A, B = Touch(1, 0.0, 2.0), Touch(2, 3.0, 1.0)
FRAME = pressure([1.0] * SIZE)
FINGER, OTHER = trajectory((1, 0.0, 2.0)), trajectory((2, 3.0, 1.0))


@pytest.mark.parametrize(
    ("packets", "expected"),
    [
        ([encoding.bundle([FRAME, FINGER])], [(A,)]),
        ([encoding.bundle([FINGER, FRAME])], [(A,)]),
        ([encoding.bundle([FRAME, FINGER, FRAME, OTHER])], [(A,), (B,)]),
        ([encoding.bundle([FINGER, FRAME, OTHER, FRAME])], [(A,), (B,)]),
        ([encoding.bundle([FRAME, FRAME, FINGER])], [(), (A,)]),
        (
            [encoding.bundle([encoding.bundle([FRAME, FINGER]), encoding.bundle([OTHER, FRAME])])],
            [(A,), (B,)],
        ),
        ([FINGER, FRAME, FRAME], [(A,), ()]),
        ([FINGER, OTHER, FRAME], [(B,)]),
        ([FINGER, encoding.bundle([FRAME, OTHER]), FRAME], [(B,), ()]),
        ([trajectory((1, 0.0, 2.0), (2, 3.0, 1.0)), FRAME], [(A, B)]),
        ([FINGER, trajectory(), FRAME], [()]),
        ([FINGER, pressure([1.0] * SIZE, sensor="other"), FRAME], [(), (A,)]),
        ([encoding.bundle([FINGER, pressure([1.0] * SIZE, sensor="other"), FRAME])], [(), (A,)]),
    ],
)  # fmt: skip
def test_touches_find_their_frame(packets: list[bytes], expected: list[tuple[Touch, ...]]) -> None:
    decode = decoder()
    assert [a.touches for packet in packets for a in decode.decode(packet)[0]] == expected


def test_a_strangers_touches_do_not_get_into_a_stream() -> None:
    decode = decoder()
    decode.decode(FINGER, source="stranger")
    assert decode.decode(FRAME, source="owner")[0][0].touches == ()


def test_packets_that_are_read_together_say_what_each_says_alone() -> None:
    """Sensors of all forms, grids and lengths of name, in any order; with counters, touches, junk and NaN."""
    rng = np.random.default_rng(25)
    grids = dict.fromkeys(("s", "a", "b", "cc", "a-long-name"), (3, 4)) | {"square": (9, 9), "small": (2, 2)}
    alone, both = (Decoder(Addresses(), grids.__getitem__, keep_touches=False) for _ in range(2))
    shared = 0
    for _ in range(100):
        usual = int(rng.integers(6))  # most packets of a read have one form
        forms = [usual if rng.random() < 0.8 else int(rng.integers(6)) for _ in range(rng.integers(1, 40))]
        packets = [_any_packet(rng, name, grids[name], form) for form in forms for name in rng.choice(list(grids), 1)]
        blocks = both.together(packets)
        together = {n: block.arrival(place) for block in blocks for place, n in enumerate(block.packets)}
        shared += len(together)
        for n, packet in enumerate(packets):
            arrivals, errors = alone.decode(packet)
            read = both.decode(packet)
            for one, other in zip(arrivals, [together[n]] if n in together else read[0], strict=True):
                assert one[0] == other[0] and one[2:] == other[2:] and one.values.dtype == other.values.dtype
                assert one.values.shape == other.values.shape and one.values.tobytes() == other.values.tobytes()
            assert [e.reason for e in errors] == [e.reason for e in read[1]] and not (errors and n in together)
    assert shared > 300


def _any_packet(rng: np.random.Generator, sensor: str, grid: tuple[int, int], form: int) -> bytes:
    values = rng.normal(0, 100, grid[0] * grid[1])
    if rng.random() < 0.05:
        values[rng.integers(values.size)] = math.nan
    counter = int(rng.integers(1000)) if rng.random() < 0.8 else None
    if form == 0:
        return pressure(np.rint(np.nan_to_num(values)), counter, sensor, "i")
    if form == 1:
        kind = ">f4" if rng.random() < 0.2 else ">u2"
        values = values if kind == ">f4" else np.clip(np.nan_to_num(values), 0, 9e3)
        return blob(values.astype(kind).tobytes(), counter, sensor)
    if form == 2:
        return rng.bytes(40) if rng.random() < 0.2 else trajectory((1, 2.0, 3.0), sensor=sensor)
    packet = pressure(values, counter, sensor)
    finger = (1, 2.0, math.nan if rng.random() < 0.2 else 3.0)
    touches = [trajectory(*[finger] * int(rng.random() < 0.2), sensor=sensor)]
    return packet if form == 3 else encoding.bundle([packet, *touches], float(rng.integers(1, 2**31)))


def test_time_tags_are_not_mixed_up_where_packets_have_one_length() -> None:
    """A bundle's head takes 20 bytes, as much as a name may be longer in a packet that is in no bundle."""
    decode, values = decoder(keep_touches=False), np.ones(GRID[0] * GRID[1])
    packets = [pressure(values, n, "a" * 20) for n in range(4)]
    packets += [encoding.bundle([pressure(values, n, "s")], 1.7e9 + n) for n in range(4)]
    assert len(set(map(len, packets))) == 1
    for each in (packets, packets[::-1]):
        expected = [arrival.timetag for packet in each for arrival in decode.decode(packet)[0]]
        read = {n: block.arrival(k) for block in decode.together(each) for k, n in enumerate(block.packets)}
        assert [read[n].timetag for n in range(8)] == expected
