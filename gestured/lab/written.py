"""What anybody may read, such as reports, pages and models: written at once or not at all."""

from pathlib import Path

from gestured.record.files import PUBLIC, atomic_write


def write(path: Path, content: str | bytes, *, durable: bool = True) -> None:
    """Put a content into the place of a file. OSError, as of a full disk, names the file, which is as it was."""
    try:
        with atomic_write(path, PUBLIC, durable=durable) as file:
            file.write(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
