"""What `--explain` says of the file of own gestures, and of what each strictness costs."""

from pathlib import Path

import numpy as np
import pytest

from gestured.core.own import Example
from gestured.daemon.explain import explain
from gestured.model import own_file
from gestured.model.opening import open_model
from tests.daemon import tiny_model
from tests.daemon.parts import settings_of
from tests.small_model import operating_points


def test_the_file_of_own_gestures_is_said_and_why_the_daemon_goes_on_without_one(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    able = tiny_model.make(tmp_path / "tiny.onnx", own=tiny_model.own())

    def explained(*flags: object, model: Path = able) -> str:
        return explain(*settings_of("--model", model, *flags))

    path = tmp_path / "missing" / "own.json"
    assert "own gestures: tiny has no embedding" in explained("--own-gestures", path, model=model)
    assert f"own gestures (none yet), in {path}" in explained("--own-gestures", path)
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    assert f"own gestures (none yet), in {tmp_path}/own-gestures.json" in explained()
    example = Example(np.zeros((4, 9, 9), np.float16), 15.0, 0, 3, 0.1)
    own_file.write(tmp_path / "own-gestures.json", {"knock": (example,)}, "")
    assert "own gestures knock, in" in explained()
    (tmp_path / "own-gestures.json").write_text("no JSON")
    for wrong, words in (
        (tmp_path, "cannot be read: Is a directory"),
        (model / "own.json", "cannot be read: Not a directory"),
        (tmp_path / "own-gestures.json", "is no file of own gestures"),
    ):
        assert f"  own gestures: {wrong}: {words}" in explained("--own-gestures", wrong)
    for name in ("STATE_DIRECTORY", "XDG_STATE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    assert "own gestures: there is no file for own gestures, since there is no home" in explained()


def test_a_fallback_is_in_use_only_if_it_answers_and_none_if_it_cannot(model: Path, tmp_path: Path) -> None:
    other = tiny_model.make(tmp_path / "other.onnx", gestures=tiny_model.GESTURES[::-1])
    mine = tiny_model.make(tmp_path / "mine.onnx")
    flags = ("--model", mine, "--fallback", other, "--fallback", model)
    assert "falls back on:\n  tiny\n\n" in (said := explain(*settings_of(*flags)))
    assert "  other could not be used: other: cannot stand in for mine, expected the same gestures" in said
    mine.write_bytes(b"damaged")
    assert "falls back on:\n  other, in use\n\n" in explain(*settings_of(*flags))


def test_what_each_strictness_costs_is_said_for_each_rung_and_what_holds_before_it(model: Path, tmp_path: Path) -> None:
    points = operating_points(tiny_model.GESTURES)
    path = tiny_model.make(tmp_path / "mine.onnx", operating_points=points)
    config = tmp_path / "gestured.toml"
    config.write_text('strictness = "eager"\n[sensors.arm]\nstrictness = "strict"\n[gestures.one_tap]\nthreshold = 0.8')
    flags = ("--model", path, "--fallback", model, "--config", config)
    said = explain(*settings_of(*flags, env={"GESTURED_STRICTNESS": "normal"}))
    lines = [line.strip() for line in said.split("thresholds:\n")[1].split("\n\n")[0].splitlines()]
    assert lines == [
        "strictness normal, arm strict",
        "mine eager: 3.0 % missed, 2.8 false an hour, in the 12 hours on which it was chosen",
        "mine normal: 6.0 % missed, 1.6 false an hour, in the 12 hours on which it was chosen",
        "mine strict: 9.0 % missed, 0.4 false an hour, in the 12 hours on which it was chosen",
        f"{model.stem} has no operating points: 0.50 for all, whatever the strictness",
        "before these, thresholds of [gestures]: one_tap 0.8",
    ]
    assert "strictness eager, arm strict" in explain(*settings_of(*flags))
    assert "strictness strict, arm strict" in explain(*settings_of(*flags, "--strictness", "strict"))
    config.write_text('[arming]\nby = "double_tap"')
    (line,) = [
        line.strip() for line in explain(*settings_of(*flags)).splitlines() if "after a gesture that arms" in line
    ]
    assert line == f"mine, after a gesture that arms: {open_model(path).threshold:.2f} at most, whatever the strictness"
