"""Error against run time as one self-contained SVG, written by hand: no plotting library, no script, no font."""

import math
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

from gestured.lab.stability.textbook import Point

WIDTH, HEIGHT = 470, 380  # of a panel, in pixels
LEFT, RIGHT, TOP, BOTTOM = 64, 16, 40, 46
WORST, BEST = 3, -17  # powers of ten of the error; what diverges is drawn at the top
COLOURS = ("#1b6ca8", "#7a7a7a", "#c0392b", "#2e8b57", "#8e5bb5")


def svg(panels: Mapping[str, Sequence[Point]]) -> str:
    """One panel beside the other: each method a line, its points the numbers of steps a frame."""
    methods = list(dict.fromkeys(point.method for points in panels.values() for point in points))
    colours = {method: COLOURS[k % len(COLOURS)] for k, method in enumerate(methods)}
    seconds = [math.log10(point.seconds) for points in panels.values() for point in points]
    low, high = math.floor(min(seconds)), math.ceil(max(seconds))
    width, height = WIDTH * len(panels), HEIGHT + 20 * len(methods) + 12
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"',
        ' font-family="sans-serif" font-size="12">',
        "<title>A first-order filter: largest error against run time, by method and steps a frame</title>",
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for k, (title, points) in enumerate(panels.items()):
        parts.append(f'<g transform="translate({k * WIDTH} 0)">')
        parts += _panel(title, points, colours, low, high)
        parts.append("</g>")
    for k, (method, colour) in enumerate(colours.items()):
        y = HEIGHT + 14 + 20 * k
        parts.append(f'<circle cx="{LEFT}" cy="{y - 4}" r="5" fill="{colour}"/>')
        parts.append(f'<text x="{LEFT + 14}" y="{y}">{escape(method)}</text>')
    return "\n".join([*parts, "</svg>", ""])


def _panel(title: str, points: Sequence[Point], colours: Mapping[str, str], low: int, high: int) -> list[str]:
    def x(seconds: float) -> float:
        return LEFT + (math.log10(seconds) - low) / (high - low) * (WIDTH - LEFT - RIGHT)

    def y(error: float) -> float:
        power = WORST if math.isinf(error) else min(max(math.log10(max(error, 1e-300)), BEST), WORST)
        return TOP + (WORST - power) / (WORST - BEST) * (HEIGHT - TOP - BOTTOM)

    parts = [f'<text x="{LEFT}" y="20" font-weight="bold">{escape(title)}</text>']
    for power in range(BEST + 1, WORST, 4):
        at = y(10.0**power)
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">1e{power}</text>')
    parts.append(f'<text x="{LEFT - 6}" y="{TOP + 4}" text-anchor="end">diverges</text>')
    for power in range(low, high + 1):
        at = x(10.0**power)
        parts.append(f'<line x1="{at:.1f}" x2="{at:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" stroke="#eee"/>')
        label = f"1e{power} s"
        parts.append(f'<text x="{at:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{label}</text>')
    parts.append(
        f'<text x="{(LEFT + WIDTH) / 2}" y="{HEIGHT - BOTTOM + 34}" text-anchor="middle">run time a frame; '
        "up: largest error</text>"
    )
    for method, colour in colours.items():
        own = [(x(p.seconds), y(p.error), p) for p in points if p.method == method]
        line = " ".join(f"{a:.1f},{b:.1f}" for a, b, _ in own)
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        for a, b, point in own:
            tip = f"{point.method}, {point.substeps} steps a frame: {point.error:.2g}, {1e6 * point.seconds:.2g} us"
            parts.append(
                f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{5 if point.substeps == 1 else 3}" fill="{colour}">'
                f"<title>{escape(tip)}</title></circle>"
            )
    return parts
