"""The tables of what the study is made of: methods, data, tuning, open choices, what was left out, the machine."""

from . import formats, marks, reading
from .layout import SIMULATED, cell, folded, heads, paragraph, row_head, scrolling, table
from .markup import Markup, join, tag
from .reading import Row, Study

MACHINE = {
    "cpu": "Processor",
    "cores": "Cores",
    "memory_gib": "Memory, GiB",
    "system": "System",
    "python": "Python",
    "numpy": "NumPy",
    "torch": "PyTorch",
    "sklearn": "scikit-learn",
    "onnxruntime": "ONNX Runtime",
    "date": "Date",
    "minutes": "Minutes of computing",
}


def methods(study: Study) -> Markup:
    known = study.get("methods") or {}
    lines = []
    for method in reading.in_order(study, set(known)):
        about = known[method]
        hyper = about.get("hyperparameters") or {}
        lines.append(
            [
                row_head(
                    tag(
                        "span",
                        marks.swatch(study, method),
                        tag("span", reading.full_title(study, method)),
                        class_="named",
                    )
                ),
                cell(about.get("family", ""), class_="short"),
                cell(about.get("what", ""), class_="prose"),
                cell(_settings(hyper.get("paper")), class_="short"),
                cell(_settings(hyper.get("tuned")), class_="short"),
            ]
        )
    columns = heads("Method", "Family", "What it does", "The paper's settings", "Tuned")
    return table("All methods", "", "All on the front end that the daemon uses.", columns, lines)


def _settings(found: Row | None) -> Markup:
    """Hyperparameters; where they depend on the augmentation, also those that differ from the first ones."""
    if not found or not all(isinstance(value, dict) for value in found.values()):
        return formats.values(found)
    (_, first), *others = found.items()
    differing = [(name, values) for name, values in others if values != first]
    return join(formats.values(first), *(join("; ", name, ": ", formats.values(values)) for name, values in differing))


def data(study: Study) -> Markup:
    found = study.get("data") or {}
    lines = []
    if found.get("simulated"):
        made = found["simulated"]
        cut, performed, lost = (formats.count(made.get(name)) for name in ("cut", "performed", "lost"))
        told = f"{cut} cut of {performed} performed, {lost} lost"
        lines.append(_set("simulated", made, f"{formats.count(made.get('participants'))} participants", told))
    if found.get("real"):
        real = found["real"]
        told = f"{formats.count(real.get('gestures'))} gestures, {formats.count(real.get('non_gestures'))} others"
        lines.append(_set("real", real, f"{formats.count(real.get('subjects'))} subjects", told))
    for own in found.get("own") or []:
        told = f"{formats.count(own.get('used'))} used of {formats.count(own.get('recordings'))} recordings"
        lines.append([row_head(own["file"]), cell("your own"), cell(formats.NONE), cell(told)])
    columns = heads("Name", "Kind", "People", "Gestures")
    out = found.get("left_out") or []
    rest = _left_out(out) if out else paragraph("Nothing was left out: every recording was used.")
    return join(table("What was used", "", "", columns, lines), rest)


def _set(kind: str, row: Row, people: str, told: str) -> list[Markup]:
    return [row_head(row["name"]), cell(kind), cell(people), cell(told)]


def _left_out(rows: list[Row]) -> Markup:
    lines = []
    for row in rows:
        number = formats.NONE if row.get("recording") is None else str(row["recording"])
        lines.append(
            [
                row_head(row["file"]),
                cell(number),
                cell(row["field"]),
                cell(row["reason"], class_="prose"),
            ]
        )
    columns = heads("File", "Recording", "Field", "Reason")
    title = f"Left out: {formats.count(len(rows))} " + (
        "recording or file" if len(rows) == 1 else "recordings or files"
    )
    return table(title, "", "Everything else was used.", columns, lines)


def tuning(study: Study) -> Markup:
    """What was chosen, in one table; every candidate of each method, folded."""
    lines, more = [], []
    for row in reading.part(study, "tuning"):
        best = next((tried for tried in row["candidates"] if tried["values"] == row["chosen"]), None)
        right = _spread(best) if best else cell(formats.NONE)
        count = cell(str(len(row["candidates"])), value=len(row["candidates"]))
        lines.append(
            [
                row_head(marks.named(study, row["method"])),
                cell(formats.values(row["chosen"]), class_="short"),
                right,
                count,
            ]
        )
        more.append(_candidates(study, row))
    columns = heads("Method", "Chosen", "Right, %", "Candidates")
    caption = "Five-fold cross-validation with participants left out; the mean over the folds, and their spread."
    return join(table("What was chosen", SIMULATED, caption, columns, lines), folded("All candidates", *more))


def _candidates(study: Study, row: Row) -> Markup:
    lines = []
    for tried in sorted(row["candidates"], key=lambda tried: -tried["right"]):
        chosen = tried["values"] == row["chosen"]
        lines.append([row_head(formats.values(tried["values"])), _spread(tried), cell("yes" if chosen else "")])
    title = f"Candidates for {reading.title(study, row['method'])}"
    columns = heads("Values", "Right, %", "Chosen")
    return table(title, SIMULATED, "", columns, lines)


def _spread(tried: Row) -> Markup:
    right, spread = tried["right"], tried.get("spread") or 0.0
    drawn = marks.dot({"right": right, "low": max(0.0, right - spread), "high": min(1.0, right + spread)})
    words = join(
        tag("span", formats.percent(right), class_="share"),
        " ",
        tag("span", f"± {formats.percent(spread)}", class_="interval"),
    )
    return cell(words, drawn, value=right, class_="right")


def choices(study: Study) -> Markup:
    lines = []
    for row in reading.part(study, "choices"):
        look = marks.look_of(study, row["method"])
        options = [
            _option(option, option["value"] == row["ours"], f"f{look.family} v0") for option in row["alternatives"]
        ]
        lines.append(
            [
                row_head(row["choice"]),
                cell(row["ours"], class_="short"),
                cell(tag("ul", *options, class_="options")),
                cell(marks.named(study, row["method"])),
                cell(row["effect"], class_="prose"),
            ]
        )
    columns = heads("Choice", "Ours", "Alternatives: right, %", "Measured with", "Effect")
    caption = "What the paper does not say, what we took, and what another choice would have given; ours is in bold."
    return table("Choices that the paper leaves open", SIMULATED, caption, columns, lines)


def _option(option: Row, ours: bool, classes: str) -> Markup:
    name = tag("strong" if ours else "span", str(option["value"]), class_="option")
    words = tag(
        "span",
        tag("span", formats.percent(option["right"]), class_="share"),
        " ",
        tag("span", formats.interval(option), class_="interval"),
    )
    return tag("li", name, words, marks.dot(option, classes))


def machine(study: Study) -> Markup:
    found = study.get("machine") or {}
    pairs = [(words, found[name]) for name, words in MACHINE.items() if found.get(name) is not None]
    facts = [join(tag("dt", words), tag("dd", formats.number(value))) for words, value in pairs]
    return join(tag("dl", *facts, class_="facts"), tag("h3", "How to make it again"), _again(study))


def _again(study: Study) -> Markup:
    about = study.get("about") or {}
    command = tag("pre", tag("code", str(about.get("command", ""))))
    words = f"gestured {about.get('version', '')}, seed {about.get('seed', '')}. "
    words += "The same seed gives the same numbers; run times are the machine's."
    return join(scrolling("The command that made this report", command), paragraph(words))
