"""`gestured-lab adapt`: what it writes, what it says, and that it writes nothing where that is no better."""

import argparse
import errno
import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest

from gestured.control.cli import main as gesturectl
from gestured.lab.adapt import adaptation, command
from gestured.lab.adapt.material import own_recordings
from gestured.lab.adapt.weights import base_of
from gestured.lab.cli import main
from gestured.lab.decide import confidence
from gestured.lab.evaluate import model_answers
from gestured.lab.own.learn import Seen
from gestured.lab.recordings.origin import KEY, origins
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.record.arrays import write
from gestured.simulator import GESTURES
from tests.documents.blocks import blocks
from tests.lab.adapt.recorded import cut_gestures, unknown_sensor
from tests.lab.conftest import Run
from tests.lab.test_own import drawn


def sluggish(tmp_path: Path) -> Path:
    """A sensor whose firmware averages over time: each frame is four fifths of the one before."""
    made = cut_gestures(("07", "08", "09"), GESTURES, repeats=2)
    frames = made.frames.astype(np.float32)
    for start, end in zip(made.offsets[:-1].tolist(), made.offsets[1:].tolist(), strict=True):
        for t in range(start + 1, end):
            frames[t] = 0.8 * frames[t - 1] + 0.2 * frames[t]
    path = tmp_path / "sluggish.npz"
    write(path, replace(made, frames=frames))
    return path


