"""Recordings: what a real daemon hands over, what survives a crash, and what a replay makes of it."""

import json
import os
import signal
import socket
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from gestured.client.sensor import Form
from gestured.control.diff import Answer, Difference, Recorded, differences
from gestured.control.record import Keeper
from gestured.core.errors import RecordingError
from gestured.core.frames import Frame, Touch
from gestured.core.mounting import Mounting
from gestured.record import arrays as recording
from gestured.record import tape_reader, tape_writer
from tests.control.conftest import ROOT, gestures
from tests.control.test_foreign_text import HOSTILE, plain
from tests.daemon import tiny_model
from tests.daemon.harness import Daemon, Sensor
from tests.sockets import GESTURE


def test_a_recording_holds_every_packet_and_replays_to_the_same_events(recorded, run, daemon, tmp_path) -> None:
    sent = []
    original = Sensor.packet

    def packet(self, frame):
        sent.append(original(self, frame))
        return sent[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sensor, "packet", packet)
        path, said = recorded(gestures(daemon, "rec", "left", "tap", "up"))
    assert json.loads(said) == {"file": str(path), "packets": len(sent), "events": 9, "lost": 0, "ended": "as asked"}
    found = tape_reader.read(path)
    assert found.whole and [p.data for p in found.packets] == sent
    assert found.scene["model"]["name"] == "tiny" and found.scene["settings"]["clock"] == "sensor"
    names = [e["gesture"] for e in found.events if e["type"] == "gesture"]
    assert names == ["swipe_left", "one_tap", "swipe_up"]
    model = found.scene["settings"]["model"]
    status, out, err = run("replay", path, "--json", "--model", model)
    assert status == 0
    twins = [json.loads(line) for line in out.splitlines()]
    assert [(e["type"], e["id"]) for e in twins] == [(e["type"], e["id"]) for e in found.events]
    for event, twin in zip(found.events, twins, strict=True):
        for one, other in ((event, twin), (event.get("where", {}), twin.get("where", {}))):
            for key in one.keys() - {"where"}:
                close = one[key] if isinstance(one[key], str | None) else pytest.approx(one[key], abs=1e-3)
                assert other[key] == close, key
    status, out, err = run("replay", path, "--diff", "--model", model)
    assert (status, out) == (0, "") and "3 recorded answers, 0 differences" in err


def test_a_tape_that_begins_while_the_sensors_clock_is_ahead_is_one_like_any_other(
    recorded, run, daemon, tmp_path
) -> None:
    sensor = Sensor(daemon, "ahead").begin()
    sensor.send(sensor.hand.idle(30.0)).perform("tap")  # within a fraction of that time
    client = daemon.client().subscribe("gesture", sensors=["ahead"])

    def perform() -> None:
        sensor.begin().perform("left", "up")
        client.until(lambda line: line.get("gesture") == "swipe_up")

    path, _ = recorded(perform)
    told = [event for event in tape_reader.read(path).events if event.get("gesture") in ("swipe_left", "swipe_up")]
    model = tape_reader.read(path).scene["settings"]["model"]
    status, out, err = run("replay", path, "--diff", "--model", model)
    assert (status, out) == (0, "") and "2 recorded answers" in err
    twins = [json.loads(line) for line in run("replay", path, "--json", "--model", model)[1].splitlines()]
    assert [e["onset"] for e in twins if "gesture" in e] == pytest.approx([e["onset"] for e in told], abs=0.001)
    assert run("export", path, tmp_path / "ahead.npz")[0] == 0
    found = recording.read(tmp_path / "ahead.npz")
    assert found.event_labels.tolist() == ["swipe_left", "swipe_up"] == [event["gesture"] for event in told]
    assert found.event_onsets.tolist() == [event["onset"] for event in told]
    for event in told:  # each begins with one of the frames
        assert np.abs(found.times - event["onset"]).min() < 0.001


def test_a_replay_with_another_model_shows_what_differs(recorded, run, daemon, tmp_path) -> None:
    path, _ = recorded(gestures(daemon, "dif", "left", "tap"))
    names = list(tiny_model.GESTURES)
    names[0], names[5] = names[5], names[0]  # a tap is a swipe now, and the other way round
    other = tiny_model.make(tmp_path / "other.onnx", gestures=tuple(names))
    status, out, err = run("replay", path, "--diff", "--model", other)
    assert status == 1 and "2 differences" in err
    lines = [line.split(": ", 1)[0][:1] + line.split(": ", 1)[1].split()[0] for line in out.splitlines()]
    assert lines == ["-swipe_left", "+one_tap", "-one_tap", "+swipe_left"]
    assert {" ".join(line.split()) for line in err.splitlines()[:-1]} == {
        "1 x swipe_left -> one_tap", "1 x one_tap -> swipe_left",
    }  # fmt: skip
    status, out, _ = run("replay", path, "--diff", "--model", other, "--json")
    assert [json.loads(line)["replayed"]["answer"] for line in out.splitlines()] == ["one_tap", "swipe_left"]


