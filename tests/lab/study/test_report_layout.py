"""The report in a real browser, on a phone and on a desk: nothing sticks out, no names collide, tables sort."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from gestured.lab.study.report.page import write_report
from tests.lab.study.made_study import empty_study, made_study

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
MEASURE = """
const frame = document.querySelector("iframe");
frame.addEventListener("load", () => {
  const page = frame.contentDocument, root = page.documentElement, window = frame.contentWindow;
  for (const folded of page.querySelectorAll("details")) folded.open = true;
  const clipped = [], collided = [];
  for (const drawing of page.querySelectorAll("svg[role=img]")) {
    const edge = drawing.getBoundingClientRect(), words = [...drawing.querySelectorAll("text")];
    const boxes = words.map((word) => word.getBoundingClientRect());
    const title = drawing.querySelector("title").textContent;
    boxes.forEach((box, k) => {
      const said = `${words[k].textContent} in: ${title}`;
      if (box.left < edge.left - 1 || box.right > edge.right + 1 || box.bottom > edge.bottom + 1) clipped.push(said);
      for (const other of boxes.slice(k + 1)) {
        const beside = box.right <= other.left + 1 || other.right <= box.left + 1;
        const above = box.bottom <= other.top + 4 || other.bottom <= box.top + 4;
        if (!beside && !above) collided.push(said);
      }
    });
  }
  const wide = [...page.querySelectorAll("main *")]
    .filter((part) => !part.closest(".scroll, svg") && part.getBoundingClientRect().right > window.innerWidth + 1)
    .map((part) => part.outerHTML.slice(0, 80));
  const table = page.querySelector("#figures table"), last = table?.tHead.rows[0].cells.length - 1;
  const shares = () => [...table.tBodies[0].rows].map((row) => parseFloat(row.cells[last].textContent));
  const sort = () => (table.tHead.rows[0].cells[last].querySelector("button").click(), shares());
  const sorted = table ? [sort(), sort()] : [];
  const found = { sorted, inner: window.innerWidth, scroll: root.scrollWidth, clipped, collided, wide };
  document.body.dataset.found = JSON.stringify(found);
});
"""

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium here (apt install chromium)")


def measured(page: Path, width: int) -> dict[str, Any]:
    """Sizes as the browser has laid them out, in a frame of this width: its own windows cannot be as narrow."""
    source = html.escape(page.read_text("utf-8"))
    frame = f'<iframe style="width:{width}px;height:900px;border:0" srcdoc="{source}"></iframe>'
    wrapper = page.with_name("wrapper.html")
    # The script first waits for the frame's load event, which comes after it has run.
    wrapper.write_text(f'<!doctype html><meta charset="utf-8"><body>{frame}<script>{MEASURE}</script>', "utf-8")
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--window-size=1500,1000",
        "--virtual-time-budget=10000",
    ]
    command = [str(CHROMIUM), *flags, f"--user-data-dir={page.parent / 'profile'}", "--dump-dom", wrapper.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)
    found = re.search(r'data-found="([^"]*)"', done.stdout)
    assert found, done.stderr[-2000:]
    return dict(json.loads(html.unescape(found[1])))


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a study with everything."""
    return write_report(made_study(), tmp_path_factory.mktemp("full"))


@pytest.mark.parametrize("width", [400, 1400])
def test_only_boxes_scroll_all_words_can_be_read_and_tables_sort(width: int, full: Path) -> None:
    found = measured(full, width)
    assert found["inner"] == width
    assert found["scroll"] <= width and found["wide"] == []
    assert found["clipped"] == []
    assert found["collided"] == []
    down, up = found["sorted"]
    assert down == sorted(down, reverse=True) and up == sorted(down) and up != down


def test_a_page_with_nothing_on_it_fits_too(tmp_path: Path) -> None:
    found = measured(write_report(empty_study(), tmp_path), 400)
    assert found["scroll"] <= 400 and found["wide"] == []
