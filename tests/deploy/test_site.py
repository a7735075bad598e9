"""The documents as a site: each page is in its navigation, and no link of what is built leads nowhere."""

import importlib.util
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from deploy.site.hooks import navigation

ROOT = Path(__file__).resolve().parents[2]


def test_the_readmes_table_leads_to_every_page():
    found = set(re.findall(r"'([^']+\.md)'", str(navigation((ROOT / "README.md").read_text()))))
    pages = {str(path.relative_to(ROOT)) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]}
    assert found == pages, 'the table "Where to read on" of README.md is the navigation'


class Page(HTMLParser):
    """What a page leads to, what it loads, and the anchors that it has."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        names = dict(attributes)
        self.anchors |= {names[name] or "" for name in ("id", "name") if name in names}
        if tag == "a" and names.get("href"):
            self.links.append(str(names["href"]))
        elif target := names.get("src") or (tag == "link" and names.get("href")):
            self.loads.append(str(target))


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Page]:
    if importlib.util.find_spec("material") is None:
        pytest.skip("mkdocs-material is not installed: no site can be built")
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [ROOT / "deploy" / "site" / "build.sh", sys.executable, out], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return {path.resolve(): Page(path) for path in (out / "html").rglob("*.html") if path.name != "404.html"}


def test_every_link_and_anchor_of_the_site_resolves(pages: dict[Path, Page]):
    astray = []
    for path, page in pages.items():
        for link in page.links + page.loads:
            split = urlsplit(link)
            if split.scheme:
                continue
            there = (path.parent / unquote(split.path)).resolve() if split.path else path
            anchors = pages[there].anchors if there in pages else set()
            if not there.is_file() or (split.fragment and there in pages and unquote(split.fragment) not in anchors):
                astray.append(f"{path.name}: {link}")
    assert len(pages) > 25 and astray == []


def test_the_site_loads_nothing_from_elsewhere(pages: dict[Path, Page]):
    assert [load for page in pages.values() for load in page.loads if urlsplit(load).scheme not in ("", "data")] == []
