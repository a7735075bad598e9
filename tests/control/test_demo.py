"""gesturectl demo, with the real daemon and the shipped model."""

import json
import os
import re
import signal
import subprocess
import tempfile
import threading
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import gestured
from gestured.client.engine import Engine
from gestured.client.sensor import Form
from gestured.control.cli import parser
from gestured.control.demo import sending
from gestured.control.play import performance
from gestured.model.shipped import shipped
from tests.control.pages import Page
from tests.sockets import PATIENCE_S
from tests.terminal import Terminal

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(not shipped()["cnn_lstm"].exists(), reason=f"{shipped()['cnn_lstm']} is not there"),
]


def daemons(mark: Path) -> list[int]:
    """Processes of the daemon that were started with this folder for temporary files."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if str(mark).encode() in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def test_a_folder_of_the_same_name_is_not_taken_for_the_program(tmp_path, monkeypatch):
    """As in the folder into which somebody has cloned it."""
    (tmp_path / "gestured").mkdir()
    (tmp_path / "gestured" / "__init__.py").write_text("raise SystemExit('not this one')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(gestured.__file__).parent.parent))
    with Engine("cnn_lstm", 9, 9) as engine:
        assert engine.ready["type"] == "ready"


def ended(process: "subprocess.Popen[bytes]") -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a process, once it has ended by itself."""
    out, err = process.communicate(timeout=60)
    return process.returncode, out.decode(), err.decode()


def test_its_daemon_starts_from_a_folder_that_has_been_removed(tmp_path: Path, monkeypatch):
    (folder := tmp_path / "gone").mkdir()
    with monkeypatch.context() as here:
        here.chdir(folder)
        folder.rmdir()
        with Engine("cnn_lstm", 9, 9) as engine:
            assert engine.ready["model"] == "cnn_lstm"


def test_without_a_folder_for_temporary_files_it_ends_with_a_sentence(monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: ["/proc"])  # nobody can make a file there
    with pytest.raises(gestured.GesturedError, match=r"^the daemon did not start: No usable temporary directory found"):
        Engine("cnn_lstm", 9, 9)


def test_outcomes_add_up_to_the_summary(start, shallow):
    kinds = ("--kinds", "swipe_left,one_tap", "--speed", "fast")
    status, out, err = ended(start("demo", "--seconds", 5, *kinds, "--json", env={"TMPDIR": str(shallow)}))
    assert (status, err) == (0, "")
    *outcomes, summary = map(json.loads, out.splitlines())
    assert summary.pop("type") == "summary"
    performed = [outcome["performed"] for outcome in outcomes if outcome["verdict"] != "false"]
    assert performed[:2] == ["swipe_left", "one_tap"]
    for verdict in ("right", "wrong", "missed", "rejected", "false"):
        assert summary[verdict] == sum(outcome["verdict"] == verdict for outcome in outcomes)
    for outcome in outcomes:
        if outcome["verdict"] == "right":
            assert outcome["recognised"] == outcome["performed"]
            assert -100 < outcome["latency_ms"] < 5000
    assert summary["right"] >= 1
    assert daemons(shallow) == [] and os.listdir(shallow) == []


def test_ended_early_it_still_sums_up_and_leaves_nothing_behind(start, shallow):
    process = start("demo", "--seconds", 60, env={"TMPDIR": str(shallow)})
    assert b"listens on" in process.stdout.readline()
    assert len(daemons(shallow)) == 2  # and the page
    process.terminate()
    status, out, err = ended(process)
    assert (status, err) == (0, "") and "Summary" in out
    assert daemons(shallow) == [] and os.listdir(shallow) == []


def test_ended_amid_a_packet_it_sends_that_packet_first(monkeypatch, udp) -> None:
    amid, packet = threading.Event(), Form.packet

    def slowly(*arguments: Any) -> bytes:
        amid.set()
        time.sleep(0.1)
        return packet(*arguments)

    monkeypatch.setattr(Form, "packet", slowly)
    args = parser(["demo"]).parse_args(["demo"])
    with sending(udp.getsockname(), performance(args, 5.0)):
        assert amid.wait(PATIENCE_S)
    assert b"/demo/pressure" in udp.recv(65536)


