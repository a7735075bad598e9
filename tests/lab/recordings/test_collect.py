"""`gestured-lab collect` in a real pseudo-terminal, with the simulated sensor over UDP: a whole session and its end."""

import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gestured.core.errors import RecordingError
from gestured.lab.recordings.collect import already
from gestured.lab.recordings.protocol import order
from gestured.record.arrays import read, write
from tests.control.pages import Page
from tests.lab.conftest import Run
from tests.small_recording import example
from tests.sockets import free_address
from tests.terminal import Terminal

KEYS = "r repeat  d discard"
GOOD = "Enter keep  " + KEYS


def collect(folder: Path, port: int, *more: str) -> "closing[Terminal]":
    """Somebody in front of `gestured-lab collect`, who performs taps."""
    flags = ("--participant", "07", "--out", folder, "--listen", f"127.0.0.1:{port}", "--gestures", "one_tap")
    return closing(Terminal("gestured.lab", "collect", *flags, "--countdown", "0", *more))


def keeps_one(person: Terminal) -> None:
    """Repeats until a take is good, as a person does."""
    while person.sees(GOOD, "  " + KEYS) != GOOD:
        person.types("r")
    person.types("\n")
    person.sees("kept, ")


@pytest.fixture
def port() -> int:
    return free_address().port


