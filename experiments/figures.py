"""`make figures`: every generated table of the documents, by the command that its own line names.

    make figures ARGS=--stale                 list tables made of other models or other code, and why
    make figures ARGS="--real ~/capfingerid"  make these tables again, one after the other

Tables of older code are up to date where experiments/same.txt says that this code decides alike (`experiments.same`).
An interrupted pass can be continued: a table that was written is up to date. Each command's duration is printed.
"""

import argparse
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from experiments.same import HELD, alike
from gestured.lab.made_of import LINE, OLDER, decides, digests, other_code, others
from gestured.model.shipped import shipped

ROOT = Path(__file__).resolve().parents[1]


class Made(NamedTuple):
    """A line above a table: its page, its number from 1, its command, and why the table is stale (empty: it is not)."""

    page: Path
    number: int
    command: str
    why: str


def made(root: Path) -> Iterator[Made]:
    """All lines of a checkout that say what a table was made of, in the order in which their commands are run."""
    docs = root / "docs"
    now = digests([*shipped().values(), root / "models" / "manifest.json", *docs.glob("*.json"), *docs.glob("*.svg")])
    for page in [*root.glob("README.md"), *sorted(docs.glob("*.md")), *sorted((root / "models").glob("*.md"))]:
        lines = page.read_text().splitlines()
        for number, line in enumerate(lines, 1):
            if match := LINE.fullmatch(line.strip()):
                why = [f"made of another {name}" for name in others(match, now)]
                known = not match["modules"] and alike(match["code"] or "", decides(), HELD.read_text())
                if other_code(match) and not known:
                    why.append("made with other code" if match["code"] else "does not say with which code")
                if OLDER in lines[number : number + 2]:
                    why = ["says itself that it is older"]
                yield Made(page, number, match[1], "; ".join(why))


def with_data(command: str, real: Path | None) -> list[str] | str:
    """A command's words, with the folder of real recordings in its place; or a sentence that says what is missing."""
    words = shlex.split(command)
    if "--real" in words:
        if real is None or not real.is_dir():
            return f'`{command}` needs the folder of real recordings: make figures ARGS="--real FOLDER"'
        words[words.index("--real") + 1] = str(real)
    if "--foreign" in words and not Path(given := words[words.index("--foreign") + 1]).is_file():
        return f"`{command}` needs {given}, which is not here: python -m experiments.foreign.recordings {given}"
    programs = Path(sys.executable).parent
    return [str(programs / words[0]) if (programs / words[0]).exists() else words[0], *words[1:]]


def run(one: Made, words: list[str]) -> bool:
    """Run a command, which writes its page; true if it ended well."""
    start = time.monotonic()
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.DEVNULL, check=False)
    took = f"{time.monotonic() - start:.0f} s"
    if done.returncode:
        print(f"failed after {took}: {one.command}", file=sys.stderr)
    else:
        print(f"written in {took}: {one.command}")
    return not done.returncode


def main() -> int:
    """List stale tables, or make them again; returns 1 if any is or remains stale."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stale", action="store_true", help="list tables made of other models or code; make none")
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="the folder of real recordings")
    args = parser.parse_args()
    old = [one for one in made(ROOT) if one.why]
    if args.stale:
        for one in old:
            print(f"{one.page.relative_to(ROOT)}:{one.number}: `{one.command}`: {one.why}")
        return int(bool(old))
    well = True
    for one in {one.command: one for one in old}.values():
        words = with_data(one.command, args.real)
        if isinstance(words, str):
            print(words, file=sys.stderr)
        well &= not isinstance(words, str) and run(one, words)
    return int(not well)


if __name__ == "__main__":
    sys.exit(main())
