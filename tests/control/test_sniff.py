"""What `gesturectl sniff` makes of packets: forms that are not taken, counters, grids, counts that fall."""

import re
import tomllib
from typing import Any

import numpy as np
import pytest

from gestured.control.proposal import propose
from gestured.control.sight import Sight
from gestured.control.sniff import lines
from gestured.core.scene import Scene, Setup
from gestured.core.wire import Addresses, Decoder
from gestured.daemon.merge import load_settings
from tests import encoding
from tests.daemon.harness import Hand, blob, counted, floats, ints
from tests.sockets import free_address
from tests.swipes import swipes


def seen(packets, rate: float = 15.0) -> Sight:
    sight = Sight()
    for n, packet in enumerate(packets):
        sight.packet(n / rate, "127.0.0.1:5", packet)
    return sight


def counted_ints(address: str, frame, n: int) -> bytes:
    return encoding.message(address, "i" * (frame.size + 1), (np.concatenate([[1000 + n], frame.ravel()]),))


def valid(proposed: list[str], tmp_path) -> dict[str, Any]:
    """The proposal as the daemon reads it."""
    path = tmp_path / "gestured.toml"
    path.write_text("\n".join(proposed) + "\n")
    tomllib.loads(path.read_text())
    settings, _ = load_settings({"config": str(path)}, {})
    return {name: (sensor.grid, sensor.invert) for name, sensor in settings.sensors.items()}


def test_a_counter_before_ints_is_told_from_a_taxel(tmp_path) -> None:
    fits = seen(counted_ints("/arm/pressure", Hand().frame(), n) for n in range(8))
    assert propose(fits.rows()) == ["the defaults fit what arrives"]
    larger = seen(counted_ints("/arm/pressure", frame, n) for n, frame in enumerate(swipes(16, 12)))
    assert valid(propose(larger.rows()), tmp_path) == {"arm": ((16, 12), False)}
    without = seen(
        encoding.message("/arm/pressure", "i" * 192, (frame.ravel(),)) for n, frame in enumerate(swipes(12, 16))
    )
    assert valid(propose(without.rows()), tmp_path) == {"arm": ((12, 16), False)}


def test_a_grid_is_proposed_whether_or_not_somebody_touched_it(tmp_path) -> None:
    idle = seen(floats("/arm/pressure", np.zeros((6, 4)) + n % 2, n) for n in range(8))
    touched = seen(floats("/arm/pressure", frame, n) for n, frame in enumerate(swipes(4, 6)))
    assert valid(propose(idle.rows()), tmp_path)["arm"][0] in ((6, 4), (4, 6))
    assert "a guess" in propose(idle.rows())[1]
    assert propose(touched.rows())[1] == 'grid = "4x6"'
    prime = seen(encoding.message("/arm/pressure", "f" * 83, (np.zeros(83),)) for _ in range(8))
    (words,) = propose(prime.rows())
    assert words.startswith("# ") and "83" in words and "no grid" in words


def test_both_mistakes_are_mended_at_once(tmp_path) -> None:
    """Rows and columns are exchanged, and counts fall."""
    frames = (frame.reshape(12, 6) for frame in swipes(6, 12, -1.0))
    sight = seen(floats("/arm/pressure", frame, n) for n, frame in enumerate(frames))
    assert valid(propose(sight.rows(), Scene(("any",), (12, 6))), tmp_path) == {"arm": ((6, 12), True)}


def test_nothing_is_proposed_where_the_daemon_is_set_to_what_arrives() -> None:
    sight = seen(floats("/x/arm/y", frame, n) for n, frame in enumerate(swipes(27, 15)))
    assert propose(sight.rows())
    told = Scene(("any",), (9, 9), {"arm": Setup((27, 15))}, Addresses("/x/{sensor}/y"))
    assert propose(sight.rows(), told) == ["the settings of the daemon fit what arrives"]


@pytest.mark.parametrize(("network", "said"), [("127.0.0.0/8", "the settings of the daemon fit what arrives"),
    ("10.0.0.0/8", "# 127.0.0.1 is not under allow: the daemon drops what it sends")])  # fmt: skip
