"""What the rooms of the report ask of a study."""

from collections.abc import Iterable
from typing import Any

from . import formats

Study = dict[str, Any]
Row = dict[str, Any]

FAMILIES = (
    "spatio-temporal features", "touch-pattern features", "motion history image", "recurrent", "beyond the paper",
)  # fmt: skip
PROTOCOLS = ("paper", "padded", "clean", "participants", "real", "foreign", "online")
AUGMENTATIONS = {"none": "no augmentation", "shift": "shifted (Algorithm 1)", "wide": "wide randomisation"}
SETTINGS = {"paper": "the paper's", "tuned": "tuned", "shipped": "ships"}
SHORT = {" features, ": " ", "k nearest neighbours": "KNN", "support vector machine": "SVM", " (RBF)": ""}  # in figures
KINDS = ("gesture", "participant", "signal to noise", "speed", "inclination", "hand size", "pressure", "place")
NEAR = 0.05  # a figure this close to the published one counts as reproduced


def part(study: Study, name: str) -> list[Row]:
    """A list of the study; empty where it was not computed."""
    return [row for row in study.get(name) or [] if row.get("right", 0.0) is not None]


def title(study: Study, method: str) -> str:
    """A method's name, as short as it is clear."""
    name = str((study.get("methods") or {}).get(method, {}).get("title", method))
    for words, fewer in SHORT.items():
        name = name.replace(words, fewer)
    return name


def family(study: Study, method: str) -> int:
    """The number of a method's family, for its colour and form; the last one for what is not known."""
    name = (study.get("methods") or {}).get(method, {}).get("family")
    return FAMILIES.index(name) if name in FAMILIES else len(FAMILIES) - 1


def family_name(study: Study, method: str) -> str:
    """The name of a method's family."""
    return FAMILIES[family(study, method)]


def in_order(study: Study, names: Iterable[str]) -> list[str]:
    """Methods in the order of the study, families together; unknown ones at the end."""
    names = set(names)
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


def protocols(rows: list[Row]) -> dict[str, str]:
    """The protocols that some cells have, each with the data that it was measured on."""
    data = {name: sorted({row["data"] for row in rows if row["protocol"] == name}) for name in PROTOCOLS}
    return {name: " and ".join(of) + " data" for name, of in data.items() if of}


def lines(study: Study, rows: list[Row]) -> list[tuple[tuple[str, str, str], dict[str, Row]]]:
    """(method, settings, augmentation) and the cells of each protocol: the lines of a table."""
    found: dict[tuple[str, str, str], dict[str, Row]] = {}
    for row in rows:
        found.setdefault((row["method"], row["settings"], row["augmentation"]), {})[row["protocol"]] = row
    order = in_order(study, {row["method"] for row in rows})
    return sorted(found.items(), key=lambda line: (order.index(line[0][0]), list(SETTINGS).index(line[0][1])))


def published(study: Study, method: str, augmentation: str) -> float | None:
    """The paper's figure for a method, None where the paper has none."""
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


def most_often(matrix: list[list[int]], names: list[str]) -> str:
    """The two gravest confusions of a matrix, in words."""
    wrong = [
        (count / sum(counts), count, sum(counts), j, k)
        for j, counts in enumerate(matrix)
        for k, count in enumerate(counts)
        if j != k and count
    ]
    told = [
        f"{formats.plain(names[j])} taken for {formats.plain(names[k])} ({count} of {total})"
        for _, count, total, j, k in sorted(wrong, reverse=True)[:2]
    ]
    return "Most often: " + ", then ".join(told) + "." if told else "No gesture is taken for another."


def group_names(rows: list[Row]) -> list[str]:
    """The groups of some rows of failures, each once."""
    return list(dict.fromkeys(str(group["name"]) for row in rows for group in row["groups"]))


def lowest(study: Study, rows: list[Row]) -> str:
    """The group that is least often right, in words."""
    row, group = min(
        ((row, group) for row in rows for group in row["groups"]), key=lambda pair: float(pair[1]["right"])
    )
    name = f"{formats.plain(group['name'])}, {title(study, row['method'])}"
    return f"Lowest: {name}, {formats.with_unit(group['right'])} of {formats.count(group['n'])}."


def mean(row: Row) -> float:
    """The mean share over the groups of a row."""
    return float(sum(group["right"] for group in row["groups"]) / len(row["groups"]))


def failures(study: Study) -> dict[str, list[Row]]:
    """The rows that have groups, under the title of each way of looking, in the order of KINDS."""
    rows = [row for row in part(study, "failures") if row["groups"]]
    kinds = dict.fromkeys([*KINDS, *(row["by"] for row in rows)])
    found = {kind: [row for row in rows if row["by"] == kind] for kind in kinds}
    return {f"By {kind}" + " on the sensor" * (kind == "place"): of for kind, of in found.items() if of}


def best_of_families(study: Study) -> list[str]:
    """Of each family the method with the highest mean over the groups of the first way of looking."""
    rows = part(study, "failures")
    first = [row for row in rows if row["by"] == rows[0]["by"] and row["groups"]]
    means = {row["method"]: mean(row) for row in first}
    best = {family(study, method): method for method in sorted(means, key=lambda name: means[name])}
    return in_order(study, set(best.values()))


def from_copies(row: Row) -> float | None:
    """The share of the gain that is lost when only the training part is augmented; None where nothing is gained."""
    before, after = row.get("gain_leaky"), row.get("gain_clean")
    if before is None or after is None or before <= 0.005:
        return None
    return float(min(1.0, max(0.0, 1.0 - after / before)))


def lowest_drawn(found: dict[str, list[Row]], shown: list[str]) -> float:
    """Where the axis of all groups of the drawn methods begins."""
    drawn = (group for rows in found.values() for row in rows if row["method"] in shown for group in row["groups"])
    return below(min(ends(group)[0] for group in drawn))


def group(rows: list[Row], method: str, name: str) -> Row | None:
    """The group of this name in a method's row of failures."""
    groups = (group for row in rows if row["method"] == method for group in row["groups"])
    return next((group for group in groups if str(group["name"]) == name), None)


def matrices(study: Study) -> list[Row]:
    """Of each method the cell whose confusion matrix is shown: new people first, then tuned, most augmented."""
    first = (
        ("participants", "clean", "paper", "padded", "real", "foreign", "online"),
        ("tuned", "paper"),
        ("wide", "shift", "none"),
    )
    keys = ("protocol", "settings", "augmentation")
    drawn = [row for row in cells(study) if row.get("confusion")]
    drawn.sort(key=lambda row: [order.index(row[key]) for order, key in zip(first, keys, strict=True)])
    best = {row["method"]: row for row in reversed(drawn)}
    return [best[method] for method in in_order(study, best)]
