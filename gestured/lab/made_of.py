"""What a generated table was made of: one line above it with its command and digests.

The digests are of models and files, and of the code on which the table depends. A test compares the line with the files
of the checkout, so that no table outlives its models. If the table stands between marks of its own, the line also holds
its digest, which finds figures edited by hand.
"""

import hashlib
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path

from gestured.core.errors import GesturedError
from gestured.lab.digest import code_digest, file_digest
from gestured.lab.written import write

SHOWN = 12  # digits of a SHA-256 that are written: no two files of a project share them
LINE = re.compile(
    r"<!-- made by `([^`]+)`(?: of ((?:\S+ [0-9a-f]{12}(?:, )?)+))?"
    r"(?:; code (?P<code>[0-9a-f]{12})(?: of (?P<modules>[\w. ]+))?)?(?:; block [0-9a-f]{12})? -->"
)
# DECIDES: modules that decide which gesture a sensor's frames become. CARRIES: modules that carry frames, open files or
# describe answers; they are set aside, since they change often, and change no decision.
DECIDES = ("gestured.core.sensor", "gestured.model.model")
CARRIES = frozenset((
    "gestured.core.address", "gestured.core.events", "gestured.core.osc", "gestured.core.owner", "gestured.core.wire",
    "gestured.core.where",
    "gestured.core.beside.habits", "gestured.core.beside.reading", "gestured.core.beside.touch",
    "gestured.model.file", "gestured.model.limit",
))  # fmt: skip
OLDER = "**Made with models that no longer ship, or with older code; to be made again.**"  # stands below such a line


def made_of(command: str, files: Iterable[Path], code: Sequence[str] = DECIDES) -> str:
    """The line of a table that `command` prints of these files; `code`: the modules on which the table depends."""
    of = ", ".join(f"{name} {digest}" for name, digest in digests(files).items())
    modules = "" if code == DECIDES else f" of {' '.join(code)}"
    return f"<!-- made by `{command}`{of and f' of {of}'}; code {decides(tuple(code))}{modules} -->"


def command_of(words: Sequence[str]) -> str:
    """A command as a page names it, without the folders and the number of cores of the machine that ran it."""
    left, found = iter(words), list[str]()
    for word in left:
        if word in ("--cache", "--jobs", "--real"):
            next(left, None)
            found += ["--real", "FOLDER"] if word == "--real" else []
        else:
            found.append(word)
    return shlex.join(found)


@cache
def decides(code: tuple[str, ...] = DECIDES) -> str:
    """The digest of the code that decides, by default from frames to gestures, as a line holds it."""
    aside = CARRIES if code == DECIDES else frozenset[str]()
    return hashlib.sha256("".join(code_digest(module, aside) for module in code).encode()).hexdigest()[:SHOWN]


def other_code(line: re.Match[str]) -> bool:
    """Whether the code on which a table depends has changed since its `LINE`."""
    modules = line["modules"]
    return bool(line["code"] != (decides(tuple(modules.split())) if modules else decides()))


def renew(document: Path, name: str, lines: Iterable[str]) -> None:
    """Put these lines between the marks `name: begin` and `name: end` of a document.

    A line that `made_of` gave gets the digest of the others. Raises GesturedError if a mark is missing, or if a table
    would lose rows, since then an argument is missing; a table that is to shrink must be emptied first.
    """
    begin, end = _marks(name)
    text = document.read_text()
    if text.count(begin) != 1 or text.count(end) != 1:
        raise GesturedError(f"{document}: expected the marks {begin} and {end} once each")
    made = signed("\n".join(lines).splitlines())
    before, now = (sum(line.startswith("|") for line in some) for some in (kept(document, name).splitlines(), made))
    if now < before:
        raise GesturedError(
            f"{document}: the block {name} has {before} rows of tables, and {now} would replace them; is an argument "
            "missing, such as --real? Nothing was written"
        )
    block = "\n".join([begin, *made, end])
    write(document, text[: text.index(begin)] + block + text[text.index(end) + len(end) :])


def require_marks(name: str, *pages: Path | None) -> None:
    """Raise GesturedError, before hours of work, for a page without the marks that `renew` needs; None is no page."""
    for page in pages:
        if page is not None and not kept(page, name):
            raise GesturedError(f"--document: expected a page with the marks of `{name}`, found none in {page}")


def signed(lines: list[str]) -> list[str]:
    """The lines of a block, with the digest of the others in the line that `made_of` gave."""
    at = next((n for n, line in enumerate(lines) if LINE.fullmatch(line)), None)
    if at is None:
        return lines
    digest = hashlib.sha256("\n".join(lines[:at] + lines[at + 1 :]).encode()).hexdigest()[:SHOWN]
    line = re.sub(r"(?:; block [0-9a-f]{12})? -->$", f"; block {digest} -->", lines[at])
    return [*lines[:at], line, *lines[at + 1 :]]


def kept(document: Path, name: str) -> str:
    """The text of a document from the mark `name: begin` to `name: end`, with both; empty if it has none."""
    begin, end = _marks(name)
    text = document.read_text() if document.exists() else ""
    return text[text.index(begin) : text.index(end) + len(end)] if begin in text and end in text else ""


def _marks(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def digests(files: Iterable[Path]) -> dict[str, str]:
    """The digests of files as a line holds them, by name."""
    return {path.name: file_digest(path)[:SHOWN] for path in files}


def others(line: re.Match[str], now: Mapping[str, str]) -> list[str]:
    """The names of the files of a `LINE` whose digests differ from those of `now`."""
    named = (part.split() for part in (line[2] or "").split(", ") if part)
    return [name for name, digest in named if now.get(name) != digest]
