"""What consumers rely on, whatever goes wrong: each onset has exactly one answer and one release.

At most one provisional event comes between onset and answer, and the answer says what became of it.
"""

from collections.abc import Iterable, Mapping
from typing import Any

ANSWERS = ("gesture", "unknown", "cancelled")
TYPES = ("onset", *ANSWERS, "release")


def violations(lines: Iterable[Mapping[str, Any]], ended: bool = True) -> list[str]:
    """What is wrong with these lines of any sensors, all since the start; `ended`: nothing may be open now."""
    wrong: list[str] = []
    stories: dict[tuple[str, int], list[str]] = {}
    sequences: dict[str, int] = {}
    said: dict[tuple[str, int], str] = {}
    for line in lines:
        if line["type"] not in (*TYPES, "provisional"):
            continue
        sensor = line["sensor"]
        story = stories.setdefault((sensor, line["id"]), [])
        if line["type"] == "provisional":
            if story != ["onset"] or (sensor, line["id"]) in said:
                wrong.append(f"{sensor} {line['id']}: provisional after {story}")
            said[sensor, line["id"]] = line["gesture"]
            continue
        story.append("answer" if line["type"] in ANSWERS else line["type"])
        if len(story) > 3 or story[0] != "onset" or len(set(story)) != len(story):
            wrong.append(f"{sensor} {line['id']}: {story}")
        if line["type"] in ANSWERS and line.get("provisional") != (verdict := _verdict(line, said)):
            wrong.append(f"{sensor} {line['id']}: provisional is {line.get('provisional')!r}, expected {verdict!r}")
        if line["type"] == "gesture":
            if line["sequence"] != sequences.get(sensor, 0) + 1:
                wrong.append(f"{sensor}: sequence {line['sequence']} after {sequences.get(sensor, 0)}")
            sequences[sensor] = line["sequence"]
    if ended:
        wrong += [f"{sensor} {i}: ends with {story}" for (sensor, i), story in stories.items() if len(story) < 3]
    return wrong


def _verdict(answer: Mapping[str, Any], said: Mapping[tuple[str, int], str]) -> str | None:
    """What an answer has to say of the provisional event before it."""
    before = said.get((answer["sensor"], answer["id"]))
    return None if before is None else "confirmed" if answer.get("gesture") == before else "revoked"
