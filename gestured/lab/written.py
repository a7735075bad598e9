"""What anybody may read, such as reports, pages, models and what is kept: written at once or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from gestured.record.files import PUBLIC, atomic_write


@contextmanager
def replaced(path: Path, *, durable: bool = True) -> Iterator[BinaryIO]:
    """What is written takes the place of a file. OSError, as of a full disk, names the file, which is as it was."""
    try:
        with atomic_write(path, PUBLIC, durable=durable) as file:
            yield file
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def write(path: Path, content: str | bytes, *, durable: bool = True) -> None:
    """Put a content into the place of a file, as `replaced` does."""
    with replaced(path, durable=durable) as file:
        file.write(content.encode() if isinstance(content, str) else content)
