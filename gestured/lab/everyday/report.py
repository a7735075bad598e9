"""Figures of hours of everyday contact, as JSON values and as tables."""

from collections.abc import Mapping, Sequence
from typing import Any

from gestured.core.points import USUAL, Strictness
from gestured.lab.everyday.hours import FEW, Heard, Least, cost, curve, judged, points_of, shares
from gestured.lab.table import Table, Value
from gestured.model.model import Model

RULED = 0.5  # false gestures an hour, marked in the picture
SHOWN = (0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)  # thresholds of the curve that the table has
Figures = dict[str, Any]


def figures(
    heard: Sequence[Heard], models: Sequence[Model], strictness: Strictness, *, published: bool = False
) -> Figures:
    """The figures of the first model at an operating point, and the curves of all models."""
    first = models[0]
    least: Least = 0.0 if published else points_of(first)[strictness]
    places = list(dict.fromkeys(one.place for one in heard if one.seconds))
    every = judged(heard, first.name, least)
    meant = {name: shares({how: n for (of, how), n in every.meant.items() if of == name}) for name in first.gestures}
    return {
        "model": first.name,
        "strictness": strictness,
        **every.figures(),
        "places": {
            name: judged((one for one in heard if one.place == name), first.name, least).figures() for name in places
        },
        "gestures": {name: {"false": every.false[name], **meant[name]} for name in first.gestures},
        "lay": {
            lay: shares({how: n for (of, how), n in every.lay.items() if of == lay})
            for lay in sorted({of for of, _ in every.lay})
        },
        "points": {
            model.name: {name: cost(heard, model.name, of) for name, of in points_of(model).items()} for model in models
        },
        "curves": {model.name: curve(heard, model.name) for model in models},
    }


def tables(found: Figures, kind: str) -> list[Table]:
    """Tables by place, by gesture, by what lay on the sensor, and by threshold; `kind` is the kind of the hours."""
    title = f"Everyday contact, {kind}: {found['model']}, {found['strictness']}"
    rows = [_place(name, of) for name, of in (*found["places"].items(), ("all", found))]
    notes = [f"The interval is over {found['people']} people."] if found["people"] >= FEW else []
    if found["false_per_hour"] == 0:
        notes = ["Nothing false was said; the interval ends at three divided by the hours."]
    deaf = ", ".join(f"{why} {minutes:.2f}" for why, minutes in found["deaf_minutes_per_hour"].items())
    if deaf:
        notes.append(f"Minutes deaf in an hour: {deaf}.")
    head = (
        "place", "hours", "contacts an hour", "false an hour", "95 %", "of 100 contacts", "counted apart",
        "provisional false", "right", "wrong", "missed", "deaf min an hour",
    )  # fmt: skip
    made = [Table(title, head, rows, tuple(notes))]
    parts = ("right", "wrong", "missed")
    hours = found["hours"]
    of_gestures = [
        (name, of["false"], of["false"] / hours, of["meant"], *(_share(of[how]) for how in parts))
        for name, of in found["gestures"].items()
    ]
    made.append(Table("By gesture", ("gesture", "false", "false an hour", "meant", *parts), of_gestures))
    if found["meant"]:
        lay = [(name or "-", of["meant"], *(_share(of[how]) for how in parts)) for name, of in found["lay"].items()]
        made.append(Table("Gestures that were meant, by what lay on the sensor", ("lay", "meant", *parts), lay))
    made.append(_curves(found))
    return made


def _place(name: str, of: Mapping[str, Any]) -> tuple[Value, ...]:
    hours = of["hours"]
    return (
        name, f"{hours:.0f}" if hours > 10 else f"{hours:.2g}", round(of["contacts_per_hour"]), of["false_per_hour"],
        f"{of['low']:.1f} to {of['high']:.1f}", of["false_per_100_contacts"], of["apart_per_hour"],
        of["provisional_false_per_hour"], *(_share(of[how]) for how in ("right", "wrong", "missed")),
        sum(of["deaf_minutes_per_hour"].values()),
    )  # fmt: skip


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def not_right(row: Mapping[str, float | None]) -> float | None:
    """The share of the gestures meant that were missed or taken for another one; None if none was meant."""
    return None if row["missed"] is None or row["wrong"] is None else row["missed"] + row["wrong"]


def _curves(found: Figures) -> Table:
    """The operating points of each model, and thresholds of all gestures alike."""
    points, curves = found["points"], found["curves"]
    names = dict.fromkeys(name for of in points.values() for name in of)
    sides: list[tuple[str, list[Mapping[str, float | None] | None]]] = [
        (name, [of.get(name) for of in points.values()]) for name in names
    ]
    for level in SHOWN:
        at_level = [next(row for row in rows if row["threshold"] == level) for rows in curves.values()]
        sides.append((f"threshold {level:g}", at_level))
    rows: list[tuple[Value, ...]] = [(name, *(cell for row in each for cell in _cells(row))) for name, each in sides]
    head = ("at", *(words for name in curves for words in (f"{name}: false an hour", "missed or wrong")))
    lone = ", ".join(name for name, of in points.items() if list(of) == [USUAL])
    notes = [f"Without operating points, but for one threshold, shown as {USUAL}: {lone}."] if lone else []
    return Table("Missed against false", head, rows, tuple(notes))


def _cells(row: Mapping[str, float | None] | None) -> tuple[Value, Value]:
    return ("-", "-") if row is None else (row["false_per_hour"] or 0.0, _share(not_right(row)))
