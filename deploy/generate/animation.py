"""The animation at the top of the README: the frames of a recording, and the daemon's answers at their times."""

from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from gestured.record.replay import frames_used, opened

STOPS = ("00204d", "31446b", "666970", "958f78", "cab969", "ffea46")  # cividis, for eyes that see no red or green, too
LEVELS = 16  # shades: more cannot be told apart, and make the file larger
SIDE = 26  # pixels of a taxel
LEFT, TOP = 20, 20  # pixels of the margins
BEFORE_S, AFTER_S = 0.7, 1.6  # shown before the first onset, and after the last answer
IDLE_FRAMES = 15  # the first frames, in which nobody touches the sensor: a second at 15 Hz
SHOWN = 4  # the most gestures


def animation(path: Path) -> str:
    """The first gestures of a tape as an SVG that repeats for ever. Raises RecordingError."""
    tape, known = opened(path)
    sensor, frames = next(iter(frames_used(tape, known.scene).items()))
    said = [e for e in tape.events if e["type"] == "gesture" and e["sensor"] == sensor][:SHOWN]
    begin, end = said[0]["onset"] - BEFORE_S, said[-1]["decided"] + AFTER_S
    times = np.array([frame.t for frame in frames])
    counts = np.array([np.asarray(frame.values, float) for frame in frames])
    values = counts - np.median(counts[:IDLE_FRAMES], axis=0)
    inside = (times >= begin) & (times <= end)
    length = end - begin
    levels = np.clip(values[inside] / values[inside].max() * LEVELS, 0, LEVELS - 1).astype(int)
    moments = (times[inside] - begin) / length
    rows, columns = levels.shape[1:]
    words = [(e["gesture"], e["confidence"], (e["decided"] - begin) / length, e["decided"] - e["offset"]) for e in said]
    width, height = 2 * LEFT + SIDE * columns + 400, 2 * TOP + SIDE * rows
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
            f'font-family="ui-monospace, monospace" role="img" aria-label="{rows} by {columns} taxels of a sensor that '
            f'is touched, and the gestures that are recognised: {escape(", ".join(w[0] for w in words))}">',
            f'<rect width="{width}" height="{height}" rx="10" fill="#101317"/>',
            *_matrix(levels, moments, length),
            *_text(words, length, LEFT + SIDE * columns + 30),
            "</svg>",
            "",
        ]
    )


def _matrix(levels: NDArray[np.int_], moments: NDArray[np.float64], length: float) -> list[str]:
    """A square for each taxel, whose colour changes with its level."""
    colours = [_colour((n + 0.5) / LEVELS) for n in range(LEVELS)]
    drawn = []
    for row in range(levels.shape[1]):
        for column in range(levels.shape[2]):
            course = levels[:, row, column]
            steps = [0, *(n for n in range(1, len(course)) if course[n] != course[n - 1])]
            x, y = LEFT + SIDE * column, TOP + SIDE * row
            square = f'<rect x="{x}" y="{y}" width="{SIDE - 2}" height="{SIDE - 2}" fill="#{colours[course[0]]}"'
            if len(steps) == 1:
                drawn.append(square + "/>")
                continue
            values = ";".join("#" + colours[course[n]] for n in steps)
            keys = ";".join("0" if n == 0 else f"{moments[n]:.3f}".lstrip("0") for n in steps)
            drawn.append(
                f'{square}><animate attributeName="fill" dur="{length:.2f}s" repeatCount="indefinite" '
                f'calcMode="discrete" values="{values}" keyTimes="{keys}"/></rect>'
            )
    return drawn


def _text(words: list[tuple[str, float, float, float]], length: float, x: int) -> list[str]:
    """Each answer, shown from the time of its decision on."""
    drawn = [f'<text x="{x}" y="{TOP + 24}" fill="#9aa5b1" font-size="15">pressure in, gestures out</text>']
    for n, (gesture, confidence, moment, waited) in enumerate(words):
        y, after = TOP + 66 + 44 * n, f"{1000 * waited:.0f} ms after the finger left"
        line = f"{escape(gesture)}  {confidence:.2f}"
        drawn.append(
            f'<g opacity="0"><text x="{x}" y="{y}" fill="#ffea46" font-size="19">{line}</text>'
            f'<text x="{x}" y="{y + 17}" fill="#9aa5b1" font-size="13">{after}</text>'
            f'<animate attributeName="opacity" dur="{length:.2f}s" repeatCount="indefinite" calcMode="discrete" '
            f'values="0;1" keyTimes="0;{moment:.3f}"/></g>'
        )
    return drawn


def _colour(share: float) -> str:
    place = share * (len(STOPS) - 1)
    low, high = (bytes.fromhex(STOPS[min(int(place) + n, len(STOPS) - 1)]) for n in (0, 1))
    return bytes(round(a + (b - a) * (place % 1)) for a, b in zip(low, high, strict=True)).hex()
