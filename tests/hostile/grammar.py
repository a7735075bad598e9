"""What consumers rely on, whatever goes wrong: each onset has exactly one answer and one release."""

from collections.abc import Iterable, Mapping
from typing import Any

ANSWERS = ("gesture", "unknown", "cancelled")
TYPES = ("onset", *ANSWERS, "release")


def violations(lines: Iterable[Mapping[str, Any]], ended: bool = True) -> list[str]:
    """What is wrong with these lines of any sensors, all since the start; `ended`: nothing may be open now."""
    wrong: list[str] = []
    stories: dict[tuple[str, int], list[str]] = {}
    sequences: dict[str, int] = {}
    for line in lines:
        if line["type"] not in TYPES:
            continue
        sensor = line["sensor"]
        story = stories.setdefault((sensor, line["id"]), [])
        story.append("answer" if line["type"] in ANSWERS else line["type"])
        if len(story) > 3 or story[0] != "onset" or len(set(story)) != len(story):
            wrong.append(f"{sensor} {line['id']}: {story}")
        if line["type"] == "gesture":
            if line["sequence"] != sequences.get(sensor, 0) + 1:
                wrong.append(f"{sensor}: sequence {line['sequence']} after {sequences.get(sensor, 0)}")
            sequences[sensor] = line["sequence"]
    if ended:
        wrong += [f"{sensor} {i}: ends with {story}" for (sensor, i), story in stories.items() if len(story) < 3]
    return wrong
