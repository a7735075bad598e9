"""Text files to import that are small and want to be large, or are no text at all."""

from pathlib import Path

import pytest

from tests.opening import in_bounds, refused

MIB = 128


def test_one_line_of_gigabytes_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with path.open("wb") as file:
        file.write(b"1,2,3\n")
        file.truncate(6 << 30)
    reason, mib = in_bounds("csv", path, MIB)
    assert "line 2: expected at most" in reason and mib < 32


def test_a_file_of_nothing_but_bad_lines_is_given_up(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("x\n" * (4 << 20))
    reason, mib = in_bounds("csv", path, MIB)
    assert "expected frames" in reason and mib < 64


def test_frames_of_a_text_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gestured.lab.recordings import importing

    path = tmp_path / "a.csv"
    path.write_text("".join(f"{k}," + ",".join("0" * 9) + "\n" for k in range(100)))
    monkeypatch.setattr(importing, "NUMBERS", 500)
    assert "expected at most 500 numbers" in refused("csv", path)


def test_numbers_take_eight_bytes_each(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with path.open("w") as file:
        for k in range(500):
            file.write(f"{k / 100}" + ",0" * 4095 + f",{k % 7}\n")
    reason, mib = in_bounds("wide", path, MIB)
    assert reason == "" and mib < 48  # as Python's own numbers they would take 64


LINE = "1,2,3,4,5,6,7,8,9"


@pytest.mark.parametrize(
    "lines",
    [
        [f"{k},{'1e308,' * 8}{'-' * (k % 2)}1e308" for k in range(40)],
        [f"{k}e300,{LINE}" for k in range(40)],
        [f"-1e308,{LINE}", f"1e308,{LINE}", f"1.1e308,{LINE}"],
        [f"{k},{'9' * 400},{LINE[2:]}" for k in range(40)],
    ],
    ids=["huge counts", "huge times", "far apart", "long numbers"],
)
def test_numbers_beyond_what_a_frame_can_hold_are_no_frames(tmp_path: Path, lines: list[str]) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    assert "expected" in refused("csv", path)
