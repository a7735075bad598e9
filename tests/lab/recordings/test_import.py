"""`gestured-lab import`: what was written is read, and what is no frame is told with its line."""

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from gestured.record.arrays import read
from gestured.simulator import Participant, SimulatedSensor, Take, generator, gesture_take
from tests.lab.conftest import Run


def take(gesture: str = "swipe_left") -> Take:
    return gesture_take(gesture, Participant(901), SimulatedSensor.nominal(day=901), generator(3, 1), "normal", 1)


def csv_lines(made: Take, scale: float = 1.0) -> list[str]:
    rows = zip(made.times.tolist(), made.frames.reshape(len(made.frames), -1).tolist(), strict=True)
    return [",".join(map(repr, [t * scale, *values])) for t, values in rows]


def written(path: Path, lines: Sequence[str]) -> str:
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@pytest.fixture
def imports(run: Run) -> Run:
    """`gestured-lab import`: exit status, standard output, standard error."""
    return partial(run, "import")


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e3), ("us", 1e6)])
def test_a_csv_file_is_read_as_it_was_written(unit: str, scale: float, tmp_path: Path, imports: Run) -> None:
    made, out = take(), tmp_path / "out.npz"
    file = written(tmp_path / "a.csv", ["time," + ",".join(f"t{k}" for k in range(81)), *csv_lines(made, scale)])
    flags = ("--participant", "07", "--label", "swipe_left", "--time-unit", unit)
    status, text, _ = imports(*flags, "--consent", "2026-01-31", file, "--out", out)
    assert (status, text) == (0, f"{out}: 1 recordings, {len(made.frames)} frames; left out: 0 files, 0 lines\n")
    found = read(out)
    np.testing.assert_array_equal(found.frames, made.frames)
    np.testing.assert_allclose(found.times, made.times - made.times[0], atol=1e-9)
    assert (found.labels[0], found.subjects[0], found.consents[0]) == ("swipe_left", "07", "2026-01-31")
    event = made.events[0]
    assert abs(made.times[found.onsets[0]] - event.onset_s) < 0.15
    assert abs(made.times[found.releases[0]] - event.offset_s) < 0.15


def test_semicolons_and_decimal_commas_are_read_too(tmp_path: Path, imports: Run) -> None:
    """As a spreadsheet writes them where numbers have decimal commas."""
    made, out = take(), tmp_path / "out.npz"
    heading = "time;" + ";".join(f"t{k}" for k in range(81))
    lines = [line.replace(",", ";").replace(".", ",") for line in csv_lines(made)]
    assert imports("--participant", "07", written(tmp_path / "a.csv", [heading, *lines]), "--out", out)[0] == 0
    np.testing.assert_array_equal(read(out).frames, made.frames)
    np.testing.assert_allclose(read(out).times, made.times - made.times[0], atol=1e-9)


BAD = {
    "too few": ("1.0,2,3", "line: expected 82 numbers, found 3"),
    "a word": ("1.0," + ",".join(["x"] * 81), "number 2: expected a finite number, found 'x'"),
    "not finite": ("1.0," + ",".join(["nan"] * 81), "number 2: expected a finite number, found 'nan'"),
    "back": ("0.0," + ",".join(["0"] * 81), "time: expected later than"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_line_is_left_out_and_told(kind: str, tmp_path: Path, imports: Run) -> None:
    bad, reason = BAD[kind]
    made, out = take(), tmp_path / "out.npz"
    lines = csv_lines(made)
    file = written(tmp_path / "a.csv", [*lines[:7], bad, *lines[7:]])
    status, text, _ = imports("--participant", "07", file, "--out", out)
    first, last = text.splitlines()
    assert status == 0
    assert first.startswith(f"{file}: line 8 is left out: {reason}")
    assert last.endswith("left out: 0 files, 1 lines")
    np.testing.assert_array_equal(read(out).frames, made.frames)


@pytest.mark.parametrize(("scale", "unit", "rate"), [(1e3, "s", "0.0"), (1.0, "ms", "1.")])
def test_times_in_another_unit_are_refused_though_frames_were_lost(
    scale: float, unit: str, rate: str, tmp_path: Path, imports: Run
) -> None:
    lines = csv_lines(take(), scale)
    file = written(tmp_path / "a.csv", lines[:5] + lines[9:])
    status, text, _ = imports("--participant", "07", "--time-unit", unit, file, "--out", tmp_path / "out.npz")
    assert status == 1
    assert text.startswith(f"{file}: time: expected 2 to 2500 frames a second, found {rate}")
    assert text.endswith("; see --time-unit\n")


def test_a_file_of_another_form_is_refused_and_the_others_are_taken(tmp_path: Path, imports: Run) -> None:
    good = written(tmp_path / "good.csv", csv_lines(take()))
    other = written(tmp_path / "other.csv", ["1 2 3"] * 50)
    idle = take()
    still = written(tmp_path / "still.csv", csv_lines(idle)[:8])
    out = tmp_path / "out.npz"
    flags = ("--participant", "07", "--label", "swipe_left", "--json")
    status, figures, text = imports(*flags, good, other, still, "--out", out)
    first, second = text.splitlines()
    assert status == 0
    assert first.startswith(f"{other}: expected frames, found 0 and 49 lines that are none; line: expected 82 numbers")
    assert second == f"{still}: frames: expected one swipe_left with untouched frames before or after it"
    assert json.loads(figures) == {
        "recordings": 1, "frames": len(idle.frames), "lines_left_out": 0, "files_left_out": 2,
    }  # fmt: skip


def test_where_nothing_is_good_nothing_is_written(tmp_path: Path, imports: Run) -> None:
    out = tmp_path / "out.npz"
    flags = ("--participant", "07")
    status, text, err = imports(*flags, tmp_path / "none.csv", "--out", out)
    assert (status, text) == (1, f"{tmp_path / 'none.csv'}: cannot be read: No such file or directory\n")
    assert "nothing could be imported" in err
    good = written(tmp_path / "good.csv", csv_lines(take()))
    status, text, err = imports(*flags, good, good, "--out", out)
    assert (status, text) == (1, "") and "good.csv: expected each file once" in err
    assert not out.exists()
    out.write_text("somebody's")
    assert imports(*flags, written(tmp_path / "a.csv", csv_lines(take())), "--out", out)[0] == 1
    assert out.read_text() == "somebody's"


@pytest.mark.parametrize(
    "flags", [("--participant", "Anna Meier"), ("--label", "swipe_lft"), ("--consent", "May"), ("--out", "b")]
)
def test_flags_are_checked(flags: tuple[str, str], tmp_path: Path, imports: Run) -> None:
    status, _, err = imports("--participant", "07", "a.csv", "--out", tmp_path / "b.npz", *flags)
    assert status == 2 and "expected" in err
