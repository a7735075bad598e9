"""The figure of error against run time: a file that stands alone and says in words what it shows."""

import math
from xml.etree import ElementTree

import numpy as np

from gestured.lab.stability.figure import svg
from gestured.lab.stability.textbook import Point, points

SVG = "{http://www.w3.org/2000/svg}"
POINTS = [Point("ours <&> theirs", 1, 0.0, 2e-6, False), Point("ours <&> theirs", 4, 1e-3, 8e-6, False)]
PANELS = {"slow": POINTS, "any": [Point("Euler", 1, math.inf, 3e-6, True)]}


def test_every_point_is_told_and_every_method_is_in_the_key() -> None:
    root = ElementTree.fromstring(svg(PANELS))
    told = [title.text for title in root.iter(f"{SVG}title")]
    assert told[0] == "A first-order filter: largest error against run time, by method and steps a frame"
    assert told[1:] == [
        "ours <&> theirs, 1 steps a frame: 0, 2 us",
        "ours <&> theirs, 4 steps a frame: 0.001, 8 us",
        "Euler, 1 steps a frame: inf, 3 us",
    ]
    words = {text.text for text in root.iter(f"{SVG}text")}
    assert {"slow", "any", "diverges", "ours <&> theirs", "Euler"} <= words


def test_it_stands_alone_on_a_ground_of_its_own_and_is_the_same_again() -> None:
    written = svg(PANELS)
    assert "var(" not in written and "url(http" not in written and written == svg(PANELS)
    ground = ElementTree.fromstring(written).find(f".//{SVG}path")
    assert ground is not None and "fill: #" in (ground.get("style") or "")


def test_the_figure_tells_of_every_point_that_is_measured() -> None:
    some = points(-1, 1, np.float64, quick=True)
    root = ElementTree.fromstring(svg({"one": some, "the same": some}))
    told = [title.text or "" for title in root.iter(f"{SVG}title")][1:]
    assert len(told) == 2 * len(some)
    assert all(sum(one.startswith(f"{method}, ") for one in told) > 0 for method in {p.method for p in some})
