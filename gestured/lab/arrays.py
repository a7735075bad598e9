"""Arrays that are kept from one run to the next, without pickles; a damaged file counts as missing."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.lab.written import replaced


def load(path: Path) -> dict[str, NDArray[Any]] | None:
    """The arrays of a file by name; None if it is missing or damaged, so that it is made again."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return dict(stored)
    except (FileNotFoundError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def save(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write a file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