@contextmanager
def sensor(port: int) -> Iterator[None]:
    """A simulated sensor; it ends where nobody listens yet."""
    command = [sys.executable, "-m", "gestured.control", "simulate", "--to", f"127.0.0.1:{port}", "--kinds", "one_tap"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()


@pytest.mark.slow
def test_a_session_that_is_ended_and_goes_on(tmp_path: Path, port: int) -> None:
    trials = order("07", 0, ["one_tap"], 1)
    path = tmp_path / "07.npz"
    with ExitStack() as held:
        with collect(tmp_path, port) as person:
            person.sees("Do you agree?")
            person.types("yes\n")
            person.sees("Waiting for the sensor")
            held.enter_context(sensor(port))
            person.sees("Enter when it is in place")
            person.types("\n")
            person.sees(f"1/9  {trials[0]}")
            keeps_one(person)
            assert read(path).labels.tolist() == ["one_tap"]  # on disk before the next prompt
            person.sees(f"2/9  {trials[1]}")
            person.types("q")
            person.sees("the same command goes on from here")
            assert person.ends() == 0
        with collect(tmp_path, port) as person:
            person.sees("gave consent on")
            person.sees("1 of 9 are done already")
            person.sees("Enter when it is in place")
            person.types("\n")
            person.sees(f"2/9  {trials[1]}")
            keeps_one(person)
            person.sees("3/9")
            person.process.send_signal(signal.SIGTERM)
            person.sees("Ended with 2 recordings")
            assert person.ends() == 0

    kept = read(path)
    assert kept.speeds is not None and kept.inclinations is not None and kept.consents is not None
    done = trials[:2]
    assert kept.speeds.tolist() == [trial.speed for trial in done]
    assert kept.inclinations.tolist() == [trial.inclination for trial in done]
    assert set(kept.subjects.tolist()) == {"07"}
    assert len(set(kept.consents.tolist())) == 1
    assert kept.onsets is not None and kept.releases is not None
    for i in range(2):  # what is marked as touched is what was touched
        rise = kept.frames_of(i).astype(float) - kept.frames_of(i).min(axis=0)
        strongest = int(rise.max(axis=(1, 2)).argmax())
        assert kept.onsets[i] <= strongest <= kept.releases[i]
        assert kept.times_of(i)[0] == 0.0
    assert os.listdir(tmp_path) == ["07.npz"]


def draws(page: Page, seat: int, scribble: bool) -> None:
    """One finger of somebody at a pad: a tap, or a scribble."""
    begun = time.monotonic()
    while (t := time.monotonic() - begun) < (1.0 if scribble else 0.15):
        x, y = (0.5 + 0.3 * math.sin(9 * t), 0.5 + 0.3 * math.sin(14 * t)) if scribble else (0.5, 0.5)
        page.ask("/touch", "POST", {"seat": seat, "sent": t, "samples": [[1, t, x, y, 0.5, 0.0]]})
        time.sleep(0.01)  # between two pictures of a screen
    page.ask("/touch", "POST", {"seat": seat, "sent": t, "samples": [[1, t, x, y, 0.0, 0.0]]})


@pytest.mark.slow
def test_a_pad_is_a_sensor_and_its_page_shows_the_words_and_presses_the_keys(tmp_path: Path, port: int) -> None:
    with collect(tmp_path, port, "--pad", "127.0.0.1:0", "--non-gestures", "scribble") as person:
        person.sees("Do you agree?")
        page = Page(re.findall(r"http://\S+", person.said)[0]).come_in()
        stream = page.stream()
        seat = stream.until("seat")[1]["seat"]
        person.types("yes\n")
        for n in range(1, 5):
            verdict = ""
            while verdict not in (GOOD, "keep? [y/N]"):
                while f"{n}/4  " not in (trial := stream.until("told")[1]["text"]):
                    pass
                while "now!" not in stream.until("told")[1]["text"]:
                    pass
                draws(page, seat, "scribble" in trial)
                verdict = person.sees(GOOD, "keep? [y/N]", "  " + KEYS)
                press = {GOOD: "\n", "keep? [y/N]": "y"}.get(verdict, "r")
                assert page.ask("/key", "POST", {"key": press})[0] == 200
            person.sees(f"kept, {n} in")
        person.sees("All 4 are done")
        assert person.ends() == 0
    kept = read(tmp_path / "07.npz")
    assert kept.sensors.tolist() == ["touchscreen"] * 4 and set(kept.inclinations.tolist()) == {0}
    assert sorted(zip(kept.labels.tolist(), kept.kinds.tolist(), strict=True)) == [
        ("none", "scribble"), *[("one_tap", "one_tap")] * 3
    ]  # fmt: skip
    assert kept.touch_ids is not None and (kept.touch_ids >= 0).any() and set(kept.consents.tolist()) != {""}


def test_without_consent_nothing_is_recorded(tmp_path: Path, port: int) -> None:
    with collect(tmp_path, port) as person:
        person.sees("Do you agree?")
        person.types("no\n")
        person.sees("nothing is recorded")
        assert person.ends() == 0
    assert os.listdir(tmp_path) == []


def test_a_silent_sensor_is_told_and_ctrl_c_leaves_the_terminal_as_it_was(tmp_path: Path, port: int) -> None:
    with collect(tmp_path, port, "--sensor", "door") as person:
        person.sees("Do you agree?")
        person.types("yes\n")
        person.sees(f"no frames of door arrive on 127.0.0.1:{port}")
        person.process.send_signal(signal.SIGINT)
        assert person.ends() == 130


def test_without_a_terminal_it_says_what_it_needs(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    status, _, err = run("collect", "--participant", "07")
    said = "gestured-lab: collect talks with a person: expected a terminal as standard input and output\n"
    assert (status, err) == (1, said)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("flag", "value"),
    [("--participant", "Anna Meier"), ("--gestures", "one_tap,Wave"), ("--gestures", "swipe_lft"), ("--grid", "1x9"),
     ("--repeats", "0"), ("--seed", "-1"), ("--countdown", "x"), ("--listen", "9000"), ("--sensor", "a/b")],
)  # fmt: skip
def test_flags_are_checked(run: Run, flag: str, value: str) -> None:
    status, _, err = run("collect", "--participant", "07", flag, value)
    assert status == 2 and "expected" in err


def test_a_file_that_is_somebody_elses_or_another_sensors_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "07.npz"
    assert already(path, "07", (2, 3)) is None
    write(path, replace(example(), subjects=np.array(["07", "08"])))
    with pytest.raises(RecordingError, match="subjects: expected 07 alone, found 08"):
        already(path, "07", (2, 3))
    write(path, replace(example(), subjects=np.array(["07", "07"])))
    with pytest.raises(RecordingError, match="frames: expected the grid 9x9, found 2x3"):
        already(path, "07", (9, 9))
    kept = already(path, "07", (2, 3))
    assert kept is not None and len(kept) == 2
    with pytest.raises(RecordingError, match=r"07\.npz: may be of the same person; expected that name, .* found .7."):
        already(tmp_path / "7.npz", "7", (2, 3))
    assert already(tmp_path / "70.npz", "70", (2, 3)) is None
