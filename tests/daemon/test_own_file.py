"""The file of the user's own gestures: what of it is read, and who writes it."""

from pathlib import Path

import numpy as np

from gestured.core.own import MOST, MOST_VALUES, Example
from gestured.core.prototypes import EXAMPLES
from gestured.model import own_file


def example(frames: int = 4) -> Example:
    return Example(np.zeros((frames, 9, 9), np.float16), 15.0, 0, 3, 0.1)


def test_the_largest_file_that_can_be_enrolled_is_read_again(tmp_path: Path) -> None:
    longest = Example(np.zeros((64, 16, 16), np.float16), 15.0, 0, 63, 0.1)
    assert longest.frames.size == MOST_VALUES
    path = tmp_path / "own.json"
    own_file.write(path, {f"{k:a<32}": (longest,) * EXAMPLES for k in map(chr, range(97, 97 + MOST))}, "0" * 64)
    found = own_file.load(path)
    assert (found.fault, len(found.gestures)) == (None, MOST)


def test_millions_of_empty_lists_are_not_handed_to_the_reader_of_json(tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    path.write_text('{"format": 1, "gestures": [' + "[]," * 2_700_000 + "[]]}")
    fault = own_file.load(path).fault
    assert fault is not None
    assert "expected at most 4096 brackets and commas" in fault
