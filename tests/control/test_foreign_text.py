"""Text that somebody else chose: no command hands it to the terminal as it is."""

import ast
import json
import re
import tomllib

import pytest
from hypothesis import example as such_as
from hypothesis import given
from hypothesis import strategies as st

from gestured.client.say import MOST, shown
from gestured.control.proposal import propose
from gestured.core.address import is_sensor
from gestured.core.osc import MAX_ADDRESS
from gestured.core.wire import Addresses
from tests.control.conftest import ROOT
from tests.control.test_sniff import seen
from tests.daemon.harness import Hand, floats
from tests.sockets import GESTURE, HELLO, FakeDaemon, free_address, sending

# Sets the title, clears the screen, turns the writing around, begins new lines, ends the string.
HOSTILE = '\x1b]0;owned\x07\x1b[2J\x9b31m\u202egnp.exe\u2028new\nline\r\x7f\x00"x'
LONG = HOSTILE + "y" * 100_000
DRAWN = {  # modules that say something as it is; each shows foreign words before it draws
    "gestured/client/say.py", "gestured/control/demo.py", "gestured/control/listen.py", "gestured/control/replay.py",
    "gestured/control/show.py", "gestured/control/status.py", "gestured/lab/recordings/forget.py",
    "gestured/lab/recordings/terminal.py",
}  # fmt: skip
OBEYED = re.compile(r"[^ -~\n\u2026\u2500-\u259f]")  # all but ASCII, what a cut is marked and pictures are drawn with


def plain(text: str) -> str:
    """The output of a command, which holds nothing that a terminal would obey."""
    assert not (found := OBEYED.findall(text)), (found, text)
    assert all(len(line) <= MOST for line in text.splitlines())
    return text


@given(st.text())
@such_as(HOSTILE)
@such_as("\ud800\udfff")
@such_as("\u200f\u2066\ufeff\u00ad\u3164\U000e0041")
def test_foreign_text_is_shown_printable_on_one_line_and_bounded(text: str) -> None:
    told = shown(text)
    assert told.isprintable() and len(told.splitlines()) <= 1 and len(told) <= MOST
    told.encode()
    assert shown(told) == told


@given(st.text(st.characters(whitelist_categories=("L", "N", "P", "S", "M"), whitelist_characters=" "), max_size=MOST))
def test_ordinary_text_is_shown_as_it_is(text: str) -> None:
    assert shown(text) == text


@given(st.text(), st.integers(1, 40))
def test_long_text_loses_its_middle(text: str, most: int) -> None:
    whole, told = shown(text, 10**9), shown(text, most)
    assert len(told) <= most and shown(told, most) == told
    if len(whole) > most:
        head, _, tail = told.partition("…") if "…" not in whole else ("", "", "")
        assert whole.startswith(head) and whole.endswith(tail)
    else:
        assert told == whole


def test_only_one_module_prints() -> None:
    """So no command can forget it."""
    wrong, drawn = [], set()
    files = [*(ROOT / "gestured/client").glob("*.py"), *(ROOT / "gestured/control").glob("*.py")]
    files += [*(ROOT / "gestured/lab/recordings").glob("*.py"), ROOT / "gestured/lab/cli.py"]
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call):
                continue
            called = ast.unparse(node.func)
            drawn |= {path.relative_to(ROOT).as_posix()} if called == "say_drawn" else set()
            if called == "print" or re.search(r"std(out|err)\.(buffer\.)?write", called):
                wrong.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert drawn == DRAWN
    assert len(files) > 20 and {place.split(":")[0] for place in wrong} == {"gestured/client/say.py"}


# Packets


def raw(address: str, n: int = 0) -> bytes:
    """A frame of 5 x 5 for any address at all."""
    head = address.encode() + b"\0" * (4 - len(address.encode()) % 4)
    return head + floats("/x", Hand().frame()[:5, :5], n)[4:]


NASTY = [
    '/x"\n[sensors.evil]\ngrid = "2x2"/arm/pressure',
    "/arm/pres\x1b[2Jsure",
    '/a"/arm/pressure',
    "/a\\u0022/arm/pressure",
    "/arm/pressure\u202e",
    "/{sensor}/arm/pressure",
    "/a#/arm/pressure",
    "/" + "a/" * 400 + "arm/pressure",
]


@given(
    st.lists(st.one_of(st.sampled_from(NASTY), st.text(max_size=30).map(lambda t: f"/{t}/arm/pressure")), max_size=4)
)
def test_a_proposal_holds_numbers_and_checked_names_alone(addresses: list[str]) -> None:
    whole = [a.replace("\0", "") for a in addresses if a.isascii() or "\ud800" > max(a)]
    lines = propose(seen(raw(address, n) for n in range(3) for address in whole).rows())
    text = "\n".join(line for line in lines if line != "the defaults fit what arrives")
    plain(text)
    assert all(len(line) < MAX_ADDRESS + 100 for line in lines)
    found = tomllib.loads(text)
    assert set(found) <= {"addresses", "sensors"} and set(found.get("addresses", {})) <= {"pressure"}
    if "addresses" in found:
        Addresses(found["addresses"]["pressure"])
    for name, table in found.get("sensors", {}).items():
        assert is_sensor(name) and table == {"grid": "5x5"}


