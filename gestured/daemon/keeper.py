"""The keeper of the file of the user's own gestures: only the first daemon that locks the file writes it."""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from gestured.core.own import Examples
from gestured.model import own_file
from gestured.model.own_file import OwnFile, OwnFileError
from gestured.record.files import PRIVATE, delete_leftovers

PID_DIGITS = 10  # of the process number in the lock, at most


class Keeper:
    """One path, what was found there, and the lock beside it from the first success of `hold` on.

    The lock is a file of its own, since each write replaces the file of gestures. One thread at a time may use a
    keeper.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.found = OwnFile(path, {})  # by `read`, or what was written since
        self.unkept: str | None = None  # why the lock was not had; None if it was, or was not tried
        self._lock: BinaryIO | None = None

    @property
    def fault(self) -> str | None:
        """Why the file cannot be read, or cannot be written; None if no fault is known."""
        return self.found.fault or self.unkept

    def read(self) -> None:
        """Read the file, and lock it if its folder exists; whoever enrols nothing needs no folder."""
        if self.path is not None and os.path.isdir(self.path.parent):  # Path.is_dir raises if we may not look
            try:
                self.hold()
            except OwnFileError as error:
                self.unkept = str(error)
        self.found = own_file.load(self.path, self.found)

    def hold(self) -> None:
        """Lock the file for this daemon. Raises OwnFileError, which names the daemon that holds it, or the fault.

        A lock that was deleted meanwhile, perhaps with its folder, is made anew. A link is refused: a write would
        replace it, and what was forgotten would stay in the file itself.
        """
        if self.path is None:
            raise OwnFileError(own_file.NO_FILE)
        place = self.path.with_name(f".{self.path.name}.lock")
        try:
            if os.path.islink(self.path):
                target = os.path.realpath(self.path)
                raise OwnFileError(f"{self.path}: is a link, expected the file itself, {target}; {own_file.REMEDY}")
            if self._lock is not None and os.path.exists(place):
                return
            self.close()
            self.path.parent.mkdir(0o700, parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
            lock = open(os.open(place, flags, PRIVATE), "r+b", buffering=0)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                pid = lock.read(PID_DIGITS)
                who = f"gestured (pid {int(pid)})" if pid.isdigit() else "gestured"
                remedy = "enrol and forget there, or give this one a file of its own (--own-gestures FILE)"
                raise OwnFileError(f"{self.path}: another {who} writes it; {remedy}") from None
            lock.truncate(0)
            lock.write(str(os.getpid()).encode())
        except OSError as error:
            raise OwnFileError(f"{self.path}: cannot be written: {error.strerror}; {own_file.REMEDY}") from error
        self._lock, self.unkept = lock, None
        delete_leftovers(self.path)

    def change(self, change: Callable[[Examples], Examples], model: str) -> None:
        """Write what `change` makes of the gestures that are in the file now.

        `model` is the digest of the model that answers. Raises OwnFileError, or what `change` raises.
        """
        self.hold()
        assert self.path is not None
        delete_leftovers(self.path)
        found = own_file.load(self.path, self.found)
        if found.fault is not None:
            raise OwnFileError(found.fault)
        self.found = own_file.write(self.path, change(found.gestures), model)

    def close(self) -> None:
        """Release the lock, so that another daemon may write the file."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None