@pytest.mark.slow
@pytest.mark.usefixtures("little")
def test_the_document_leads_to_a_model(
    tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What docs/own-sensor.md does with recordings runs, in its order; the model still learns gestures of one's own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(adaptation, "WAYS", (1.0,))
    Path("recordings").mkdir()
    for k, name in enumerate(("07", "08")):
        made = cut_gestures((name,), GESTURES, repeats=2, sensor=unknown_sensor(k))
        assert made.frames.shape[1:] == (12, 10) and np.ptp(made.frames) > 0
        write(f"recordings/{name}.npz", made)
    ran = []
    words = f"tests/lab/adapt/test_command.py::{request.node.name}"
    for line in "".join(block.text for block in blocks("run", words)).splitlines():
        program, *arguments = shlex.split(line)
        if arguments[0] == "adapt":
            arguments += ["--steps", "2", "--force"]  # it is no better, and --force makes that no failure
        status = (gesturectl if program == "gesturectl" else main)(arguments)
        said = capsys.readouterr()
        assert status == 0, said.err
        assert arguments[0] != "adapt" or "my.onnx: written: " in said.out  # and the reason why it is no better
        ran.append(arguments[0])
    assert ran == ["tune", "adapt", "check"]
    model = open_model(Path("my.onnx"))
    assert json.loads(model.properties["classes"])[: len(GESTURES)] == list(GESTURES)
    assert json.loads(model.properties["provisional"])["elapsed_s"][0] == 0
    assert model.space is not None
    seen = Seen.by(model, drawn())
    plan, _ = seen.plans()
    np.testing.assert_allclose(model.space.mean, seen.embedding[plan].mean(axis=0), atol=1e-4)  # of the new weights
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my.onnx", "recordings"]


@pytest.mark.hostile
@pytest.mark.timeout(900)
def test_a_sensor_that_models_do_not_know_is_learned(run: Run, tmp_path: Path) -> None:
    path = sluggish(tmp_path)
    # Of the few simulated gestures here a single one that is lost would be too many.
    _, out, _ = run(path, "--out", "my.onnx", "--base", "cnn_lstm", "--steps", "60", "--force", "--json")
    found = json.loads(out)
    assert not [reason for reason in found["reasons"] if "simulated" not in reason]
    before, after = found["before"]["own"], found["after"]["own"]
    assert after["right"]["share"] >= before["right"]["share"] + 0.1
    assert after["wrong"]["share"] <= before["wrong"]["share"]


def test_the_old_model_is_judged_at_its_usual_operating_point(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As whoever runs it does; its one threshold is used by no strictness. The new one has learned nothing here."""
    path = sluggish(tmp_path)
    monkeypatch.setattr(adaptation, "learned", lambda start, *_: start)
    monkeypatch.setattr(adaptation, "WAYS", (1.0,))
    monkeypatch.setattr(
        adaptation, "Foretold", argparse.Namespace(sessions=lambda _: argparse.Namespace(rule=lambda *_: {}))
    )
    monkeypatch.setattr(command, "_write", lambda *_: None)
    _, out, _ = run(path, "--out", "my.onnx", "--base", "cnn_lstm", "--json")
    model, own = open_model("cnn_lstm"), own_recordings([path])
    said, right = model_answers(model, own.samples), dict.fromkeys(("normal", "one"), 0)
    assert model.points is not None
    for sure, label, best in zip(confidence(said), own.samples.labels, said[0].argmax(axis=1), strict=True):
        if GESTURES[best] == label:
            right["normal"] += bool(sure >= model.points["normal"].thresholds[GESTURES[best]])
            right["one"] += bool(sure >= model.threshold)
    before = json.loads(out)["before"]["own"]["right"]["share"]
    assert before == pytest.approx(right["normal"] / own.performed, abs=1e-4) and right["normal"] < right["one"]


def test_where_it_is_no_better_nothing_is_written(run: Run, tmp_path: Path) -> None:
    write(tmp_path / "a.npz", cut_gestures(("07", "08"), GESTURES[:6], repeats=2))
    status, out, err = run("a.npz", "--out", "my.onnx", "--steps", "1")
    assert status == 1
    assert "more of the simulated non-gestures are accepted, expected 1 at most" in err
    assert "my.onnx: not written: " in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz"]
    head, *rows = out.splitlines()[1:6]
    assert max(map(len, (head, *rows))) <= 80
    for row in rows:  # no column runs into the next
        assert re.fullmatch(r"\w+ (before|after)(?: +(?:\d\.\d{3} \d\.\d\d-\d\.\d\d|-)){4}", row), row


def test_a_disk_without_room_for_the_model_takes_no_figures_away(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "my.onnx")

    class Better:
        def reasons(self) -> list[str]:
            return []

    for name in ("base_of", "own_recordings", "simulate", "_learned_from", "_facts"):
        monkeypatch.setattr(command, name, lambda *_: argparse.Namespace(teach=None))
    monkeypatch.setattr(command, "adapt", lambda *_: Better())
    monkeypatch.setattr(command, "_tell", lambda *_: print("right 0.9"))
    monkeypatch.setattr(command, "_write", full)
    said = "right 0.9\n", "gestured-lab: my.onnx: No space left on device\n"
    assert run("a.npz", "--cache", tmp_path, "--out", "my.onnx") == (1, *said)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("a.npz", "--out", "my.txt"), "--out: expected a file *.onnx, found my.txt"),
        (("a.npz", "--out", str(shipped()["lstm"])), "is a shipped model, which stays as it is"),
        (("a.npz", "--out", "my.onnx", "--base", "touch_pattern_rf"), "is not adaptable"),
        (("none.npz", "--out", "my.onnx"), "none.npz"),
    ],
)
def test_what_cannot_be_is_one_sentence_and_nothing_is_written(
    arguments: tuple[str, ...], reason: str, run: Run, tmp_path: Path
) -> None:
    write(tmp_path / "a.npz", cut_gestures(("07",), GESTURES[:2]))
    status, out, err = run(*arguments)
    assert (status, out) == (1, "")
    assert reason in err and err.startswith("gestured-lab: ") and err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz"]


def test_a_base_that_has_learned_from_a_recording_or_a_person_is_refused(run: Run, base: Path, tmp_path: Path) -> None:
    """Nobody could be held out of it; another person's recordings may go on from it."""
    made = cut_gestures(("07", "08"), GESTURES, repeats=2)
    write(tmp_path / "a.npz", made)
    write(tmp_path / "longer.npz", made.take(np.arange(len(made) - 1)))
    write(tmp_path / "later.npz", replace(made.take(np.arange(20, 40)), consents=np.full(20, "2026-02-15")))
    seventh = replace(made.take(np.arange(20)), subjects=np.full(20, 7), times=made.times[: made.offsets[20]] / 2)
    write(tmp_path / "seventh.npz", seventh)
    write(tmp_path / "others.npz", replace(made, subjects=np.char.add(made.subjects, "b")))
    taught, proto = tmp_path / "taught.onnx", onnx.load(base)
    entry = next(entry for entry in proto.metadata_props if entry.key == KEY)
    entry.value = json.dumps([*json.loads(entry.value), *origins([tmp_path / "a.npz"])])
    for entry in [entry for entry in proto.metadata_props if entry.key == "digest"]:
        proto.metadata_props.remove(entry)
    onnx.save(proto, taught)
    for name in ("a.npz", "longer.npz", "later.npz", "seventh.npz"):
        status, _, err = run(name, "--out", "my.onnx", "--base", taught, "--force")
        assert status == 1
        assert f"--base: taught has learned from a.npz, so that nobody in {name} can be held out" in err
    files = [origin["file"] for origin in command._learned_from(base_of(str(taught)), [tmp_path / "others.npz"])]
    assert files == ["old.npz", "a.npz", "others.npz"]


@pytest.mark.hostile
@pytest.mark.timeout(900)
def test_the_same_recordings_give_the_same_model(run: Run, tmp_path: Path) -> None:
    path = sluggish(tmp_path)
    for name in ("a.onnx", "b.onnx"):
        run(path, "--out", name, "--steps", "2", "--force")
    windows = np.random.default_rng(3).random((2, 20, 9, 9), np.float32)
    first, second = (open_model(tmp_path / name).run(windows)[0] for name in ("a.onnx", "b.onnx"))
    np.testing.assert_array_equal(first, second)
