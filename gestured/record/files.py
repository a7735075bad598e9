"""Files: written whole or not at all, and opened without trust in what is at a path."""

import errno
import glob
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

PRIVATE = 0o600  # for data about people: how somebody touches things is personal
PUBLIC = 0o644  # for files that anybody may read, less the umask: models, figures, caches of simulated people

NOT_REGULAR = "is not a regular file"
NAME_BYTES = 8  # random bytes in the name of a file that is not complete yet


def create(path: Path, mode: int = PRIVATE) -> BinaryIO:
    """A new file to write to, with `mode` (less the umask) from the start. Raises OSError if anything is at `path`.

    No link is followed, so that nobody can redirect what is written.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    return open(os.open(path, flags, mode), "wb")


@contextmanager
def atomic_write(path: Path, mode: int = PRIVATE, *, durable: bool = True) -> Iterator[BinaryIO]:
    """A file to write to, which replaces `path` once it is complete; if anything is raised, `path` stays as it was.

    It is written beside `path` under a name that nobody can foresee. If it is `durable`, it survives a power cut once
    this returns; a file that can be made again, such as a cache, need not be. Raises OSError, also if `path` is a
    device or a pipe, which would be replaced: by root even /dev/null.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, NOT_REGULAR, str(path))
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(NAME_BYTES)}")
    file = create(temporary, mode)
    try:
        with file:
            yield file
            file.flush()
            if durable:
                os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
    if durable:
        _sync_folder(path.parent)


def delete_leftovers(path: Path) -> None:
    """Delete incomplete files that killed writers of `path` have left beside it; nobody may be writing it now."""
    with suppress(OSError):
        for left in path.parent.glob(f".{glob.escape(path.name)}.{'[0-9a-f]' * (2 * NAME_BYTES)}"):
            left.unlink()


def _sync_folder(folder: Path) -> None:
    """Put the changed names in a folder onto the disk, if its file system can do that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def open_regular(path: str | Path) -> BinaryIO:
    """A regular file to read from. Raises OSError for anything else, without waiting for a pipe's other end."""
    try:
        file = open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK | os.O_NOCTTY))
    except ValueError as error:  # a path with a NUL
        raise OSError(errno.EINVAL, str(error), str(path)) from error
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, NOT_REGULAR, str(path))
    return file
