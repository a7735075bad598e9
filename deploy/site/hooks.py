"""The hooks that mkdocs calls while it builds the site."""

import re
from pathlib import Path
from typing import Any

READ_ON = re.compile(r"^## Where to read on\n(.*?)^## ", re.MULTILINE | re.DOTALL)


def navigation(readme: str) -> list[dict[str, Any]]:
    """The navigation, from the README's table "Where to read on": what a reader wants, and the pages for that."""
    (table,) = READ_ON.findall(readme)
    found: list[dict[str, Any]] = [{"gestured": "README.md"}]
    for wish, pages in re.findall(r"^\| (.+?) \| (.*\.md\).*) \|$", table, re.MULTILINE):
        links = [{name: page} for name, page in re.findall(r"\[([^]]+)\]\(([^)]+\.md)\)", pages)]
        title = re.split("[,:(]", wish)[0].strip()
        found.append({title[0].upper() + title[1:]: links if len(links) > 1 else [*links[0].values()][0]})
    return found


def on_config(config: Any) -> Any:
    """Set the navigation, before mkdocs reads any page."""
    config.nav = navigation((Path(config.docs_dir) / "README.md").read_text())
    return config
