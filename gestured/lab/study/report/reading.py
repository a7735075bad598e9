"""What figures and tables ask of a study."""

from collections.abc import Iterable
from typing import Any

Study = dict[str, Any]
Row = dict[str, Any]

FAMILIES = (
    "spatio-temporal features", "touch-pattern features", "motion history image", "recurrent", "beyond the paper",
)  # fmt: skip
PROTOCOLS = {
    "paper": "paper's protocol", "padded": "padded to the longest", "clean": "clean split",
    "participants": "participants held out", "real": "real, subjects held out", "foreign": "another generator",
}  # fmt: skip
SETTINGS = ("paper", "tuned", "shipped")
SHORT = {" features, ": " ", "k nearest neighbours": "KNN", "support vector machine": "SVM", " (RBF)": ""}  # in figures


def title(study: Study, method: str) -> str:
    """A method's name, as short as it is clear."""
    name = str(study["methods"][method]["title"])
    for words, fewer in SHORT.items():
        name = name.replace(words, fewer)
    return name


def family(study: Study, method: str) -> int:
    """The number of a method's family, for its colour and form."""
    return FAMILIES.index(study["methods"][method]["family"])


def in_order(study: Study, names: Iterable[str]) -> list[str]:
    """Methods in the order of the study, families together."""
    chosen = set(names)
    return sorted((name for name in study["methods"] if name in chosen), key=lambda name: family(study, name))


def cells(study: Study, **wanted: str) -> list[Row]:
    """The cells with these properties."""
    return [row for row in study["cells"] if all(row[key] == value for key, value in wanted.items())]


def lines(study: Study) -> list[tuple[tuple[str, str, str], dict[str, Row]]]:
    """(method, settings, augmentation) and the cells of each protocol: the lines of the main table."""
    found: dict[tuple[str, str, str], dict[str, Row]] = {}
    for row in study["cells"]:
        found.setdefault((row["method"], row["settings"], row["augmentation"]), {})[row["protocol"]] = row
    order = in_order(study, {row["method"] for row in study["cells"]})
    return sorted(found.items(), key=lambda line: (order.index(line[0][0]), SETTINGS.index(line[0][1])))


def published(study: Study, method: str, augmentation: str) -> float | None:
    """The paper's figure for a method, None where the paper has none."""
    rows = cells(study, method=method, augmentation=augmentation)
    return next((float(row["published"]) for row in rows if row["published"] is not None), None)


def matrices(study: Study) -> list[Row]:
    """Of each method the cell whose confusion matrix is shown: people never seen, tuned, shifted copies."""
    shown = cells(study, protocol="participants", settings="tuned", augmentation="shift", data="simulated")
    order = in_order(study, {row["method"] for row in shown})
    return sorted(shown, key=lambda row: order.index(row["method"]))