def test_sniff_prints_no_foreign_byte(run) -> None:
    packets = [*map(raw, NASTY), b"/" + b"\x1b[2J" * 1000 + b"\0\0\0\0,i\0\0\0\0\0\1", b"\x9b\x1b]0;evil\x07"]
    where = free_address()
    for more in ([], ["--json"]):
        with sending(packets, where):
            status, out, err = run("sniff", "--listen", where, "--seconds", 0.2, *more)
        assert (status, err) == (1, f"listening on {where}\n")
        said = plain(out)
        if more:
            assert out.isascii() and out.count("\n") == 1 and json.loads(out)["proposed"] == []
        else:
            assert "\\x1b[2J" in said and "[sensors.evil]\n" not in said and "is not proposed" in said


# A daemon

STATUS = {
    "version": HOSTILE, "state": HOSTILE, "uptime_s": 7300.0, "pid": 1, "addresses": {HOSTILE: LONG, "listen": "a:1"},
    "ready": {"ready": False, "reason": HOSTILE},
    "model": {"active": HOSTILE, "asked": HOSTILE, "degraded": True, "failures": 2, "version": HOSTILE,
              "sha256": HOSTILE, "file": HOSTILE.replace("\x00", "") + ".onnx"},
    "sensors": {HOSTILE: {"state": "ok", "rate_hz": 0.0, "jitter_s": 0.0, "bad_taxels": 0, "drift": 0.0,
                          "grid": HOSTILE, "source": HOSTILE, "lost": 1}},
    "answers": {"gestures": {}, "unknown": 3, "cancelled": {HOSTILE: 2}},
    "recent": [{"time": 1.0, "sensor": HOSTILE, "answer": HOSTILE, "confidence": 0.5, "test": False}],
    "input": {"dropped": {HOSTILE: 4}, "kernel_drops": 0},
    "output": {"subscribers": 0, "backlog_bytes": 0, "lines_lost": 0, "evicted": {}, "osc": {HOSTILE: 1}},
    "loop_lag_s": 0.0, "internal_errors": 0, "reloads": {},
    "shift": {"gestures": 40, "outside": {HOSTILE: 0.5}, "unlike": [HOSTILE]},
}  # fmt: skip
ANSWERS = [("status", STATUS), ("doctor", STATUS), ("reload", {"ok": False, "reason": LONG})]


@pytest.mark.parametrize(("command", "answer"), ANSWERS)
def test_what_a_daemon_says_is_shown(told, fake: FakeDaemon, command: str, answer) -> None:
    _, out, err = told([{"ok": True} | answer], command, "--control", fake.path)
    assert "owned" in plain(out + err)


EVENTS = [
    GESTURE | {"sensor": HOSTILE, "gesture": HOSTILE, "model": HOSTILE, "degraded": True},
    {"type": "status", "state": HOSTILE, "sensors": {HOSTILE: HOSTILE}, "model": "m", "time": 1.0},
    {"type": "cancelled", "sensor": HOSTILE, "id": 4, "reason": HOSTILE},
    {"type": "lost", "count": 7},
    {"type": HOSTILE, "sensor": HOSTILE},
]
# Valid JSON that is not ASCII: the C1 control that begins a sequence, and a bare carriage return between two keys.
BARE = '{"type":"onset",\r"id":4,"onset":1.0,"sensor":"\x9b2J\u202e\x7f"}\n'.encode()


@pytest.mark.parametrize("more", [[], ["--json"]])
def test_what_it_publishes_is_shown(told, fake: FakeDaemon, more) -> None:
    hello = HELLO | {"version": HOSTILE, "model": HOSTILE, "gestures": [HOSTILE], "sensors": {HOSTILE: 1}}
    wrong = {"type": "lost", "count": HOSTILE}  # no daemon says that: it is told on standard error
    said = [hello, *EVENTS, BARE, wrong, {"type": "error", "reason": HOSTILE}]
    status, out, err = told(said, "listen", "--socket", fake.path, "--gesture", "wave", *more)
    assert status == 2 and "owned" in plain(err)
    lines = plain(out).splitlines()
    if more:
        assert out.isascii()
        assert [json.loads(line) for line in lines[:-1]] == [hello, *EVENTS]
        assert json.loads(lines[-1])["sensor"] == "\x9b2J\u202e\x7f"
    else:
        assert len(lines) == len(EVENTS) + 1
