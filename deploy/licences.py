"""`python3 deploy/licences.py FOLDER NAME` prints the copyright file of a package.

FOLDER holds the Python packages that the package brings, NAME is where they will be installed. Python alone is needed.
"""

import re
import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path

HERE = Path(__file__).resolve().parent
FILES = ("licen", "copying", "notice", "thirdparty")  # the names of files with licences begin with one of these


def short(found: Distribution) -> str:
    """A distribution's licence in a few words, from its metadata; empty if these have none."""
    said = found.metadata["License-Expression"] or (found.metadata["License"] or "").strip()
    kinds = [line for line in found.metadata.get_all("Classifier", []) if line.startswith("License ::")]
    return said if said and "\n" not in said else ", ".join(line.rsplit(" :: ", 1)[1] for line in kinds)


def main(folder: str, name: str) -> int | str:
    """Print the copyright file; returns 0, or a sentence about a distribution that comes without its licence."""
    known = dict(
        re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", (HERE / "licences.txt").read_text(), re.MULTILINE | re.DOTALL)
    )
    print((HERE.parent / "NOTICE").read_text())
    print("The Apache License, Version 2.0, is in /usr/share/common-licenses/Apache-2.0.\n")
    print("The package brings these, unchanged as they were published on the Python Package Index:")
    for found in sorted(distributions(path=[folder]), key=lambda found: found.name.lower()):
        if found.name == "gestured":
            continue
        texts = [file for file in found.files or [] if file.name.lower().startswith(FILES) and file.suffix[:3] != ".py"]
        if not short(found) or not (texts or found.name in known):
            return f"{found.name} comes without its licence: deploy/licences.txt has to say it"
        print(f"\n{found.name} {found.version}: {short(found)}")
        print("\n".join(f"  {name}/{file}" for file in texts) or known[found.name].rstrip())
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
