"""A training is its seed: the same again is the same to the last bit, and another seed is another network."""

from typing import Any

import pytest

from gestured.lab.stability.seeds import seeds_table


def test_the_same_seed_is_the_same_network_and_another_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    rows: list[Any] = seeds_table(20, 1).rows
    for net in ("cnn_lstm", "lstm", "trajectory"):
        first, again, smaller, *others = [row for row in rows if row[0] == net]
        assert first[2] == again[2] == 0.0
        assert smaller[2] < min(other[2] for other in others)
