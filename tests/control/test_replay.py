"""`gesturectl replay`: sent to a daemon, or here and held against what was recorded or labelled."""

import json
import signal
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from gestured.model.ladder import Ladder
from gestured.model.shipped import shipped
from gestured.record import arrays as recording
from gestured.record import tape_reader
from gestured.record.recordings import Recordings
from tests.daemon import tiny_model
from tests.daemon.harness import RATE_HZ, Frame, Hand, Sensor
from tests.hostile.grammar import violations
from tests.sockets import free_address

LEAD_S = 1.6  # untouched; 24 frames


@pytest.fixture
def replay(run):
    """`gesturectl replay`: exit status, standard output, standard error."""
    return partial(run, "replay")


def said(out: str) -> list[str]:
    """Sign and answer of each line of differences."""
    return [line[0] + line.rpartition(": ")[2].split()[0] for line in out.splitlines()]


def labelled(path: Path, *performed: tuple[str, list[Frame]], lead_s: float = LEAD_S) -> Path:
    """A file of cut gestures: label, and what a hand did between idle frames."""
    hand, frames, times, offsets = Hand(), [], [], [0]
    for _, touched in performed:
        part = [*hand.idle(lead_s), *touched, *hand.idle(1.0)]
        frames += part
        times.append(100.0 + np.arange(len(part)) / RATE_HZ)
        offsets.append(offsets[-1] + len(part))
    first = round(lead_s * RATE_HZ)
    made = Recordings(
        frames=np.array(frames).astype(np.uint16),
        times=np.concatenate(times),
        offsets=np.array(offsets, np.int64),
        labels=np.array([label for label, _ in performed]),
        subjects=np.array(["07"] * len(performed)),
        onsets=np.full(len(performed), first),
        releases=np.array([first + len(touched) - 1 for _, touched in performed]),
    )
    recording.write(path, made)
    return path


@pytest.fixture
def wrongly(tmp_path: Path) -> Path:
    """One right label, one wrong one, one gesture where none should be."""
    hand = Hand()
    swipe: Callable[[str], list[Frame]] = hand.swipe
    return labelled(
        tmp_path / "w.npz", ("swipe_left", swipe("left")), ("swipe_up", swipe("down")), ("none", swipe("right"))
    )


def test_labels_are_compared_with_what_a_model_says_of_their_recordings(replay, wrongly: Path, tmp_path: Path) -> None:
    model = tiny_model.make(tmp_path / "tiny.onnx")
    status, out, err = replay(wrongly, "--model", model, "--diff")
    assert (status, said(out)) == (1, ["-swipe_up", "+swipe_down", "-none", "+swipe_right"]), err
    assert "3 labels, 2 differences" in err
    assert [line.split()[1:5] for line in out.splitlines()][:2] == [["101.600", "s", "recording", "1:"]] * 2
    status, out, _ = replay(wrongly, "--model", model, "--diff", "--json")
    assert [json.loads(line)["recorded"]["sensor"] for line in out.splitlines()] == ["recording 1", "recording 2"]
    assert replay(wrongly, "--model", model)[1].startswith("1.600 s       recording    onset")
    status, out, _ = replay(wrongly, "--model", model, "--sensor", "arm", "--json")
    events = [json.loads(line) for line in out.splitlines()]
    assert {event["sensor"] for event in events} == {"arm"}
    assert [e["gesture"] for e in events if e["type"] == "gesture"] == ["swipe_left", "swipe_down", "swipe_right"]


@pytest.mark.skipif(not shipped()["cnn_lstm"].exists(), reason=f"{shipped()['cnn_lstm']} is not there")
def test_however_slow_this_machine_is_the_first_model_answers(replay, tmp_path: Path, monkeypatch) -> None:
    """A daemon hands over to a faster model, since somebody waits. Here a busy machine would change answers."""
    monkeypatch.setitem(Ladder.__init__.__kwdefaults__, "slow_s", 0.0)
    path = labelled(tmp_path / "s.npz", *(("swipe_left", Hand().swipe("left")),) * 5)
    status, out, err = replay(path, "--model", "cnn_lstm", "--json")
    answers = [event for event in map(json.loads, out.splitlines()) if event["type"] in ("gesture", "unknown")]
    assert status == 0 and [event["model"] for event in answers] == ["cnn_lstm"] * 5, err


def test_by_the_time_of_arrival_a_daemon_answers_what_is_sent_at_its_own_pace(replay, serve, tmp_path: Path) -> None:
    path = labelled(tmp_path / "a.npz", ("swipe_left", Hand().swipe("left")))
    there = serve("--clock", "arrival")
    client = there.client().subscribe("gesture")
    assert replay(path, "--to", there.ready["listen"])[0] == 0
    assert client.events("gesture", "recording")[0]["gesture"] == "swipe_left"