def test_a_daemon_to_which_it_is_sent_answers_as_the_recorded_one_did(recorded, run, daemon: Daemon, serve) -> None:
    path, _ = recorded(gestures(daemon, "cmp", "left", "tap", "up"))
    other = serve("--clock", "sensor")
    client = other.client().subscribe("gesture", "status")
    for again in (False, True):  # the second time it knows the sensor, whose clock is far ahead
        if again:  # the sensor is free for another source
            client.until(lambda line: line.get("sensors", {}).get("cmp") == "stale")
        status, out, err = run("replay", path, "--to", other.ready["listen"], "--speed", 50)
        assert (status, out) == (0, "") and err.startswith("sent ")
        answers = client.events("gesture", "cmp", 3)
        assert [event["gesture"] for event in answers] == ["swipe_left", "one_tap", "swipe_up"]


def test_a_contact_before_whose_answer_a_recording_ends_is_no_difference(recorded, run, daemon, tmp_path: Path) -> None:
    path, _ = recorded(gestures(daemon, "end", "left", "tap"))
    found = tape_reader.read(path)
    last = max(n for n, event in enumerate(found.events) if event["type"] == "onset")
    with tape_writer.Writer(tmp_path / "ends.mcap", found.scene, 1 << 30) as writer:
        for packet in found.packets:
            writer.packet(packet.t_ns, str(packet.source), packet.data)
        for event in found.events[: last + 1]:
            writer.event(found.packets[-1].t_ns, event)
    status, out, err = run("replay", tmp_path / "ends.mcap", "--diff", "--model", found.scene["settings"]["model"])
    assert (status, out) == (0, "") and "1 recorded answers, 0 differences" in err


def test_foreign_names_in_a_recording_are_shown_and_not_obeyed(recorded, run, daemon, tmp_path: Path) -> None:
    path, _ = recorded(gestures(daemon, "tape", "left", "tap"))
    found = tape_reader.read(path)
    with tape_writer.Writer(tmp_path / "hostile.mcap", found.scene, 1 << 30) as writer:
        for packet in found.packets:
            writer.packet(packet.t_ns, f"{packet.source[0]}:{packet.source[1]}", packet.data)
        for event in found.events:
            changed = {"gesture": HOSTILE} if event["type"] == "gesture" else {}
            writer.event(found.packets[-1].t_ns, dict(event) | changed)
    for more in ([], ["--json"]):
        model = found.scene["settings"]["model"]
        status, out, err = run("replay", tmp_path / "hostile.mcap", "--diff", "--model", model, *more)
        assert status == 1 and "owned" in out, err
        plain(out + err)


def test_a_killed_recorder_leaves_what_was_flushed(start, daemon: Daemon, tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    recorder = start("record", path, "--control", daemon.ready["control"])
    assert b"recording into" in recorder.stderr.readline()
    gestures(daemon, "kill", "left")()
    while "swipe_left" not in {e.get("gesture") for e in tape_reader.read(path).events}:
        pass  # a reader sees what was flushed, while it is being written
    recorder.kill()
    recorder.wait(30)
    found = tape_reader.read(path)
    assert not found.whole and "swipe_left" in {e.get("gesture") for e in found.events}


@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGHUP])
def test_a_recording_is_whole_whatever_asks_for_its_end(recorded, stop: int) -> None:
    path, said = recorded(lambda: None, stop=stop)
    assert json.loads(said)["ended"] == "as asked"
    assert tape_reader.read(path).whole


def test_whatever_is_cut_off_the_rest_is_read(recorded, daemon: Daemon, tmp_path: Path) -> None:
    path, _ = recorded(gestures(daemon, "cut", "left"))
    data, whole = path.read_bytes(), tape_reader.read(path)
    short = tmp_path / "short.mcap"
    read = []
    for size in range(0, len(data), 97):
        short.write_bytes(data[:size])
        try:
            found = tape_reader.read(short)
        except RecordingError as error:
            assert str(short) in str(error)
            continue
        assert not found.whole and found.packets == whole.packets[: len(found.packets)]
        read.append(len(found.packets))
    assert read and read == sorted(read)


