"""The examples in the documents, and how each is held to the truth: by a mark in the line above it.

<!-- run: here -->           a test in tests/documents runs it
<!-- run: container -->      `make system-test` runs it in a booted container, in the document's order
<!-- run: FILE::NAME -->     that test runs it
<!-- checked: WHAT -->       a test in tests/documents checks it without running it
<!-- not run: REASON -->     nobody does
"""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LANGUAGES = ("sh", "python", "c", "cpp", "json", "toml", "js")
FENCE = re.compile(r"^(?:<!-- (run|checked|not run): (.+?) -->\n)?```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """One example."""

    document: str
    line: int
    kind: str  # run, checked, not run; empty where there is no mark
    words: str
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.document}:{self.line}"


def documents() -> list[Path]:
    """All that a user reads."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]


def blocks(kind: str = "", words: str = "", document: str = "") -> list[Block]:
    """The examples, in order; those with a mark or of a document, where one is named."""
    found = []
    for path in documents():
        text = path.read_text()
        name = str(path.relative_to(ROOT))
        for match in FENCE.finditer(text):
            if match[3] in LANGUAGES:
                line = text.count("\n", 0, match.start()) + 1
                found.append(Block(name, line, match[1] or "", match[2] or "", match[3], match[4]))
    return [
        block
        for block in found
        if (not kind or block.kind == kind)
        and (not words or block.words == words)
        and (not document or block.document == document)
    ]
