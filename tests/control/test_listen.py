"""gesturectl listen, against a scripted daemon."""

import json
import signal
from pathlib import Path

import pytest

from gestured.client.lines import Unreachable
from gestured.client.stream import Stream
from tests.sockets import GESTURE

STATUS = {"type": "status", "model": "m", "time": 1.0}
WHERE = {
    "start": {"x": 0.21, "y": 0.5}, "end": {"x": 0.84, "y": 0.52}, "way": 0.64,
    "pressure": 212.0, "snr": 31.5, "contacts": 1, "bridged": 0, "zone": "volume",
}  # fmt: skip
UNKNOWN = {key: value for key, value in GESTURE.items() if key not in ("gesture", "sequence")} | {"type": "unknown"}


def test_every_type_has_its_line(start, fake):
    told = [
        (GESTURE, "armrest      swipe_left               0.98  #4      125 ms"),
        (GESTURE | {"degraded": True, "model": "lstm"}, "by lstm, degraded"),
        (UNKNOWN | {"reason": "hole"}, "unknown (hole)"),
        (UNKNOWN, "unknown  "),
        (GESTURE | {"where": WHERE}, "  from 0.21,0.50 (volume) to 0.84,0.52"),
        (UNKNOWN | {"where": WHERE | {"way": 0.0, "zone": None}}, "  at 0.21,0.50"),
        ({"type": "onset", "sensor": "armrest", "id": 4, "onset": 1000.0}, "onset"),
        ({"type": "cancelled", "sensor": "armrest", "id": 4, "reason": "held"}, "cancelled: held"),
        ({"type": "release", "sensor": "armrest", "id": 4, "offset": 1000.0}, "release"),
        (STATUS | {"state": "ok", "sensors": {"armrest": "ok"}}, "status: ok (armrest ok)"),
        (STATUS | {"state": "no_data", "sensors": {}}, "no sensor"),
        ({"type": "lost", "count": 7}, "7 events lost"),
        ({"type": "something_new", "sensor": "armrest"}, "something_new"),
    ]
    process = start("listen", "--socket", fake.path, "--count", len(told) - 1)  # what was lost is no event
    fake.accept()
    fake.say(*(event for event, _ in told))
    lines = process.communicate(timeout=30)[0].decode().splitlines()
    for line, (_, words) in zip(lines, told, strict=True):
        assert words in line


EARLY = {
    "type": "provisional",
    "sensor": "armrest",
    "id": 4,
    "gesture": "swipe_left",
    "confidence": 0.97,
    "onset": 1000.0,
    "decided": 1000.375,
}


@pytest.mark.parametrize(
    ("early", "answer", "words"),
    [
        (EARLY, GESTURE | {"provisional": "confirmed"}, "confirmed: swipe_left, 125 ms before the finger left"),
        (
            EARLY | {"decided": 1000.5625},
            UNKNOWN | {"provisional": "revoked"},
            "swipe_left, 62 ms after the finger",
        ),
        (
            EARLY,
            {"type": "cancelled", "sensor": "armrest", "id": 4, "reason": "held", "provisional": "revoked"},
            "cancelled: held  revoked: swipe_left",
        ),
    ],
)
def test_what_was_said_before_is_told_with_the_answer(start, fake, early, answer, words):
    process = start("listen", "--socket", fake.path, "--types", "gesture,provisional")
    fake.accept()
    fake.say(early | {"sensor": "seat", "gesture": "one_tap"})
    fake.say(early)
    fake.say(answer)
    lines = [process.stdout.readline().decode() for _ in range(3)]
    assert all(word in lines[1] for word in ("armrest", "swipe_left?", "0.97", "provisional"))
    assert words in lines[2] and "one_tap" not in lines[2]


def test_json_repeats_the_daemons_lines_to_the_letter(start, fake):
    line = b'{"type":"onset",  "sensor":"armrest", "id":4, "onset":1.50, "new_key":[1.50]}\n'
    process = start("listen", "--socket", fake.path, "--json", "--count", 1)
    fake.accept()
    fake.say(line)
    out, _ = process.communicate(timeout=30)
    hello, event = out.splitlines(keepends=True)
    assert json.loads(hello)["type"] == "hello"
    assert event == line


def test_filters_become_one_subscription(start, fake):
    filters = ("--types", "gesture,unknown", "--sensor", "a", "--sensor", "b", "--gesture", "one_tap")
    start("listen", "--socket", fake.path, *filters)
    fake.accept()
    asked = {"types": ["gesture", "unknown"], "sensors": ["a", "b"], "gestures": ["one_tap"]}
    assert fake.request() == {"subscribe": asked}


def test_a_daemon_that_ends_is_said(start, fake):
    process = start("listen", "--socket", fake.path)
    fake.accept()
    fake.close()
    _, err = process.communicate(timeout=30)
    assert process.returncode == 1
    assert "closed the connection" in err.decode()


def test_reconnect_waits_for_the_next_daemon(start, fake):
    process = start("listen", "--socket", fake.path, "--reconnect", "--count", 2)
    for _ in range(2):
        fake.accept()
        fake.say(GESTURE)
        assert b"swipe_left" in process.stdout.readline()
        fake.close()
    assert process.wait(30) == 0


def test_a_line_that_no_daemon_says_is_one_sentence_and_the_next_is_printed(start, fake):
    process = start("listen", "--socket", fake.path, "--count", 1)
    fake.accept()
    fake.say(GESTURE | {"decided": "soon"}, {"type": ["gesture"]}, {"type": "lost"}, GESTURE)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert out.decode().count("swipe_left") == out.count(b"\n") == 1
    _, *said = err.decode().splitlines()  # the first says whom it listens to
    wrong = ('decided "soon": expected a number', 'type ["gesture"]: expected a text', "count is missing")
    assert [words in line for words, line in zip(wrong, said, strict=True)] == [True] * 3


def test_ctrl_c_ends_without_a_word(start, fake):
    process = start("listen", "--socket", fake.path)
    fake.accept()
    fake.say(GESTURE)
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert "Traceback" not in err.decode()


def test_a_reader_that_leaves_ends_it_without_a_word(start, fake):
    process = start("listen", "--socket", fake.path)
    fake.accept()
    fake.say(GESTURE)
    process.stdout.readline()
    process.stdout.close()
    fake.say(GESTURE)
    assert process.wait(30) == 0
    assert "Traceback" not in process.stderr.read().decode()
    process.stderr.close()


@pytest.mark.parametrize("wrong", [("--types", "gestures"), ("--types", ""), ("--count", "one")])
def test_wrong_usage(run, wrong, tmp_path: Path):
    status, _, err = run("listen", *wrong)
    assert status == 2
    assert wrong[0] in err


def test_a_gesture_that_the_daemon_does_not_know_is_said(start, fake):
    process = start("listen", "--socket", fake.path, "--gesture", "swipeleft", "--count", 1)
    fake.accept()
    assert b"no gesture of this daemon: swipeleft (one_tap)" in process.stderr.readline() + process.stderr.readline()


def test_the_wrong_one_of_two_sockets_is_said(daemon, run, monkeypatch):
    status, _, err = run("emit", "swipe_left", "--control", daemon.socket)
    assert status == 1 and f"{daemon.socket} is not the control socket" in err
    monkeypatch.setattr("gestured.client.stream.GREETING_S", 0.2)
    with pytest.raises(Unreachable, match="not its event socket"):
        Stream(Path(daemon.ready["control"]))
