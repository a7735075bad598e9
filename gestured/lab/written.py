"""Files that anybody may read, such as reports, pages, models and caches, whole or not at all; and figures printed.

Arrays are kept from one run to the next, without pickles; a damaged file counts as missing.
"""

import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gestured.client.say import say_drawn
from gestured.record.files import PUBLIC, atomic_write


@contextmanager
def replaced(path: Path, *, durable: bool = True) -> Iterator[BinaryIO]:
    """Replace a file by what is written. An OSError, such as of a full disk, names the file and leaves it as it was."""
    try:
        with atomic_write(path, PUBLIC, durable=durable) as file:
            yield file
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def write(path: Path, content: str | bytes, *, durable: bool = True) -> None:
    """Replace a file by `content`, as `replaced` does."""
    with replaced(path, durable=durable) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def printed(text: str) -> None:
    """Print figures; if their reader has gone, as `head` does, files are written all the same."""
    with suppress(BrokenPipeError):
        say_drawn(text)


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
