"""The subscriber in C: events into structs, across a daemon's restarts and whatever comes on the socket."""

import ctypes
import json
import math
import random
import shutil
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.deploy.compilers import CPP, HEADERS, HERE, POSIX, C, compiled
from tests.several import several
from tests.sockets import GESTURE, HELLO, FakeDaemon

SOURCE = HERE / "events.c"
SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g")
DAMAGE = (b"", b'"', b"\\", b"{", b"}", b"[", b"]", b",", b":", b"\\u", b"\\ud83d\\u", b"1e999", b"\0", b"\xff")
LONGEST = 65536  # bytes of a line
ALL = json.dumps({"types": ["gesture", "unknown", "status"]})


@pytest.mark.parametrize("name", ["gcc", "g++", "clang", "clang++"])
def test_events_compile_without_a_warning(name: str, tmp_path: Path):
    standard, language = (CPP, "c++") if name.endswith("++") else (C, "c")
    compiled(name, standard, tmp_path / "events", POSIX, "-x", language, SOURCE)


@pytest.mark.parametrize("standard", ["c99", "c11", "c17"])
def test_a_strict_standard_is_told_what_it_has_to_define(standard: str):
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    command = ["gcc", f"-std={standard}", "-fsyntax-only", f"-I{HEADERS}", str(SOURCE)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert 'error: #error "define _POSIX_C_SOURCE as 200809L' in done.stderr


class Program:
    """The subscriber, line by line."""

    def __init__(self, *command: object) -> None:
        self.process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, text=True, errors="replace")

    def line(self) -> list[str]:
        """What it prints of an event."""
        line = self.process.stdout.readline()
        assert line, "it has ended"
        return line.rstrip("\n").split("|")

    def refusal(self) -> str:
        """Why it ended."""
        said = self.process.stdout.read()
        assert self.process.wait() == 1, "a sanitizer has ended it"
        return said.removeprefix("refused: ").rstrip("\n")

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The subscriber as a program that ends at each read beyond a buffer."""
    return compiled("gcc", C, tmp_path_factory.mktemp("c") / "events", POSIX, *SANITIZERS, SOURCE)


@pytest.fixture
def run(program: Path) -> Iterator[Callable[..., Program]]:
    yield from several(partial(Program, program), Program.end)


def test_an_event_comes_whole_however_its_line_is_cut(run, fake: FakeDaemon):
    subscriber = run(fake.path, ALL)
    fake.accept()
    assert fake.request() == {"subscribe": json.loads(ALL)}
    event = {"scores": {"gesture": "no", "type": ["}", '"', {"id": 9}]}, "model": 'a "b", \\', "test": True} | GESTURE
    for byte in json.dumps(event).encode() + b"\n":
        fake.client.send(bytes([byte]))
    expected = ["gesture", "armrest", "swipe_left", "0.97999999999999998", "4", "4", "1000", "1000.5", "1000.625", "a"]
    assert subscriber.line() == [*expected, "1", "0"]
    fake.say({"type": "status", "state": "ok"}, GESTURE | {"id": 5})  # two at once
    assert [subscriber.line()[0:5:4] for _ in range(2)] == [["status", "0"], ["gesture", "5"]]


def test_it_connects_again_and_says_that_sequences_begin_anew(run, fake: FakeDaemon):
    subscriber = run(fake.path, "")
    for instance in ("a", "b", "c"):
        fake.accept(HELLO | {"instance": instance})
        fake.client.sendall(b'{"type":"gest')  # the rest never comes
        fake.close()
        fake.accept(HELLO | {"instance": instance + "2"})
        fake.say(GESTURE)
        assert subscriber.line()[9] == instance + "2"
        fake.close()


def test_it_waits_for_a_daemon_that_is_not_there(run, tmp_path: Path):
    subscriber = run(tmp_path / "events.sock", "", 1)
    assert subscriber.line()[0].startswith("nothing yet: ")
    fake = FakeDaemon(tmp_path / "events.sock")
    fake.accept({"type": "error", "reason": "too many clients"})  # no refusal: it may have room later
    fake.accept()
    fake.say(GESTURE)
    while (line := subscriber.line())[0] != "gesture":
        assert line[0].startswith("nothing yet: ")
    fake.listener.close()


@pytest.mark.parametrize(
    "first",
    [HELLO | {"protocol": 2}, GESTURE, b"SSH-2.0-OpenSSH_9.2\n", {"type": "hello"}, HELLO | {"protocol": 1e300}],
)
def test_who_is_no_daemon_of_protocol_1_is_refused(run, fake: FakeDaemon, first: object):
    subscriber = run(fake.path, "")
    fake.accept(first)
    assert subscriber.refusal() == f"{fake.path}: it does not speak protocol 1 of gestured"


def test_a_refused_subscription_is_told(run, fake: FakeDaemon):
    subscriber = run(fake.path, '{"gestures":["swipe_lft"]}')
    fake.accept()
    fake.say({"type": "error", "reason": 'there is no gesture "swipe_lft" \u00e4 \U0001f600'})
    assert subscriber.refusal() == f'{fake.path}: there is no gesture "swipe_lft" \u00e4 \U0001f600'


def test_a_path_that_no_socket_can_have_is_refused(run):
    assert "too long" in run("/" + "x" * 108, "").refusal()


def test_a_line_that_is_too_long_costs_itself_alone(run, fake: FakeDaemon):
    subscriber = run(fake.path, "")
    fake.accept(HELLO | {"sensors": {f"sensor{n}": n for n in range(10_000)}})  # a hello is understood all the same
    for size in (LONGEST - 1, LONGEST, LONGEST + 1, 3 * LONGEST):
        fake.say(GESTURE | {"model": "x" * (size - len(json.dumps(GESTURE)) + len("cnn_lstm"))}, GESTURE | {"id": 5})
    seen = [subscriber.line() for _ in range(5)]
    assert [line[4] for line in seen] == ["4", "5", "5", "5", "5"] and seen[-1][-1] == "3"


def test_lines_of_any_bytes_cost_themselves_alone(run, fake: FakeDaemon):
    """Whole, cut and changed lines; the sanitizers end the program at a read beyond the buffer."""
    subscriber = run(fake.path, "")
    fake.accept()
    fake.say(GESTURE | {"id": 1e300, "sequence": -1e300})
    assert subscriber.line()[4:6] == ["0", "0"]
    chance = random.Random(7)
    sound = json.dumps(GESTURE | {"reason": 'ä\\"\n', "deep": [{"a": [1, {}]}]}).encode()
    for batch in range(100, 200):
        for _ in range(20):
            line = sound[: chance.randrange(len(sound))] if chance.random() < 0.5 else sound
            for _ in range(chance.randrange(8)):
                at, size = chance.randrange(len(line) + 1), chance.randrange(3)
                line = line[:at] + chance.choice(DAMAGE) + line[at + size :]
            fake.say(line + b"\n")
        fake.say(GESTURE | {"id": batch})
        while subscriber.line()[4:5] != [str(batch)]:
            pass


@pytest.fixture(scope="module")
def parser(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The parser of a line."""
    out = tmp_path_factory.mktemp("c") / "events.so"
    return ctypes.CDLL(str(compiled("gcc", C, out, POSIX, "-shared", "-fPIC", SOURCE)))


