"""The report in a few plain sentences, all computed from the study."""

from . import formats, reading
from .markup import Markup, between, join, tag
from .reading import Row, Study

FEW = 20  # gestures: a group smaller than this is not called the weakest
PROTOCOLS = {
    "paper": "under the paper's own protocol",
    "clean": "augmented after the split",
    "participants": "on people never seen",
}


def findings(study: Study) -> dict[str, Markup]:
    """What one would tell a colleague: a word in the margin, and the sentence. What was not computed is left out."""
    told = {
        "Reproduces": _reproduced(study),
        "Falls short": _missed(study, "Lower", -1),
        "Does better": _missed(study, "Higher", 1),
        "Augmentation": _copies(study),
        "Best": _best(study),
        "Real fingers": _real(study),
        "Run time": _fast(study),
        "In use": _online(study),
        "Weakest": _weak(study),
    }
    return {word: sentence for word, sentence in told.items() if sentence}


def compared(study: Study, protocol: str) -> list[Row]:
    """Our figures that stand against a published one: with the paper's settings, tuned where there are no others."""
    rows = reading.cells(study, protocol=protocol, data="simulated")
    return [row for row in reading.usual(rows) if row.get("published") is not None]


def _reproduced(study: Study) -> Markup | None:
    told = []
    for protocol, words in PROTOCOLS.items():
        rows = compared(study, protocol)
        if rows:
            good = sum(reading.as_published(row) for row in rows)
            told.append(join(tag("strong", f"{good} of {len(rows)}"), f" {words}"))
    if not told:
        return None
    rule = f"within our 95{formats.THIN}% interval, or {100 * reading.NEAR:.0f} points"
    return join("On simulated data the published figures come out again (", rule, "): ", formats.listed(told), ".")


def _missed(study: Study, word: str, sign: int) -> Markup | None:
    rows = [row for row in compared(study, "participants") if not reading.as_published(row)]
    rows = [row for row in rows if (row["right"] - row["published"]) * sign > 0]
    rows.sort(key=lambda row: -abs(row["right"] - row["published"]))
    if not rows:
        return None
    told = []
    for augmentation, words in (("shift", "with augmentation"), ("none", "without")):
        named = [_change(study, row) for row in rows if row["augmentation"] == augmentation]
        if named:
            told.append(join(words, " ", formats.listed(named)))
    return join(f"{word} than published, on people never seen: ", between("; ", told), ".")


def _change(study: Study, row: Row) -> Markup:
    change = f"{formats.percent(row['published'], 0)} → {formats.percent(row['right'], 0)}"
    return join(reading.title(study, row["method"]), " (", tag("span", change, class_="value"), ")")


def from_copies(row: Row) -> float | None:
    """The share of the gain that is lost when only the training part is augmented; None where nothing is gained."""
    before, after = row.get("gain_leaky"), row.get("gain_clean")
    if before is None or after is None or before <= 0.005:
        return None
    return float(min(1.0, max(0.0, 1.0 - after / before)))


def _copies(study: Study) -> Markup | None:
    rows = [row for row in reading.part(study, "copies") if None not in (row.get("gain_leaky"), row.get("gain_clean"))]
    rows = reading.usual(rows)
    if not rows:
        return None
    before, after = (sum(row[name] for row in rows) / len(rows) for name in ("gain_leaky", "gain_clean"))
    worth = f"Augmenting before the split is worth {formats.points(before)} points in the mean of {len(rows)} methods; "
    parts = [worth, f"augmenting only the training part, {formats.points(after)}. "]
    owed = from_copies({"gain_leaky": before, "gain_clean": after})
    if owed is not None:
        much = tag("strong", f"{formats.with_unit(owed, 0)} of the gain")
        parts.append(
            join("So ", much, " is owed to test gestures that are in the training set too: ", _found(rows), ".")
        )
    return join(*parts)


def _found(rows: list[Row]) -> str:
    """How many of the test gestures are in the training set."""
    test = sum(row["test"] for row in rows) or 1
    copied, moved = (sum(row.get(name) or 0 for row in rows) / test for name in ("with_copy", "with_version"))
    more = f", and {formats.with_unit(moved, 0)} shifted" if moved else ""
    return f"{formats.with_unit(copied, 0)} of them unchanged{more}"


def best(study: Study, paper: bool) -> Row | None:
    """The most often right on people never seen, among the paper's methods or among those beyond it."""
    methods = study.get("methods") or {}
    rows = reading.cells(study, protocol="participants", data="simulated")
    mine = [row for row in rows if bool(methods.get(row["method"], {}).get("paper")) == paper]
    return max(mine, key=lambda row: float(row["right"]), default=None)


def _best(study: Study) -> Markup | None:
    told = []
    for words, paper in (("of the paper's methods ", True), ("of those beyond it ", False)):
        row = best(study, paper)
        if row is not None:
            told.append(join(words, _named(study, row), f" ({_measured(row)})"))
    return join("On simulated people never seen: ", formats.listed(told), ".") if told else None


def _named(study: Study, row: Row) -> Markup:
    return tag("strong", reading.title(study, row["method"]))


def _measured(row: Row) -> str:
    interval = formats.interval(row)
    return formats.with_unit(row["right"]) + (f", {interval}" if interval else "")


def _real(study: Study) -> Markup | None:
    row = max(reading.cells(study, data="real"), key=lambda row: float(row["right"]), default=None)
    if row is None:
        return None
    return join("On real recordings, subjects held out in turn: at best ", _named(study, row), f" ({_measured(row)}).")


def _fast(study: Study) -> Markup | None:
    front = [row for row in reading.part(study, "run_time") if row.get("front")]
    if not front:
        return None
    told = [
        join(_named(study, row), f" ({formats.duration(row['median_us'])}, {formats.with_unit(row['right'])})")
        for row in sorted(front, key=lambda row: float(row["median_us"]))
    ]
    return join("Nothing is both faster and, on simulated data, more often right than ", formats.listed(told), ".")


def _online(study: Study) -> Markup | None:
    rows = sorted(reading.part(study, "online"), key=lambda row: -float(row["right"]))
    if not rows:
        return None
    told = []
    for row in rows:
        published = "" if row.get("published") is None else f", published {formats.percent(row['published'], 0)}"
        told.append(join(_named(study, row), f" ({formats.with_unit(row['right'])}{published})"))
    return join("Right in continuous simulated sessions with the running daemon: ", formats.listed(told), ".")


def _weak(study: Study) -> Markup | None:
    """Where the best of the methods that were looked at fails most."""
    rows = [row for row in reading.part(study, "failures") if row["by"] != "participant" and row["groups"]]
    means = {row["method"]: sum(g["right"] for g in row["groups"]) / len(row["groups"]) for row in rows}
    method = max(means, key=lambda name: means[name], default=None)
    groups = [(g, row["by"]) for row in rows if row["method"] == method for g in row["groups"] if g["n"] >= FEW]
    if method is None or not groups:
        return None
    group, by = min(groups, key=lambda pair: float(pair[0]["right"]))
    where = f" fails most by {by} at “{formats.plain(str(group['name']))}”"
    return join(tag("strong", reading.title(study, method)), where, f" ({_measured(group)}, simulated).")
