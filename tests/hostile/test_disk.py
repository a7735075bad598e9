"""Disks that are full, read-only or broken while something is recorded."""

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gestured.core.errors import RecordingError
from gestured.record import arrays as recording
from gestured.record import tape_reader, tape_writer
from tests.daemon.harness import Sensor
from tests.small_recording import example

SCENE: dict[str, Any] = {"model": {"name": "tiny"}, "settings": {}}


def refuses(number: int):
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    return refuse


def test_a_disk_that_is_full_ends_a_recording_with_a_sentence_and_costs_the_daemon_nothing(start, tmp_path) -> None:
    daemon = start("--clock", "sensor", "--control", tmp_path / "control.sock")
    path = tmp_path / "drive.mcap"
    command = [sys.executable, "-m", "gestured.control", "record", path, "--control", daemon.ready["control"]]
    recorder = subprocess.Popen([*map(str, command)], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert recorder.stderr is not None and "recording into" in recorder.stderr.readline()
    # A file may not grow beyond this: what a full disk says by ENOSPC is said by EFBIG.
    resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (100_000, 100_000))
    client = daemon.client()
    sensor = Sensor(daemon, "arm").begin()
    while recorder.poll() is None:
        sensor.perform("left")
        assert client.line()["gesture"] == "swipe_left"
    _, said = recorder.communicate()
    assert recorder.returncode == 1
    assert len(said.splitlines()) == 1 and str(path) in said and os.strerror(errno.EFBIG) in said
    found = tape_reader.read(path)
    assert not found.whole and found.packets  # good up to there
    sensor.perform("left")
    assert client.line()["gesture"] == "swipe_left"


def test_a_tape_whose_disk_fails_says_so_and_is_closed(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "a.mcap"
    with (
        pytest.raises(RecordingError, match=os.strerror(errno.EIO)),
        tape_writer.Writer(path, SCENE, 1 << 30) as writer,
    ):
        writer.packet(1, "127.0.0.1:1", b"one")
        writer.flush()
        writer.packet(2, "127.0.0.1:1", b"two")
        monkeypatch.setattr(os, "fsync", refuses(errno.EIO))
        writer.flush()
    assert tape_reader.read(path).packets[0].data == b"one"


@pytest.mark.parametrize("note", ["", "a" * 100_000])  # of what is written at once, and of what waits
def test_a_tape_for_which_there_is_no_room_at_all_leaves_no_file(tmp_path: Path, note: str) -> None:
    path = tmp_path / "a.mcap"
    code = (
        "import resource, sys; from pathlib import Path; from gestured.record.tape_writer import Writer\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))  # what a full disk says by ENOSPC is said by EFBIG\n"
        f"Writer(Path(sys.argv[1]), {SCENE | {'note': note}!r}, 1 << 30)"
    )
    done = subprocess.run([sys.executable, "-c", code, path], stderr=subprocess.PIPE, text=True)
    assert done.stderr.splitlines()[-1].endswith(f"{path}: cannot be written: File too large")
    assert not path.exists()


def test_a_recording_is_written_whole_or_the_old_one_stays(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "a.npz"
    recording.write(path, example())
    before = path.read_bytes()
    monkeypatch.setattr(os, "fsync", refuses(errno.ENOSPC))
    with pytest.raises(RecordingError, match=rf"a\.npz: cannot be written: {os.strerror(errno.ENOSPC)}"):
        recording.write(path, example())
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_a_place_where_nothing_can_be_written_is_named(tmp_path: Path) -> None:
    place = Path("/proc/sys/no.npz")  # read-only even for root
    with pytest.raises(RecordingError, match="cannot be written"):
        recording.write(place, example())
    with pytest.raises(RecordingError, match="cannot be made"):
        tape_writer.Writer(place, SCENE, 1 << 20)