words = st.text(st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=20)
leaves = st.none() | st.floats(allow_nan=False) | words
values = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3), max_leaves=8
)
spaces = st.sampled_from([(",", ":"), (", ", ": "), (" ,  ", "\t:\r")])
styles = st.fixed_dictionaries({"ensure_ascii": st.booleans(), "separators": spaces})
numbers = st.floats(-1e18, 1e18) | st.integers(-(2**53), 2**53)


@settings(max_examples=40)
@given(st.dictionaries(words, values, max_size=4), words, numbers, styles)
def test_a_text_and_a_number_are_what_json_says(
    parser, around: dict[str, Any], text: str, number: float, style: dict[str, Any]
):
    def line(**keys: object) -> bytes:
        return json.dumps(around | keys, **style).encode()

    around.pop("key", None)
    out, value = ctypes.create_string_buffer(200), ctypes.c_double()
    assert parser.text(line(key=text), out, ctypes.c_size_t(200)) == 1
    assert out.value.decode() == text
    assert parser.text(line(), out, ctypes.c_size_t(200)) == 0
    assert parser.number(line(key=number), ctypes.byref(value)) == 1
    assert math.isclose(value.value, number, rel_tol=2e-16 if 1 < abs(number) < 1e15 else 1e-13, abs_tol=1e-300)
    assert parser.number(line(key=str(number)), ctypes.byref(value)) == 0
