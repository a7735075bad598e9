"""What a model's card says of the recordings that it learned from."""

import json
from pathlib import Path

import pytest

from gestured.lab.cards import write_cards
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