def test_what_is_touched_before_the_sensor_can_be_known_is_not_compared(replay, tmp_path: Path) -> None:
    path = labelled(tmp_path / "s.npz", *(("one_tap", Hand().swipe("left")),) * 2, lead_s=0.5)
    status, out, err = replay(path, "--model", tiny_model.make(tmp_path / "tiny.onnx"), "--diff")
    assert (status, out) == (0, "") and "0 labels, 2 before the sensor was known, 0 differences" in err


def test_what_nobody_has_named_is_not_compared(replay, tmp_path: Path) -> None:
    path = labelled(tmp_path / "o.npz", *(("other", Hand().swipe("left")),) * 2)
    status, out, err = replay(path, "--model", tiny_model.make(tmp_path / "tiny.onnx"), "--diff")
    assert (status, out) == (0, "") and "0 labels, 0 differences" in err


def test_a_session_with_a_long_pause_is_compared_event_by_event(replay, tmp_path: Path) -> None:
    hand = Hand()
    parts = [hand.idle(2.0) + hand.swipe("left") + hand.idle(1.5), hand.idle(1.0) + hand.swipe("up") + hand.idle(1.0)]
    times = [np.arange(len(parts[0])) / RATE_HZ, 60.0 + np.arange(len(parts[1])) / RATE_HZ]
    onsets = np.array([2.0, 61.0])
    made = Recordings(
        frames=np.array(parts[0] + parts[1]),
        times=np.concatenate(times),
        offsets=np.array([0, len(parts[0]) + len(parts[1])], np.int64),
        labels=np.array(["session"]),
        subjects=np.array([1]),
        event_recording=np.array([0, 0]),
        event_labels=np.array(["swipe_left", "swipe_up"]),
        event_kinds=np.array(["swipe_left", "swipe_up"]),
        event_onsets=onsets,
        event_offsets=onsets + 0.4,
    )
    path = tmp_path / "session.npz"
    recording.write(path, made)
    status, out, err = replay(path, "--model", tiny_model.make(tmp_path / "tiny.onnx"), "--diff")
    assert (status, out) == (0, "") and "2 labels, 0 differences" in err


def test_where_nobody_listens_is_one_sentence(replay, wrongly: Path) -> None:
    status, _, err = replay(wrongly, "--to", free_address(), "--speed", 1000)
    assert status == 1 and "nobody listened" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--speed", "2"), "--to HOST:PORT"),
        (("--to", "127.0.0.1:1", "--diff"), "--diff is for a replay here"),
        (("--to", "127.0.0.1:1", "--model", "lstm"), "--model is for a replay here"),
        (("--to", "127.0.0.1:1", "--provisional"), "--provisional is for a replay here"),
    ],
)
def test_flags_that_do_not_go_together_are_one_sentence(replay, wrongly: Path, flags: tuple[str, ...], words) -> None:
    status, out, err = replay(wrongly, *flags)
    assert (status, out) == (1, "") and words in err and err.count("\n") == 1


def test_what_was_said_before_an_answer_is_on_the_tape_and_can_be_said_again(
    start, serve, replay, tmp_path: Path
) -> None:
    model = tiny_model.make(tmp_path / "tiny.onnx", provisional=tiny_model.PROVISIONAL)
    daemon, path = serve("--clock", "sensor", model=model), tmp_path / "a.mcap"
    recorder = start("record", path, "--control", daemon.ready["control"])
    assert b"recording into" in recorder.stderr.readline()
    asking, sensor = daemon.client().subscribe("provisional"), Sensor(daemon, "arm").begin()
    sensor.send(sensor.hand.swipe("left"))
    asking.events("provisional", "arm")  # for which the daemon takes its time
    sensor.send(sensor.hand.idle(1.0))
    asking.events("gesture", "arm")
    asking.close()
    plain = daemon.client().subscribe("release")
    sensor.perform("up", "tap")
    plain.events("release", "arm", 2)
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(30) == 0
    events = tape_reader.read(path).events
    assert [event["id"] for event in events if event["type"] == "provisional"] == [1]
    answers = [event["provisional"] for event in events if event["type"] == "gesture"]
    assert answers == ["confirmed", None, None]
    for more in ((), ("--provisional",)):
        status, out, _ = replay(path, "--model", model, "--json", *more)
        again = [json.loads(line) for line in out.splitlines()]
        said = [event["gesture"] for event in again if event["type"] == "provisional"]
        assert status == 0 and said == (["swipe_left", "swipe_up", "one_tap"] if more else [])
        assert violations(again) == []
        status, _, err = replay(path, "--model", model, "--diff", *more)
        assert status == 0 and "3 recorded answers, 0 differences" in err
    _, out, _ = replay(path, "--model", model, "--provisional")
    assert "swipe_left?" in out and "confirmed: swipe_left, 0 ms before the finger left" in out
