"""gesturectl listen, against a scripted daemon."""

import json
import signal
from collections.abc import Callable
from typing import Any

import pytest

from gestured.client.lines import Unreachable
from gestured.client.subscriber import Subscriber
from tests.sockets import GESTURE, HELLO, FakeDaemon

STATUS = {"type": "status", "model": "m", "time": 1.0}
WHERE = {
    "start": {"x": 0.21, "y": 0.5}, "end": {"x": 0.84, "y": 0.52}, "way": 0.64,
    "pressure": 212.0, "snr": 31.5, "contacts": 1, "bridged": 0, "zone": "volume",
}  # fmt: skip
UNKNOWN = {key: value for key, value in GESTURE.items() if key not in ("gesture", "sequence")} | {"type": "unknown"}


Heard = tuple[int, list[str], str]  # exit status, lines of standard output, standard error


@pytest.fixture
def listen(told, fake: FakeDaemon) -> Callable[..., Heard]:
    """What `gesturectl listen` makes of what a daemon says before it hangs up."""

    def heard(said: list[Any], *flags: object) -> Heard:
        status, out, err = told([HELLO, *said], "listen", "--socket", fake.path, *flags)
        return status, out.splitlines(), err

    return heard


def test_every_type_has_its_line(listen) -> None:
    told = [
        (GESTURE, "armrest      swipe_left               0.98  #4      125 ms"),
        (GESTURE | {"degraded": True, "model": "lstm"}, "by lstm, degraded"),
        (GESTURE | {"test": True}, "  (test)"),
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
    count = len(told) - 1  # what was lost is no event
    status, lines, _ = listen([event for event, _ in told], "--count", count)
    assert status == 0
    for line, (_, words) in zip(lines, told, strict=True):
        assert words in line


def test_another_list_of_gestures_is_no_event(listen) -> None:
    status, (line,), err = listen([{"type": "gestures", "gestures": ["one_tap", "knock"]}, GESTURE], "--count", 1)
    assert status == 0 and "swipe_left" in line
    assert "gestures: one_tap, knock" in err


EARLY = {
    "type": "provisional", "sensor": "armrest", "id": 4, "gesture": "swipe_left", "confidence": 0.97,
    "onset": 1000.0, "decided": 1000.375,
}  # fmt: skip
HELD = {"type": "cancelled", "sensor": "armrest", "id": 4, "reason": "held"}


@pytest.mark.parametrize(
    ("decided", "answer", "words"),
    [
        (1000.375, GESTURE | {"provisional": "confirmed"}, "confirmed: swipe_left, 125 ms before the finger left"),
        (1000.5625, UNKNOWN | {"provisional": "revoked"}, "swipe_left, 62 ms after the finger"),
        (1000.375, HELD | {"provisional": "revoked"}, "cancelled: held  revoked: swipe_left"),
    ],
)
def test_what_was_said_before_is_told_with_the_answer(listen, decided: float, answer, words: str) -> None:
    early = EARLY | {"decided": decided}
    _, lines, _ = listen([early | {"sensor": "seat", "gesture": "one_tap"}, early, answer])
    assert all(word in lines[1] for word in ("armrest", "swipe_left?", "0.97", "provisional"))
    assert words in lines[2] and "one_tap" not in lines[2]


def test_json_repeats_the_daemons_lines_to_the_letter(listen) -> None:
    line = b'{"type":"onset",  "sensor":"armrest", "id":4, "onset":1.50, "new_key":[1.50]}\n'
    _, (hello, event), _ = listen([line], "--json", "--count", 1)
    assert json.loads(hello)["type"] == "hello"
    assert event.encode() + b"\n" == line


def test_reconnect_waits_for_the_next_daemon_and_asks_it_for_the_same(start, fake: FakeDaemon) -> None:
    filters = ("--types", "gesture,unknown", "--sensor", "armrest", "--sensor", "b", "--gesture", "one_tap")
    asked = {"types": ["gesture", "unknown"], "sensors": ["armrest", "b"], "gestures": ["one_tap"]}
    process = start("listen", "--socket", fake.path, "--reconnect", "--count", 2, *filters)
    for _ in range(2):
        fake.accept()
        assert fake.request() == {"subscribe": asked}
        fake.say(GESTURE)
        assert b"swipe_left" in process.stdout.readline()
        fake.close()
    assert process.wait(30) == 0


def test_a_line_that_no_daemon_says_is_one_sentence_and_the_next_is_printed(listen) -> None:
    wrong = [GESTURE | {"decided": "soon"}, {"type": ["gesture"]}, {"type": "lost"}]
    status, (line,), err = listen([*wrong, GESTURE], "--count", 1)
    assert status == 0 and "swipe_left" in line
    _, *said = err.splitlines()  # the first says whom it listens to
    expected = ('decided "soon": expected a number', 'type ["gesture"]: expected a text', "count is missing")
    assert [words in line for words, line in zip(expected, said, strict=True)] == [True] * 3


def test_ctrl_c_and_a_reader_that_leaves_end_it_without_a_word(start, fake: FakeDaemon) -> None:
    for leaves in (False, True):
        process = start("listen", "--socket", fake.path)
        fake.accept()
        fake.say(GESTURE)
        process.stdout.readline()
        if leaves:
            process.stdout.close()
            fake.say(GESTURE)
        else:
            process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
        assert b"Traceback" not in process.stderr.read()


def test_the_wrong_one_of_two_sockets_is_said(told, fake: FakeDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    status, _, err = told([HELLO], "emit", "swipe_left", "--control", fake.path)  # it greets: so do event sockets
    assert status == 1 and f"{fake.path} is not the daemon's --control socket" in err
    monkeypatch.setattr("gestured.client.subscriber.GREETING_S", 0.2)
    with pytest.raises(Unreachable, match="not its event socket"):
        next(Subscriber(fake.path, reconnect=False))  # it says nothing: so do control sockets
