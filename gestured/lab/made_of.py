"""What a generated table was made of: one line above it with its command and the digests of models and files.

A test compares the line with the files of the checkout, so that no table outlives the models that it speaks of.
"""

import re
from collections.abc import Iterable
from pathlib import Path

from gestured.core.errors import GesturedError
from gestured.lab.digest import file_digest

SHOWN = 12  # digits of a SHA-256 that are written: no two files of a project share them
LINE = re.compile(r"<!-- made by `([^`]+)` of ((?:\S+ [0-9a-f]{12}(?:, )?)+) -->")
OLDER = "**Made with models that no longer ship, or with older code; to be made again.**"  # stands below such a line


def made_of(command: str, files: Iterable[Path]) -> str:
    """The line, for a table that `command` prints of these files."""
    return f"<!-- made by `{command}` of {', '.join(f'{p.name} {file_digest(p)[:SHOWN]}' for p in files)} -->"


def renew(document: Path, name: str, lines: Iterable[str]) -> None:
    """Put these lines between the marks `name: begin` and `name: end` of a document. GesturedError without them."""
    begin, end = _marks(name)
    text = document.read_text()
    if text.count(begin) != 1 or text.count(end) != 1:
        raise GesturedError(f"{document}: expected the marks {begin} and {end} once each")
    block = "\n".join([begin, *lines, end])
    document.write_text(text[: text.index(begin)] + block + text[text.index(end) + len(end) :])


def kept(document: Path, name: str) -> str:
    """What a document says between the marks `name: begin` and `name: end`, with them; empty where it has none."""
    begin, end = _marks(name)
    text = document.read_text() if document.exists() else ""
    return text[text.index(begin) : text.index(end) + len(end)] if begin in text and end in text else ""


def _marks(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def stale(text: str, files: Iterable[Path]) -> list[str]:
    """Of the lines in a text those that name another file than these, and do not say so (`OLDER`), in words."""
    now = {path.name: file_digest(path)[:SHOWN] for path in files}
    lines, found = text.splitlines(), []
    for number, line in enumerate(lines):
        match = LINE.fullmatch(line.strip())
        if match is None or OLDER in lines[number + 1 : number + 3]:
            continue
        for name, digest in (part.split() for part in match[2].split(", ")):
            if now.get(name) != digest:
                found.append(f"line {number + 1}: `{match[1]}` was made of another {name} ({digest}); run it again")
    return found
