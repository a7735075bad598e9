"""What the rooms of the report ask of a study."""

from typing import Any

Study = dict[str, Any]
Row = dict[str, Any]

FAMILIES = (
    "spatio-temporal features",
    "touch-pattern features",
    "motion history image",
    "recurrent",
    "beyond the paper",
)
PROTOCOLS = {
    "paper": "15 % of the gestures are held out at random, after augmentation, as the published figures suggest. "
    "The same people, and copies of the test gestures, are in the training set.",
    "clean": "The same split, made first; only the training part is augmented. The same people are on both sides.",
    "participants": "Whole participants are held out: how well it works for somebody new.",
    "real": "Real recordings of a touchscreen's capacitive sensor, subjects held out in turn.",
    "online": "Continuous sessions of new participants, sent over UDP to a running daemon.",
}
AUGMENTATIONS = {
    "none": "no augmentation",
    "shift": "augmented by shifting (Algorithm 1)",
    "wide": "wide randomisation of the domain",
}
SETTINGS = {"paper": "the paper's", "tuned": "tuned"}
NEAR = 0.05  # a figure this close to the published one counts as reproduced


def part(study: Study, name: str) -> list[Row]:
    """A list of the study; empty where it was not computed."""
    return list(study.get(name) or [])


def title(study: Study, method: str) -> str:
    return str((study.get("methods") or {}).get(method, {}).get("title", method))


def family(study: Study, method: str) -> int:
    """The number of a method's family, for its colour and form; the last one for what is not known."""
    name = (study.get("methods") or {}).get(method, {}).get("family")
    return FAMILIES.index(name) if name in FAMILIES else len(FAMILIES) - 1


def in_order(study: Study, names: set[str]) -> list[str]:
    """Methods in the order of the study, families together; unknown ones at the end."""
    known = [name for name in study.get("methods") or {} if name in names]
    return sorted(known, key=lambda name: family(study, name)) + sorted(names - set(known))


def cells(study: Study, **wanted: str) -> list[Row]:
    return [cell for cell in part(study, "cells") if all(cell.get(key) == value for key, value in wanted.items())]


def cell(study: Study, method: str, augmentation: str, protocol: str) -> Row | None:
    """The figure to compare with the paper's: with its settings, or tuned where the paper gives none."""
    found = cells(study, method=method, augmentation=augmentation, protocol=protocol)
    return min(found, key=lambda row: row.get("settings") != "paper", default=None)


def published(study: Study, method: str, augmentation: str) -> float | None:
    rows = cells(study, method=method, augmentation=augmentation)
    return next((float(row["published"]) for row in rows if row.get("published") is not None), None)


def as_published(row: Row) -> bool:
    """Whether a figure reproduces: the published one lies in its interval, or no more than NEAR away."""
    inside = row.get("low") is not None and row["low"] <= row["published"] <= row["high"]
    return bool(inside or abs(row["right"] - row["published"]) <= NEAR + 1e-9)


def shown(study: Study, method: str) -> Row | None:
    """The cell whose confusion matrix is drawn: new people first, then tuned, then the most augmented."""
    order = (tuple(PROTOCOLS), ("tuned", "paper"), ("wide", "shift", "none"))
    protocols = ("participants", "clean", "paper", "real", "online")

    def rank(row: Row) -> tuple[int, int, int]:
        return protocols.index(row["protocol"]), order[1].index(row["settings"]), order[2].index(row["augmentation"])

    return min((row for row in cells(study, method=method) if row.get("confusion")), key=rank, default=None)
