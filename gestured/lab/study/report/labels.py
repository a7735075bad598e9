"""Names in a chart that cover neither each other nor the points they belong to."""

from collections.abc import Iterator, Sequence

from .chart import Plot, Point, text
from .markup import Markup, tag

Box = tuple[float, float, float, float]  # left, top, right, bottom
LETTER = 6.9  # mean width of a letter of 12 pixels
HALF = 7.5  # half the height of a line
REACH = (0.0, 10.0, 20.0, 32.0, 46.0, 62.0, 80.0, 100.0)  # how far from its point a name may be moved


def place_names(
    plot: Plot, names: Sequence[str], places: Sequence[Point], first: Sequence[bool], taken: Sequence[Box]
) -> None:
    """Put each name into the nearest free place around its point; those that are `first` choose first.

    What lies in the `taken` boxes is not covered. A name that was moved gets a line to its point. A name that
    finds no place is left to the mark's own title.
    """
    covered, written = list(taken), []
    for k in sorted(range(len(names)), key=lambda k: (not first[k], places[k])):
        width, (x, y) = LETTER * len(names[k]) * (1.08 if first[k] else 1.0), places[k]
        for away, box in _around(x, y, width):
            if _inside(box, plot) and not any(_overlap(box, other) for other in covered):
                covered.append(box)
                if away:
                    _lead(plot, (x, y), box)
                written.append(_name(names[k], x, box, "name front-name" if first[k] else "name"))
                break
    plot.add(*written)  # after all lines, so that none crosses a name


def _around(x: float, y: float, width: float) -> Iterator[tuple[float, Box]]:
    """Boxes about a point, the nearest first: right, left, above, below, and askew."""
    for away in REACH:
        gap, lift = 10 + 0.4 * away, HALF + away
        lefts = (x + gap, x - gap - width, x - width / 2)
        middles = ((y, y - lift, y + lift), (y, y - lift, y + lift), (y - lift - 10, y + lift + 10))
        for left, choices in zip(lefts, middles, strict=True):
            for middle in choices:
                yield away, (left, middle - HALF, left + width, middle + HALF)


def _name(words: str, x: float, box: Box, classes: str) -> Markup:
    """The words in their box, held at the side of the point: a font's own width moves only the other side."""
    level = (box[1] + box[3]) / 2 + 4
    if box[0] > x:
        return text(box[0], level, words, class_=classes)
    return text(box[2], level, words, "end", classes) if box[2] < x else text(x, level, words, "middle", classes)


def _inside(box: Box, plot: Plot) -> bool:
    left, top, right, bottom = box
    sides = plot.x.start <= left and right <= plot.width - 4
    return sides and plot.y.end - 6 <= top and bottom <= plot.y.start


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _lead(plot: Plot, point: Point, box: Box) -> None:
    """A line from a point to the nearest place on the edge of its name."""
    x = min(max(point[0], box[0]), box[2])
    y = min(max(point[1], box[1] + 3), box[3] - 3)
    plot.add(tag("line", x1=point[0], y1=point[1], x2=x, y2=y, class_="leader"))


def spread(places: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Places moved as little as need be, in their order, so that neighbours are `gap` apart and within the bounds."""
    order = sorted(range(len(places)), key=lambda k: places[k])
    moved = list(places)
    for before, k in zip([None, *order], order, strict=False):
        moved[k] = max(places[k], low if before is None else moved[before] + gap)
    for after, k in zip([None, *reversed(order)], reversed(order), strict=False):
        moved[k] = min(moved[k], high if after is None else moved[after] - gap)
    return moved
