"""Each example says how it is held to the truth, its commands exist, and links lead somewhere."""

import re
import shlex
from pathlib import Path

from tests.documents.blocks import ROOT, Block, blocks, documents
from tests.programs import PARSERS, subcommands

CHECKED = {
    "the schema",  # these three by test_formats.py
    "the daemon's own parser",
    "gestured --explain",
    "the command line",  # below: its programs take it
}
TARGETS = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_each_example_says_how_it_is_held_to_the_truth():
    for block in blocks():
        match block.kind, block.words:
            case ("run", "here") | ("not run", _):  # test_examples.py counts that it runs them all
                pass
            case "run", "container":
                assert block.document in CONTAINER and block.language == "sh", block
            case "run", words:
                file, _, name = words.partition("::")
                assert f"def {name}(" in (ROOT / file).read_text(), block
            case "checked", words:
                assert words in CHECKED, block
            case _:
                raise AssertionError(f"{block}: no mark above it; tests/documents/blocks.py says which there are")


CONTAINER = {"docs/operating.md", "docs/troubleshooting.md", "docs/sensors.md", "docs/security.md"}


def commands(block: Block) -> list[list[str]]:
    """Calls of our programs, and of make, in a shell example."""
    text = re.sub(r"<<'EOF'.*?^EOF$", "", block.text.replace("\\\n", " "), flags=re.MULTILINE | re.DOTALL)
    parts = [part.strip() for line in text.splitlines() for part in re.split(r"\|\|?|&&|;", line.split("#")[0])]
    words = [shlex.split(part.removeprefix("sudo ")) for part in parts if part and "'*" not in part]
    return [found for found in words if found and found[0] in (*PARSERS, "make")]


def test_each_command_is_valid():
    for block in blocks():
        for program, *arguments in commands(block) if block.language == "sh" else ():
            if program == "make":
                assert {word for word in arguments if "=" not in word} <= set(TARGETS), block
            else:
                PARSERS[program].parse_args(arguments)


def test_each_command_in_the_text_exists():
    for path in documents():
        for found in re.findall(r"`gesturectl ([a-z]+)", path.read_text()):
            assert found in subcommands("gesturectl"), f"{path.name}: gesturectl {found}"


def heads(path: Path) -> set[str]:
    """The anchors of a document's headings, as GitHub makes them."""
    found = re.findall(r"^#+ (.*)$", path.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in found}


def test_every_link_leads_somewhere():
    for path in documents():
        for target, anchor in re.findall(r"\]\((?!https?:)([^)#]*)#?([^)]*)\)", path.read_text()):
            there = path.parent / target if target else path
            assert there.exists(), f"{path.name}: {target}"
            assert not anchor or anchor in heads(there), f"{path.name}: {target}#{anchor}"
