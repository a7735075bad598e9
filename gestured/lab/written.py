"""Texts that anybody may read, such as reports and pages: written at once or not at all."""

from pathlib import Path

from gestured.record.files import PUBLIC, atomic_write


def write(path: Path, text: str, *, durable: bool = True) -> None:
    """Put a text into the place of a file; whatever is raised, as of a full disk, leaves the file as it was."""
    with atomic_write(path, PUBLIC, durable=durable) as file:
        file.write(text.encode())
