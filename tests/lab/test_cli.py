"""`gestured-lab` at the command line: help, what is missing, what is wrong; and a whole run, smaller than --quick."""

import argparse
import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gestured.lab.cli import FOLDERS, LAB_PACKAGES, parser
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped
from gestured.record.arrays import write
from gestured.record.recordings import Recordings
from gestured.simulator import NON_GESTURES, Participant, SimulatedSensor, generator, gesture_take
from tests.lab.conftest import Run
from tests.small_recording import example

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = next(action.choices for action in parser()._actions if isinstance(action, argparse._SubParsersAction))


WITHOUT = """
import sys
packages, lines = sys.argv[1].split(","), sys.argv[2:]
sys.modules.update(dict.fromkeys(packages))
from gestured.lab.cli import main
for line in lines:
    try:
        status = main(line.split())
    except SystemExit as ended:
        status = ended.code
    if status:
        sys.exit(status)
"""


def without(package: str, *lines: str, cwd: Path) -> "subprocess.CompletedProcess[str]":
    """Lines of gestured-lab, until one fails, where `package` cannot be imported; or several, by commas."""
    command = [sys.executable, "-c", WITHOUT, package, *lines]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("everyday --recordings none.mcap", "gestured-lab: none.mcap: cannot be read: No such file or directory"),
        ("import --participant 07 --out a.npz none.csv", "gestured-lab: nothing could be imported"),
        ("forget 07 none.npz --yes", "none.npz"),
    ],
)
def test_hours_and_recordings_need_nothing_of_the_extra(line: str, says: str, tmp_path: Path) -> None:
    done = without(",".join(["scipy", *LAB_PACKAGES]), line, cwd=tmp_path)
    assert done.returncode == 1 and says in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize("package", LAB_PACKAGES)
