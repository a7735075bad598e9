"""The report in a few plain sentences, all computed from the study."""

from collections.abc import Callable

from . import formats, reading
from .markup import Markup, join, tag
from .reading import Row, Study
from .tables import from_copies

FEW = 20  # gestures: a group smaller than this is not called the weakest
PLAIN = {
    "paper": "under the paper's own protocol",
    "clean": "augmented after the split",
    "participants": "on people never seen",
}


def sentences(study: Study) -> list[Markup]:
    """What one would tell a colleague: what reproduces, what does not, what augmentation is worth, what to use."""
    parts: tuple[Callable[[Study], list[Markup]], ...] = (
        _reproduced, _missed, _copies, _best, _real, _fast, _online, _weak,
    )  # fmt: skip
    return [sentence for tell in parts for sentence in tell(study)]


def compared(study: Study, protocol: str) -> list[Row]:
    """Our figures, with the paper's settings, that stand against a published one."""
    rows = reading.cells(study, protocol=protocol, settings="paper", data="simulated")
    return [row for row in rows if row.get("published") is not None]


def _reproduced(study: Study) -> list[Markup]:
    told = []
    for protocol, words in PLAIN.items():
        rows = compared(study, protocol)
        if rows:
            good = sum(reading.as_published(row) for row in rows)
            told.append(join(tag("strong", f"{good} of {len(rows)}"), f" {words}"))
    if not told:
        return []
    near = f"{100 * reading.NEAR:.0f}"
    return [
        join(
            "Published figures that come out on simulated data as the paper gives them (within our 95 % interval or ",
            f"{near} points): ",
            formats.listed(told),
            ".",
        )
    ]


def _missed(study: Study) -> list[Markup]:
    rows = [row for row in compared(study, "participants") if not reading.as_published(row)]
    sentences = []
    for words, wanted in (("Lower", -1), ("Higher", 1)):
        found = [row for row in rows if (row["right"] - row["published"]) * wanted > 0]
        found.sort(key=lambda row: -abs(row["right"] - row["published"]))
        if found:
            named = [
                join(
                    _kind(study, row), f" ({formats.percent(row['published'], 0)} → {formats.percent(row['right'], 0)})"
                )
                for row in found
            ]
            sentences.append(join(f"{words} than published, on people never seen: ", formats.listed(named), "."))
    return sentences


def _kind(study: Study, row: Row) -> str:
    return reading.title(study, row["method"]) + {"none": "", "shift": ", augmented"}.get(row["augmentation"], "")


def _copies(study: Study) -> list[Markup]:
    rows = [
        row
        for row in reading.part(study, "copies")
        if row.get("gain_leaky") is not None and row.get("gain_clean") is not None
    ]
    if not rows:
        return []
    before, after = (sum(row[name] for row in rows) / len(rows) for name in ("gain_leaky", "gain_clean"))
    test, copied = (sum(row[name] for row in rows) for name in ("test", "with_copy"))
    owed = from_copies({"gain_leaky": before, "gain_clean": after})
    much = (
        join(": ", tag("strong", formats.with_unit(owed, 0), " of the gain is owed to copies"), " of test gestures")
        if owed
        else ""
    )
    found = f"; {formats.with_unit(copied / test, 0)} of them have one in the training set" if test else ""
    return [
        join(
            f"Augmenting before the split is worth {formats.points(before)} points in the mean of {len(rows)} ",
            "methods, ",
            f"augmenting only the training part {formats.points(after)}",
            much,
            found,
            ".",
        )
    ]


def best(study: Study, paper: bool) -> Row | None:
    """The most often right on people never seen, among the paper's methods or among those beyond it."""
    methods = study.get("methods") or {}
    rows = reading.cells(study, protocol="participants", data="simulated")
    mine = [row for row in rows if bool(methods.get(row["method"], {}).get("paper")) == paper]
    return max(mine, key=lambda row: float(row["right"]), default=None)


def _best(study: Study) -> list[Markup]:
    told = []
    for words, paper in (("of the paper's methods ", True), ("of those beyond it ", False)):
        row = best(study, paper)
        if row is not None:
            told.append(
                join(words, _named(study, row), f" ({formats.with_unit(row['right'])}, {formats.interval(row)})")
            )
    return [join("Best on simulated people never seen: ", formats.listed(told), ".")] if told else []


def _named(study: Study, row: Row) -> Markup:
    return tag("strong", reading.title(study, row["method"]))


def _real(study: Study) -> list[Markup]:
    row = max(reading.cells(study, data="real"), key=lambda row: float(row["right"]), default=None)
    if row is None:
        return []
    return [
        join(
            "On real recordings, subjects held out in turn: at best ",
            _named(study, row),
            f" with {formats.with_unit(row['right'])} ({formats.interval(row)}).",
        )
    ]


def _fast(study: Study) -> list[Markup]:
    front = sorted(
        (row for row in reading.part(study, "run_time") if row.get("front")), key=lambda row: float(row["median_us"])
    )
    if not front:
        return []
    told = [
        join(_named(study, row), f" ({formats.duration(row['median_us'])}, {formats.with_unit(row['right'])})")
        for row in front
    ]
    one = (
        "Nothing is both faster and more often right than "
        if len(front) > 1
        else "Faster and more often right than all others: "
    )
    return [join(one, formats.listed(told), ".")]


def _online(study: Study) -> list[Markup]:
    rows = reading.part(study, "online")
    if not rows:
        return []
    told = []
    for row in sorted(rows, key=lambda row: -float(row["right"])):
        published = f", published {formats.percent(row['published'], 0)}" if row.get("published") is not None else ""
        told.append(join(reading.title(study, row["method"]), f" {formats.with_unit(row['right'])}{published}"))
    return [
        join("In continuous simulated sessions with the running daemon, right: ", tag("span", "; ".join(told)), ".")
    ]


def _weak(study: Study) -> list[Markup]:
    """Where the best of the methods that were looked at fails most."""
    rows = [row for row in reading.part(study, "failures") if row["by"] != "participant"]
    means = {
        row["method"]: sum(group["right"] for group in row["groups"]) / len(row["groups"])
        for row in rows
        if row["groups"]
    }
    if not means:
        return []
    method = max(means, key=lambda name: means[name])
    groups = [
        (group, row["by"]) for row in rows if row["method"] == method for group in row["groups"] if group["n"] >= FEW
    ]
    if not groups:
        return []
    group, by = min(groups, key=lambda pair: float(pair[0]["right"]))
    where = f"{reading.title(study, method)} fails most at {by} “{formats.plain(str(group['name']))}”"
    return [join(f"{where}: {formats.with_unit(group['right'])} right ({formats.interval(group)}).")]
