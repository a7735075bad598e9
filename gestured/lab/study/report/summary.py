"""What the summary's sentences say, computed from the study; the sentences stand in summary.html."""

from . import reading
from .reading import Row, Study

FEW = 20  # gestures: a group smaller than this is not called the weakest
PROTOCOLS = {
    "paper": "under the paper's own protocol",
    "clean": "augmented after the split",
    "participants": "on people never seen",
}


def compared(study: Study, protocol: str) -> list[Row]:
    """Our figures that stand against a published one: with the paper's settings, tuned where there are no others."""
    rows = reading.cells(study, protocol=protocol, data="simulated")
    return [row for row in reading.usual(rows) if row.get("published") is not None]


def reproduced(study: Study) -> dict[str, tuple[int, int]]:
    """How many of how many figures come out again, in the words for each protocol."""
    found = {words: compared(study, protocol) for protocol, words in PROTOCOLS.items()}
    return {words: (sum(map(reading.as_published, rows)), len(rows)) for words, rows in found.items() if rows}


def apart(study: Study, sign: int) -> dict[str, list[Row]]:
    """What is lower (-1) or higher (1) than published on people never seen, the farthest first."""
    rows = [row for row in compared(study, "participants") if not reading.as_published(row)]
    rows = [row for row in rows if (row["right"] - row["published"]) * sign > 0]
    rows.sort(key=lambda row: -abs(row["right"] - row["published"]))
    words = {"with augmentation": "shift", "without": "none"}
    found = {said: [row for row in rows if row["augmentation"] == name] for said, name in words.items()}
    return {said: of for said, of in found.items() if of}


def copies(study: Study) -> Row | None:
    """The gains in the mean of the methods, what of them is owed to copies, and how many copies there are."""
    rows = [row for row in reading.part(study, "copies") if None not in (row.get("gain_leaky"), row.get("gain_clean"))]
    rows = reading.usual(rows)
    if not rows:
        return None
    mean: Row = {name: sum(row[name] for row in rows) / len(rows) for name in ("gain_leaky", "gain_clean")}
    test = sum(row["test"] for row in rows) or 1
    found = {name: sum(row.get(name) or 0 for row in rows) / test for name in ("with_copy", "with_version")}
    return {**mean, **found, "methods": len(rows), "owed": reading.from_copies(mean)}


def best(study: Study) -> dict[str, Row]:
    """The most often right on people never seen, among the paper's methods and among those beyond it."""
    methods, rows = study.get("methods") or {}, reading.cells(study, protocol="participants", data="simulated")
    words = {"of the paper's methods": True, "of those beyond it": False}
    found = {
        said: [row for row in rows if bool(methods.get(row["method"], {}).get("paper")) == paper]
        for said, paper in words.items()
    }
    return {said: max(of, key=lambda row: float(row["right"])) for said, of in found.items() if of}


def weakest(study: Study) -> Row | None:
    """The group where the best of the methods that were looked at fails most."""
    rows = [row for row in reading.part(study, "failures") if row["by"] != "participant" and row["groups"]]
    means = {row["method"]: reading.mean(row) for row in rows}
    method = max(means, key=lambda name: means[name], default=None)
    groups = [{**g, **row} for row in rows if row["method"] == method for g in row["groups"] if g["n"] >= FEW]
    return min(groups, key=lambda group: float(group["right"]), default=None)
