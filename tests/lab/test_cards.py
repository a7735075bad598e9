"""What a model's card says of the recordings that it learned from, and of those that judged it."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from gestured.lab.cards import row, write_cards
from gestured.lab.evaluate import outcome
from gestured.lab.export import plain
from gestured.lab.train import REAL_FILES, TrainingPlan
from tests.small_model import build

PUBLIC, OWN = REAL_FILES[0], "mine.npz"


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ([], "and no real recordings."),
        ([OWN], "and recordings of one's own (mine.npz)."),
        ([PUBLIC], "and the real development recordings of CapFingerId (ten subjects; MIT licence, see NOTICE)."),
        ([PUBLIC, OWN], "MIT licence, see NOTICE) and recordings of one's own (mine.npz)."),
    ],
)
def test_a_card_names_the_recordings_and_no_others(tmp_path: Path, files: list[str], words: str) -> None:
    origins = [{"file": file, "sha256": "0" * 64, "subjects": ["07"]} for file in files]
    build(tmp_path / "cnn_lstm.onnx", learned_from=json.dumps(origins))
    write_cards(tmp_path, {"cnn_lstm": {"simulated": {}}}, TrainingPlan())
    card = (tmp_path / "cnn_lstm.md").read_text()
    assert words in card
    assert ("CapFingerId" in card) == (PUBLIC in files)
    assert ("no textile recording was at hand" in card) == (files == [PUBLIC])
    assert ("Circles and two-finger swipes are simulated only" in card) == (OWN not in files)


def test_where_nobody_performed_what_is_judged_there_is_a_dash() -> None:
    """Such as taps and swipes, in recordings of circles alone; figures that were kept have null for NaN."""
    nothing = np.zeros((0, 10), np.float32), np.zeros(0, np.float32)
    found = asdict(outcome(nothing, np.zeros(0, np.int64), 0.5, 0, np.zeros(0, np.int64)))
    assert row("taps", found) == row("taps", plain(found)) == "| taps | 0 | - | - | - | - | 0 | - |"
