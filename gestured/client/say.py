"""The printing of the programs: text that somebody else chose is shown, and never acts on the terminal.

Names come from packets, sockets and files, and may hold control sequences of terminals. So the programs print through
this module alone.
"""

import json
import sys
from contextlib import suppress
from typing import TextIO

from gestured.core.errors import GesturedError

MOST = 2000  # characters of a line at most; none of our own is longer, unless it has a long path


def shown(text: object, most: int = MOST) -> str:
    """Foreign text on one line of at most `most` printable characters; ordinary text is not changed.

    Control characters, line breaks, surrogates, and characters that are invisible or turn the direction of writing are
    escaped as in Python. The middle of a longer text is left out, so that its name and its reason stay.
    """
    told = str(text)
    if len(told) > 2 * most:
        told = told[:most] + told[-most:]
    if not told.isprintable():
        told = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in told)
    if len(told) > most:
        tail = (most - 1) // 2
        told = f"{told[: most - 1 - tail]}…{told[len(told) - tail :]}"
    return told


def say(*lines: object, to: TextIO | None = None) -> None:
    """Print lines for a person, each as `shown`; to standard output, or a stream such as sys.stderr."""
    say_drawn("\n".join(map(shown, lines)), to=to)


def say_json(value: object) -> None:
    """Print a value as one line of JSON, in ASCII; all other characters are escaped."""
    say_drawn(json.dumps(value))


def tell(as_json: bool, value: object, *lines: object) -> None:
    """Print a value as JSON, or the lines that say it in words."""
    if as_json:
        say_json(value)
    else:
        say(*lines)


def say_drawn(text: str, end: str = "\n", to: TextIO | None = None) -> None:
    """Print text with line breaks, colours or a picture; foreign text in it must have gone through `shown`.

    If standard error takes no more, such as a log on a full disk, nothing is raised. If standard output takes no more,
    this raises GesturedError, or BrokenPipeError if its reader has gone.
    """
    if to is not None and to is sys.stderr:
        with suppress(OSError):
            print(text, end=end, file=to, flush=True)
        return
    try:
        print(text, end=end, file=to or sys.stdout, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise GesturedError(f"standard output cannot be written: {error.strerror}") from None
