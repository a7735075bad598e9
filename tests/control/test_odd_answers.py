"""Answers on a control socket that no daemon of this version gives: one sentence, and no traceback."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.sockets import FakeDaemon

Told = Callable[..., tuple[int, str, str]]
EMPTY = {"ok": True}
WRONG = {"ok": True, "ready": 1, "sensors": [], "addresses": 3, "own": [], "epoch_ns": "soon"}


@pytest.mark.parametrize("answer", [EMPTY, WRONG], ids=["empty", "wrong"])
@pytest.mark.parametrize(
    "command",
    [
        "status", "status --json", "inhibit --all --gate door", "allow --all --gate door", "gestures", "forget knock",
        "reload", "emit swipe_left", "sniff --seconds 0.2",
    ],
)  # fmt: skip
def test_an_answer_without_what_is_read_is_one_sentence(
    told: Told, fake: FakeDaemon, command: str, answer: dict[str, object]
) -> None:
    status, out, err = told([answer], *command.split(), "--control", fake.path)
    assert (status, out) == (1, "")
    assert err.startswith("gesturectl: ") and err.count("\n") == 1 and len(err) < 400


@pytest.mark.parametrize("answer", [EMPTY, WRONG], ids=["empty", "wrong"])
def test_doctor_finds_it(told: Told, fake: FakeDaemon, answer: dict[str, object]) -> None:
    status, out, err = told([answer], "doctor", "--control", fake.path)
    assert (status, err) == (1, "")
    assert f"bad     {fake.path} says something that gestured " in out


@pytest.mark.parametrize(
    "said", [[EMPTY], [WRONG, {"type": "packet"}], [{"ok": True, "epoch_ns": 0}, {"type": "packet", "t_ns": 10**30}]]
)
def test_a_tap_without_what_is_kept_ends_the_recording(
    told: Told, fake: FakeDaemon, tmp_path: Path, said: list[object]
) -> None:
    status, out, err = told(said, "record", tmp_path / "x.mcap", "--control", fake.path)
    assert (status, out) == (1, "")
    assert "says something that gestured " in err and "Traceback" not in err
