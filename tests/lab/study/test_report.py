"""The report as a reader meets it: everything there, nothing broken, nothing from elsewhere, the numbers true."""

import re
from typing import Any
from xml.etree import ElementTree

import pytest

from gestured.lab.study.report import write_report
from tests.lab.study.made_study import made_study


@pytest.fixture(scope="module")
def study() -> dict[str, Any]:
    return made_study()


@pytest.fixture(scope="module")
def page(study: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_report(study, tmp_path_factory.mktemp("report")).read_text("utf-8")


def test_every_drawing_is_valid_xml_and_says_in_words_what_it_shows(page: str) -> None:
    drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(drawings) > 100
    for drawing in drawings:
        root = ElementTree.fromstring(drawing)
        title = root.find("title")
        assert root.get("role") == "img" and title is not None and title.text


def test_nothing_is_fetched(page: str) -> None:
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!#)""", page)
    assert not re.search(r"(?:https?:)?//[a-z]|url\(|@import", page.split("<script>")[0])
