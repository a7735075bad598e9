"""The values on a command line, most of them for argparse's `type`: each is read, or refused in one sentence."""

import filecmp
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from gestured.client.address import named
from gestured.core.address import Address, Grid, is_sensor
from gestured.core.errors import GesturedError


def host_port(text: str) -> Address:
    """The address of a peer; port 0 is refused. Raises ArgumentTypeError, as all that read a text."""
    try:
        address = named(text)
        if address.port:
            return address
    except ValueError:
        pass  # the error below has an example
    raise ArgumentTypeError(f"{text!r}: expected HOST:PORT, such as 127.0.0.1:9000")


def bind_address(text: str) -> Address:
    """An address of our own, where port 0 means any free one."""
    try:
        return named(text)
    except ValueError as error:
        raise ArgumentTypeError(f"{text!r}: expected {error}") from None


def rows_by_columns(text: str) -> tuple[int, int]:
    """Rows and columns of a sensor."""
    try:
        return Grid.parse(text)
    except ValueError as error:
        raise ArgumentTypeError(f"{text!r}: expected {error}") from None


def sensor_name(text: str) -> str:
    """The name of a sensor."""
    if not is_sensor(text):
        raise ArgumentTypeError(f"{text!r}: expected 1 to 64 of A-Z a-z 0-9 _ -")
    return text


def npz(text: str) -> Path:
    """A file of recordings to write; `gestured-lab forget` finds it by its ending."""
    if (path := Path(text)).suffix != ".npz":  # this also keeps tapes from being overwritten
        raise ArgumentTypeError(f"{text!r}: expected a file *.npz")
    return path


def number(low: float, high: float, *, whole: bool = False) -> Callable[[str], float]:
    """A reader of numbers from `low` to `high`."""

    def read(text: str) -> float:
        try:
            value = int(text) if whole else float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            kind = "a whole number" if whole else "a number"
            raise ArgumentTypeError(f"{text!r}: expected {kind} from {low:g} to {high:g}")
        return value

    return read


def some_of(known: Sequence[str]) -> Callable[[str], list[str]]:
    """A reader of words with commas between them, each of them `known`."""

    def read(text: str) -> list[str]:
        words = [word.strip() for word in text.split(",") if word.strip()]
        unknown = [word for word in words if word not in known]
        if unknown or not words:
            raise ArgumentTypeError(f"{', '.join(unknown) or repr(text)}: expected some of {', '.join(known)}")
        return words

    return read


def each_once(paths: Iterable[Path]) -> None:
    """Raise GesturedError if a file is named twice, or its copy is: its hours would count twice."""
    sized: dict[int, list[Path]] = {}
    for path in paths:
        size = path.stat().st_size if path.is_file() else -1
        for first in sized.setdefault(size, []):
            twice = first.resolve() == path.resolve()
            with suppress(OSError):  # whoever reads the file says what is wrong with it
                twice = twice or filecmp.cmp(first, path, shallow=False)
            if twice:
                raise GesturedError(f"{path}: expected each file once, found it as {first}, too")
        sized[size].append(path)
