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
    "paper": "15 % of the gestures are held out at random, after augmentation, as the published figures suggest; all "
    "are brought to one length. The same people, and copies of the test gestures, are in the training set.",
    "clean": "Split first, 85 to 15; only the training part is augmented, and each gesture keeps its own length. The "
    "same people are on both sides.",
    "participants": "Whole participants are held out: how well it works for somebody new.",
    "real": "Real recordings of a touchscreen's capacitive sensor, subjects held out in turn.",
    "online": "Continuous sessions of new participants, sent over UDP to a running daemon.",
}
AUGMENTATIONS = {
    "none": "no augmentation",
    "shift": "shifted (Algorithm 1)",
    "wide": "wide randomisation",
}
SETTINGS = {"paper": "the paper's", "tuned": "tuned"}
SHORT = {  # words of a title that a figure has no room for
    " features, ": " ",
    "k nearest neighbours": "KNN",
    "support vector machine": "SVM",
    " (RBF)": "",
}
NEAR = 0.05  # a figure this close to the published one counts as reproduced


def part(study: Study, name: str) -> list[Row]:
    """A list of the study; empty where it was not computed."""
    return [row for row in study.get(name) or [] if row.get("right", 0.0) is not None]


def full_title(study: Study, method: str) -> str:
    return str((study.get("methods") or {}).get(method, {}).get("title", method))


def title(study: Study, method: str) -> str:
    """A method's name, as short as it is clear."""
    name = full_title(study, method)
    for words, fewer in SHORT.items():
        name = name.replace(words, fewer)
    return name


def family(study: Study, method: str) -> int:
    """The number of a method's family, for its colour and form; the last one for what is not known."""
    name = (study.get("methods") or {}).get(method, {}).get("family")
    return FAMILIES.index(name) if name in FAMILIES else len(FAMILIES) - 1


def in_order(study: Study, names: set[str]) -> list[str]:
    """Methods in the order of the study, families together; unknown ones at the end."""
    known = [name for name in study.get("methods") or {} if name in names]
    return sorted(known, key=lambda name: family(study, name)) + sorted(names - set(known))


def cells(study: Study, **wanted: str) -> list[Row]:
    """The cells with these properties; a researcher's own recordings only where `data="own"` asks for them."""
    rows = [row for row in part(study, "cells") if "data" in wanted or row["data"] != "own"]
    return [row for row in rows if all(row.get(key) == value for key, value in wanted.items())]


def cell(study: Study, method: str, augmentation: str, protocol: str) -> Row | None:
    """The figure to compare with the paper's: with its settings, or tuned where the paper gives none."""
    return next(iter(usual(cells(study, method=method, augmentation=augmentation, protocol=protocol))), None)


def usual(rows: list[Row]) -> list[Row]:
    """Of each method the rows with the paper's settings; with tuned ones where it has no others."""
    given = {row["method"] for row in rows if row["settings"] == "paper"}
    return [row for row in rows if row["settings"] == "paper" or row["method"] not in given]


def published(study: Study, method: str, augmentation: str) -> float | None:
    rows = cells(study, method=method, augmentation=augmentation)
    return next((float(row["published"]) for row in rows if row.get("published") is not None), None)


def as_published(row: Row) -> bool:
    """Whether a figure reproduces: the published one lies in its interval, or no more than NEAR away."""
    low, high = ends(row)
    return bool(low <= row["published"] <= high or abs(row["right"] - row["published"]) <= NEAR + 1e-9)


def ends(row: Row) -> tuple[float, float]:
    """The interval of a share; the share itself where there is none."""
    low, high = row.get("low"), row.get("high")
    return (row["right"] if low is None else low), (row["right"] if high is None else high)


def bounds(row: Row) -> tuple[list[float], list[float]]:
    """The same for a row that holds lists."""
    return list(row.get("low") or row["right"]), list(row.get("high") or row["right"])


def below(lowest: float) -> float:
    """Where an axis of shares begins: a round figure below all that is shown."""
    return max(0.0, int(10 * lowest) / 10)


def floor(study: Study) -> float:
    """The same for all the cells of the paper's tables."""
    shares = [row["published"] for row in part(study, "cells") if row.get("published") is not None]
    return below(min([*shares, *(ends(row)[0] for row in part(study, "cells"))], default=0.0))


def shown(study: Study, method: str) -> Row | None:
    """The cell whose confusion matrix is drawn: new people first, then tuned, then the most augmented."""
    order = {
        "protocol": ("participants", "clean", "paper", "real", "online"),
        "settings": ("tuned", "paper"),
        "augmentation": ("wide", "shift", "none"),
    }
    drawn = [row for row in cells(study, method=method) if row.get("confusion")]
    return min(drawn, key=lambda row: [names.index(row[key]) for key, names in order.items()], default=None)