def test_killed_outright_it_leaves_no_daemon_running(start, shallow):
    process = start("demo", "--seconds", 60, env={"TMPDIR": str(shallow)})
    assert b"listens on" in process.stdout.readline()
    process.kill()
    process.communicate(timeout=30)
    patience = time.monotonic() + PATIENCE_S
    while daemons(shallow) and time.monotonic() < patience:
        time.sleep(0.05)
    assert daemons(shallow) == []


def test_without_a_terminal_it_says_words_and_goes_on_while_its_pad_is_open(start, shallow):
    """Without escape codes, and where an encoding has no blocks without pictures."""
    more = {"TMPDIR": str(shallow), "PYTHONIOENCODING": "ascii"}
    process = start("demo", "--seconds", 5, "--kinds", "swipe_up", env=more)
    (address,) = [line.split()[-1] for _, line in zip(range(5), process.stdout, strict=False) if b"A pad for" in line]
    stream = Page(address.decode()).come_in().stream()
    stream.until("frame")
    said = b""
    while b"The pad is still open" not in said:
        said += process.stdout.readline()
    assert b"\x1b" not in said and b"performed   swipe_up" in said
    stream.until("frame")
    stream.close()
    status, out, err = ended(process)
    assert (status, err) == (0, "") and "Summary" in out
    (exported,) = [line for line in out.splitlines() if "export " in line]
    assert "Then run one of these in each:\n  gestured --" in out  # not all in one
    assert exported.strip() in Path(gestured.__file__, "../../README.md").resolve().read_text().splitlines()
    assert daemons(shallow) == [] and os.listdir(shallow) == []


def test_its_page_shows_the_simulated_sensor_first_and_follows_the_finger(start, shallow):
    """The page opens with the first sensor, and nobody is on the pad; its sliders need events of the type touch."""
    process = start("demo", "--seconds", 60, "--kinds", "swipe_up", env={"TMPDIR": str(shallow)})
    (address,) = [line.split()[-1] for _, line in zip(range(4), process.stdout, strict=False) if b"a browser" in line]
    stream = Page(address.decode()).come_in().stream("demo")
    while len(sensors := list(stream.until("sensors")[1]["sensors"])) < 2:
        pass
    assert sensors == ["demo", "pad"]
    assert stream.until("touch")[1]["phase"] == "down"
    stream.close()
    process.send_signal(signal.SIGINT)
    status, out, err = ended(process)
    assert (status, err) == (0, "") and "Summary" in out


def test_a_model_that_cannot_be_used_is_one_sentence(start, shallow):
    status, out, err = ended(start("demo", "--model", shallow / "none.onnx", env={"TMPDIR": str(shallow)}))
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert "none.onnx" in err
    assert os.listdir(shallow) == []


def pictures(said: str) -> list[list[str]]:
    """What stood there one after the other, without colours."""
    parts = re.split("\x1b\\[\\d*F\x1b\\[J|\x1b\\[J", said)
    return [re.sub("\x1b\\[[0-9;?]*[a-zA-Z]", "", part).splitlines() for part in parts]


def test_the_demo_begins_with_a_circle_that_is_drawn_and_ends_with_what_comes_next(shallow) -> None:
    with closing(
        Terminal("gestured.control", "demo", "--seconds", 5, "--speed", "normal", TMPDIR=str(shallow))
    ) as demo:
        demo.sees("performed   circle_clockwise")
        assert re.search(r"http://127\.0\.0\.1:\d+/#", demo.said)
        drawn = [picture for picture in pictures(demo.said) if any("activity  " in line for line in picture)]
        assert len({"".join(line[2:11] for line in picture[:5]) for picture in drawn}) >= 5  # it goes round
        assert all(len(picture) == 5 and max(map(len, picture)) <= 79 for picture in drawn[:-1])
        demo.sees("gesturectl simulate")
        assert "gestured --" in demo.said and "percentile" not in demo.said
        assert re.search(r"gestures +[1-9]: ", demo.said)
        assert demo.ends() == 0