def test_a_sender_that_is_not_under_allow_is_named(network: str, said: str) -> None:
    rows = seen(floats("/arm/pressure", Hand().frame(), n) for n in range(8)).rows()
    assert propose(rows, Scene.from_dict({"allow": [network]}, ("any",), (9, 9))) == [said]


def test_rows_and_columns_the_other_way_round(tmp_path) -> None:
    sight = seen(floats("/arm/pressure", frame, n) for n, frame in enumerate(swipes(12, 6)))
    proposed = propose(sight.rows(), Scene(("any",), (9, 9), {"arm": Setup((6, 12))}))
    assert valid(proposed, tmp_path) == {"arm": ((12, 6), False)} and "rows and columns" in "\n".join(proposed)


@pytest.mark.parametrize(("types", "words"), [("d", "doubles"), ("[f", "arrays"), ("h", "64-bit integers")])
def test_what_is_not_taken_is_named(types: str, words: str) -> None:
    frame = [float(v) if types != "h" else int(v) for v in Hand().frame().ravel()]
    if types == "[f":
        packet = encoding._string("/arm/pressure") + encoding._string(",[" + "f" * 81 + "]") + bytes(4 * 81)
    else:
        packet = encoding.message("/arm/pressure", types * 81, frame)
    sight = seen([packet] * 4)
    text = "\n".join(lines(sight, propose(sight.rows())))
    assert f"{words} are not taken: send f" in text and "nothing that looks like a pressure frame" in text


@pytest.mark.parametrize(
    ("address", "encode", "proposed"),
    [
        ("/arm/pressure", floats, ["the defaults fit what arrives"]),
        ("/arm/pressure", counted, ["the defaults fit what arrives"]),
        ("/arm/pressure", blob(">u2"), ["the defaults fit what arrives"]),
        ("/textile/arm/matrix", ints, ["[addresses]", 'pressure = "/textile/{sensor}/matrix"']),
        ("/arm", floats, ["[addresses]", 'pressure = "/{sensor}"']),
    ],
)
def test_what_sniff_proposes_is_taken_by_the_daemon(address: str, encode, proposed: list[str]) -> None:
    packets = [encode(address, Hand().frame(), n) for n in range(5)]
    found = propose(seen(packets).rows())
    assert found == proposed
    pattern = re.findall(r'pressure = "(.*)"', "\n".join(found)) or ["/{sensor}/pressure"]
    decoder = Decoder(Addresses(pattern[0]), lambda sensor: (9, 9))
    assert [len(decoder.decode(packet)[0]) for packet in packets] == [1] * 5


def test_what_was_seen_is_bounded() -> None:
    sight = seen(encoding.message(f"/s{n}/pressure", "f" * 25, [0.0] * 25) for n in range(1000))
    assert len(sight.seen) <= 257 and sum(one.count for one in sight.seen.values()) == 1000


def test_another_pattern_is_mentioned() -> None:
    arm = encoding.message("/arm/pressure", "f" * 25, [0.0] * 25)
    grid = ["[sensors.arm]", 'grid = "5x5"']
    assert propose(seen([arm]).rows()) == grid
    other = encoding.message("/foo/7/matrix", "f" * 49, [0.0] * 49)
    said = "# /foo/{sensor}/matrix looks like frames, too; a daemon takes one pattern"
    assert propose(seen([arm, other, arm]).rows()) == [*grid, said]


def test_sniff_says_what_may_be_wrong(run) -> None:
    status, out, _ = run("sniff", "--listen", free_address(), "--seconds", "0.1")
    assert status == 1 and "nothing arrives" in out
    new_ports = ("a:1", "a:2", "a:3", "a:4", "a:5")  # one sender, such as oscsend
    for sources, several in (("a:1", "a:2", "a:2"), True), (("a:1", "b:1"), True), (new_ports, False):
        sight = Sight()
        for n, source in enumerate(sources):
            sight.packet(n, source, floats("/arm/pressure", Hand().frame(), n))
        assert ("has several senders" in "\n".join(lines(sight, []))) == several