@pytest.mark.parametrize("words", [("tune",), ("replay",), ("export", "out.npz")])
def test_each_command_that_reads_a_tape_says_once_that_it_is_cut_off(
    run, words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    command, *out = words
    Path("short.mcap").write_bytes((ROOT / "docs" / "demo.mcap").read_bytes()[:-1])
    _, _, err = run(command, "short.mcap", *out)
    assert err.count("short.mcap: is cut off or damaged; what is good before that is used\n") == 1


def test_a_recording_ends_at_its_size_and_never_replaces_a_file(run, start, serve, tmp_path: Path) -> None:
    flooded = serve()  # of its own: a flood would fill the others' flight recorder, and wait in their socket
    path = tmp_path / "full.mcap"
    recorder = start("record", path, "--control", flooded.ready["control"], "--max-mib", "1", "--json")
    with socket.socket(type=socket.SOCK_DGRAM) as sender:
        sender.connect(flooded.address)
        while recorder.poll() is None:
            sender.send(os.urandom(8000))  # nonsense is recorded, too
    summary = json.loads(recorder.communicate()[0])
    assert summary["ended"] == "the file is as large as it may be"
    assert path.stat().st_size < 1.5 * (1 << 20) and tape_reader.read(path).whole
    status, _, err = run("record", path, "--control", flooded.ready["control"])
    assert status == 1 and str(path) in err and "File exists" in err


def test_a_recording_whose_daemon_goes_is_good_and_says_so(start, serve, tmp_path: Path) -> None:
    daemon = serve("--clock", "sensor")
    path = tmp_path / "gone.mcap"
    recorder = start("record", path, "--control", daemon.ready["control"])
    assert b"recording into" in recorder.stderr.readline()
    gestures(daemon, "gone", "left")()
    assert daemon.stop() == 0
    _, err = recorder.communicate(timeout=30)
    assert recorder.returncode == 1 and b"the daemon closed the connection" in err
    found = tape_reader.read(path)
    assert found.whole and "swipe_left" in {e.get("gesture") for e in found.events}
    assert len(found.packets) == 30 + 7 + 15  # all that came before it went


def test_flag_keeps_the_flight_recorder(ctl, run, daemon: Daemon, tmp_path: Path) -> None:
    gestures(daemon, "flag", "left")()
    path = tmp_path / "wrong.mcap"
    status, out, _ = ctl("flag", path, "--note", "it was a tap")
    found = tape_reader.read(path)
    assert status == 0 and f"{path}: {len(found.packets)} packets" in out
    assert found.scene["note"] == "it was a tap" and len(found.scene["model"]["sha256"]) == 64
    assert "swipe_left" in {e.get("gesture") for e in found.events}
    status, _, err = run("replay", path, "--diff", "--model", found.scene["settings"]["model"])
    assert status in (0, 1) and "differences" in err


def test_a_flag_that_is_ended_early_says_so(ctl, daemon: Daemon, tmp_path: Path, monkeypatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    gestures(daemon, "early", "left")()
    monkeypatch.setattr(Keeper, "keep", interrupted)
    status, _, err = ctl("flag", tmp_path / "wrong.mcap")
    assert (status, err) == (1, f"gesturectl: ended before all was written; {tmp_path}/wrong.mcap is not complete\n")


def test_two_flags_of_one_second_have_names_of_their_own(ctl, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    told = [json.loads(ctl("flag", "--json")[1])["file"] for _ in range(2)]
    assert len(set(told)) == 2 and all(tape_reader.read(file).whole for file in told)


def test_export_gives_the_contracts_npz(recorded, run, daemon: Daemon, tmp_path: Path) -> None:
    path, _ = recorded(gestures(daemon, "exp", "left", "up"))
    out = tmp_path / "exp.npz"
    status, said, _ = run("export", path, out, "--sensor", "exp", "--json")
    assert status == 0 and json.loads(said)["events"] == 2
    found = recording.read(out)
    assert found.labels.tolist() == ["session"] and found.subjects.tolist() == ["exp"]
    assert found.event_labels.tolist() == ["swipe_left", "swipe_up"]
    assert found.frames.shape == (30 + 7 + 15 + 7 + 15, 9, 9)
    assert np.diff(found.times) == pytest.approx(1 / 15, abs=1e-3)
    status, _, err = run("export", path, tmp_path / "x.npz", "--sensor", "nobody")
    assert status == 1 and "nobody" in err and not (tmp_path / "x.npz").exists()
    before = path.read_bytes()
    status, _, err = run("export", path, path)
    assert status == 2 and f"OUT: '{path}': expected a file *.npz\n" in err
    assert path.read_bytes() == before


def three_frames(path: Path, frame: Frame, *events: Mapping[str, object], **mounted: object) -> Path:
    """A tape of a sensor of 3 x 5 taxels that sends a frame three times, from 10**9 s on."""
    settings = {"model": "cnn_lstm", "fallback": [], "grid": [3, 5], "sensors": {"arm": mounted}}
    told = {"settings": settings, "gestures": ["one_tap"], "model": {"rows": 9, "columns": 9}}
    with tape_writer.Writer(path, told, 1 << 20) as writer:
        for n in range(3):
            writer.packet(10**18 + n * 10**8, "127.0.0.1:5", Form("arm", "ints").packet(frame, n, 0.0))
        for event in events:
            writer.event(10**18, event)
    return path


@pytest.mark.parametrize(
    "mounted", [{}, {"rotate": 90}, {"rotate": 180, "invert": True}, {"rotate": 270, "mirror": True}]
)
def test_an_export_is_what_a_person_in_front_of_the_sensor_sees(
    run, tmp_path: Path, mounted: dict[str, object]
) -> None:
    mounting, sent = Mounting(**mounted), np.arange(15).reshape(3, 5)
    strongest = (0.0, 2.0) if mounting.invert else (4.0, 0.0)  # x to the right and y upward, as sent
    path = three_frames(tmp_path / "tape.mcap", Frame(0.0, sent, (Touch(7, *strongest),)), **mounted)
    status, _, err = run("export", path, tmp_path / "out.npz")
    assert (status, err) == (0, "")
    found = recording.read(tmp_path / "out.npz")
    assert (found.frames == mounting.frame(sent)).all() and len(found.frames) == 3
    (finger,) = next(found.stream(0)).touches
    rows, columns = mounting.shape(3, 5)
    assert divmod(int(found.frames[0].argmax()), columns) == (rows - 1 - finger.y, finger.x)


@pytest.mark.parametrize("towards", [-np.inf, np.inf])
def test_a_gesture_that_ends_with_the_last_frame_is_exported(run, tmp_path: Path, towards: float) -> None:
    """A sensor that sends only while it is touched; the times of frames and events are rounded differently."""
    offset = float(np.nextafter(10**9 + 0.2, towards))
    event = GESTURE | {"sensor": "arm", "onset": 10**9 + 0.1, "offset": offset}
    path = three_frames(tmp_path / "tape.mcap", Frame(0.0, np.arange(15).reshape(3, 5)), event)
    assert run("export", path, tmp_path / "out.npz")[0] == 0
    assert recording.read(tmp_path / "out.npz").event_labels.tolist() == ["swipe_left"]


def test_a_contact_that_began_just_before_the_sensor_was_known_is_no_difference(tmp_path: Path) -> None:
    """The replay sees its rest, which it answers otherwise."""
    said = [GESTURE | {"onset": onset, "offset": 14.0, "decided": 14.5} for onset in (9.0, 10.0, 12.0)]
    path = three_frames(tmp_path / "tape.mcap", Frame(0.0, np.zeros((3, 5))), *said)
    again = [GESTURE | {"type": "unknown", "onset": 10.1}, said[2]]
    assert Recorded(path).compare(again, lambda sensor, t: t >= 10.05) == ("1 recorded answers", 2, [])


def test_a_tape_of_gestures_that_the_model_lacks_is_one_sentence(run, tmp_path: Path) -> None:
    model, path = tiny_model.make(tmp_path / "tiny.onnx"), tmp_path / "bad.mcap"
    told = {"settings": {"model": str(model), "fallback": []}, "gestures": ["wink"], "model": {"rows": 9, "columns": 9}}
    with tape_writer.Writer(path, told, 1 << 20) as writer:
        writer.packet(10**18, "127.0.0.1:5", b"rubbish!")
    status, out, err = run("replay", path, "--model", model)
    assert (status, out, err.count("\n")) == (1, "", 1) and "wink" in err


def test_differences_match_contacts_by_sensor_and_onset() -> None:
    a = Answer("arm", 10.0, "one_tap", 0.9)
    near = Answer("arm", 10.1, "one_tap", 0.91)
    other = Answer("arm", 10.1, "unknown", 0.2)
    elsewhere = Answer("leg", 10.0, "one_tap", 0.9)
    late = Answer("arm", 12.0, "one_tap", 0.9)
    unsure = Answer("arm", 10.0, "one_tap", 0.7)
    assert differences([a], [near]) == []
    assert differences([a], [other]) == [Difference(a, other)]
    assert differences([a], [elsewhere]) == [Difference(a, None), Difference(None, elsewhere)]
    assert differences([a, late], [late, near]) == []
    assert differences([a], [unsure]) == [Difference(a, unsure)]
    assert Difference(a, unsure).names == (a.answer, a.answer) and Difference(None, a).names == ("nothing", a.answer)
    assert differences([], [a]) == [Difference(None, a)]
    assert Difference(a, None).words().startswith("- ") and "arm: one_tap 0.900" in Difference(a, None).words()