def test_each_package_of_the_extra_is_named_where_it_is_missing(
    run: Run, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gestured.lab.cli.PROGRAMS", {"train": f"{package}.part"})
    monkeypatch.setitem(sys.modules, package, None)
    said = f"gestured-lab: {package} is missing: pip install 'gestured[lab]', or make lab\n"
    assert run("train") == (1, "", said)


def test_help_needs_no_torch_and_shows_an_example_that_is_valid(tmp_path: Path) -> None:
    done = without("torch", *(f"{command} --help" for command in COMMANDS), cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    _, *shown = " ".join(done.stdout.split()).split("usage: ")
    for command, text in zip(COMMANDS, shown, strict=True):
        example = text.split("example: gestured-lab ")[1].split()
        assert example[0] == command == parser().parse_args(example).command


@pytest.mark.parametrize(
    "line",
    [
        "",
        "fly",
        "train --jobs many",
        "train --epochs 3",
        "train --jobs 0",
        "everyday --hours 0",
        "adapt no.npz --out my.onnx --steps 0",
    ],
)
def test_arguments_that_mean_nothing_are_usage_errors(run: Run, line: str) -> None:
    status, _, err = run(*line.split())
    assert status == 2 and "usage: gestured-lab" in err


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        *((f"{command} --real nowhere", "--real: nowhere is no folder") for command in ("train", "evaluate", "study")),
        *((f"{line} nowhere/file.{end}", f"{line.split()[-1]}: expected a file in a folder that can be written to, "
           f"found nowhere/file.{end}")
          for line, end in (("everyday --recordings no.npz --svg", "svg"), ("adapt no.npz --out", "onnx"),
                            ("import no.csv --participant 07 --out", "npz"))),
        *((f"{command} --document no.md", f"--document: expected a page with the marks of `{block}`, found none in "
           "no.md")
          for command, block in (("everyday", "everyday"), ("evaluate", "figures"), ("stability", "filters"),
                                 ("study", "study"))),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("lab")
def test_what_no_command_can_work_with_is_named(
    run: Run, line: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    status, _, err = run(*line.split())
    assert (status, err) == (1, f"gestured-lab: {reason}\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "line",
    [
        *(f"{command} --{flag}" for command, flags in FOLDERS.items() if command not in ("adapt", "collect")
          for flag in flags),
        "adapt no.npz --out my.onnx --cache", "collect --participant 07 --out",
    ],
)  # fmt: skip
@pytest.mark.usefixtures("lab")
def test_a_folder_that_cannot_be_written_to_is_named_before_anything_is_simulated(
    run: Run, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "shut").mkdir()
    monkeypatch.setattr(os, "access", lambda path, _: Path(path).name != "shut")  # root may do everything
    flag = line.split()[-1]
    words = f"gestured-lab: {flag}: expected a folder that can be read and written, found "
    for folder in ("taken", "taken/new", "shut", "shut/new"):
        status, _, err = run(*line.split(), folder)
        assert (status, err) == (1, f"{words}{folder}\n")
    assert {path.name for path in tmp_path.iterdir()} == {"taken", "shut"}


@pytest.mark.parametrize(("name", "words"), [("study", "; what is finished is kept"), ("everyday", "")])
def test_an_interrupted_run_says_where_nothing_finished_is_lost(
    run: Run, name: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("gestured.lab.cli.import_module", lambda _: argparse.Namespace(run=interrupt))
    assert run(name) == (130, "", f"\ngestured-lab: interrupted{words}\n")


def test_a_reader_who_has_gone_ends_a_command_as_by_head(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(_: object) -> int:
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr("gestured.lab.cli.import_module", lambda _: argparse.Namespace(run=gone))
    assert run("everyday") == (0, "", "")


@pytest.fixture
def _usual_signals() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("_usual_signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_whoever_asks_for_the_end_waits_for_imports(run: Run, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    imported = []

    def importing(_: str) -> argparse.Namespace:
        os.kill(os.getpid(), number)
        imported.append("whole")
        return argparse.Namespace(run=lambda _: 0)

    monkeypatch.setattr("gestured.lab.cli.import_module", importing)
    assert run("everyday") == (130, "", "\ngestured-lab: interrupted\n") and imported == ["whole"]


@pytest.mark.usefixtures("lab")
def test_sigterm_ends_the_processes_that_were_started_too(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gestured.lab", "everyday", "--hours", "4", "--jobs", "2"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as lab:
        children = Path(f"/proc/{lab.pid}/task/{lab.pid}/children")
        while len(started := children.read_text().split()) < 3:  # the pool's two, and one that looks after both
            time.sleep(0.05)
        lab.terminate()
        assert lab.communicate(timeout=60)[1] == "\ngestured-lab: interrupted\n"
    assert lab.returncode == 130
    assert not [number for number in started[1:] if Path(f"/proc/{number}").exists()]


@pytest.mark.usefixtures("lab")
def test_a_log_on_a_full_disk_stops_nothing_and_a_terminal_need_not_have_all_letters(tmp_path: Path) -> None:
    take = gesture_take("swipe_left", Participant(901), SimulatedSensor.nominal(day=901), generator(3, 1))
    one = np.array([0, len(take.times)]), np.array(["session"]), np.array(["07"])
    write(tmp_path / "né\x1b.npz", Recordings(take.frames, take.times, *one))
    command = [sys.executable, "-m", "gestured.lab", "everyday", "lstm", "--jobs", "1", "--recordings"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "ascii"}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*command, tmp_path / "né\x1b.npz"], stdout=subprocess.PIPE, stderr=full, env=environment, text=True
        )
    assert done.returncode == 0
    assert "| n?\\x1b |" in done.stdout


@pytest.mark.usefixtures("lab")
def test_recordings_that_taught_other_models_are_not_evaluated(run: Run, tmp_path: Path) -> None:
    """The figures would be of networks that learned from these, and would stand in the models' cards."""
    write(tmp_path / "a.npz", example())
    models = shipped()["cnn_lstm"].parent
    status, _, err = run("evaluate", "--models", models, "--cache", tmp_path, "--recordings", tmp_path / "a.npz")
    assert (status, "--recordings: expected the files that cnn_lstm learned from (none);" in err) == (1, True)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.usefixtures("lab")
def test_train_makes_three_models_and_evaluate_their_figures(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Everything that `train` does, with a plan much smaller than --quick, in one process."""
    from gestured.lab import dataset, train
    from gestured.lab.dataset import OTHER_TRIALS, STREAMS, TRIALS
    from gestured.lab.fit import FitConfig
    from gestured.lab.own import learn
    from gestured.lab.samples import Samples, collect
    from tests.lab.test_own import drawn

    for module in (dataset, train):
        monkeypatch.setattr(module, "DAY_S", 90.0)
    monkeypatch.setattr(dataset, "in_processes", lambda make, todo, *_: map(make, todo))
    monkeypatch.setattr(learn, "played", lambda *_: drawn())
    monkeypatch.setattr(learn, "FOLDS", 2)
    monkeypatch.setattr(train, "FOLDS", 2)
    monkeypatch.setattr("gestured.lab.export.CHECKED_LENGTHS", (1, 15))
    spread = {"wide": range(20), "cohort": range(0, len(TRIALS), 122), "others": range(0, len(OTHER_TRIALS), 122)}
    spread |= {"days": range(1), "days_by_chance": range(1), "nominal_days": range(2)}
    made: dict[tuple[str, int], Samples] = {}

    def simulated(cache: Path, stream: str, seed: int, count: int, jobs: int = 2) -> Samples:
        if (stream, seed) not in made:
            made[stream, seed] = collect(s for i in spread[stream] for s in STREAMS[stream](seed, i))
        return made[stream, seed]

    taken = simulated(tmp_path, "wide", 4, 0)

    def real(folder: Path | None, recordings: Sequence[Path]) -> tuple[Samples, int]:
        subjects = np.arange(len(taken)) % 6
        return replace(taken, people=subjects), len(taken) - 10

    fit = FitConfig(epochs=1, real_epochs=1, real_samples=64)
    plan = train.TrainingPlan(20, 20, 20, others=80, days=1, days_points=2, forest=200, fit=fit)
    monkeypatch.setattr(train, "simulated", simulated)
    monkeypatch.setattr(train, "_real", real)
    monkeypatch.setattr(train.TrainingPlan, "quick", classmethod(lambda cls: plan))
    out, cache = tmp_path / "models", tmp_path / "cache"
    arguments = ("--cache", cache, "--jobs", 1, "--quick")

    status, _, err = run("train", "--out", out, *arguments)
    assert status == 0 and "trained in" in err
    manifest = json.loads((out / "manifest.json").read_text())["models"]
    assert sorted(manifest) == sorted(f"{name}.onnx" for name in LADDER)
    for name in LADDER:
        model = open_model(out / f"{name}.onnx")
        assert model.metadata.training_data == open_model(out / f"{LADDER[0]}.onnx").metadata.training_data
        assert manifest[f"{name}.onnx"]["figures"]["simulated"]
        assert name in "".join(card.read_text() for card in out.glob("*.md"))

    before = {path.name: path.read_bytes() for path in sorted(out.glob("*.onnx"))}
    for step in ("pretrain", "finetune"):
        monkeypatch.setattr(train, step, lambda *_: pytest.fail("what is done is not done again"))
    page = tmp_path / "figures.md"
    page.write_text("<!-- figures: begin -->\n<!-- figures: end -->\n")
    monkeypatch.setattr("gestured.lab.evaluate.FEWEST", 1)
    front = tmp_path / "README.md"
    front.write_text("<!-- worst: begin -->\n<!-- worst: end -->\n")
    status, said, _ = run("evaluate", "--models", out, *arguments, "--document", page, front, "--json")
    figures = json.loads(said)
    assert status == 0
    assert figures.keys() == set(LADDER)
    bought = "with non-gestures, learned from simulation alone"
    assert set(figures["cnn_lstm"]["real"]) >= {"taps and swipes", "with non-gestures", bought}
    assert f"real, {bought}" in page.read_text()
    asked = set(figures["cnn_lstm"]["simulated"]["wide"]["kinds"]) & set(NON_GESTURES)
    assert asked and asked <= set(re.findall(r"\w+", page.read_text()))  # the page names what each kind comes to
    told = figures["cnn_lstm"]["simulated"]["wide"]["worst"]
    assert told.keys() == {"gesture", "person", "non-gesture"}
    for name, share, count in told.values():
        assert all(f"{name} {share:.3f} of {count}" in one.read_text() for one in (page, front))
    assert {path.name: path.read_bytes() for path in sorted(out.glob("*.onnx"))} == before
