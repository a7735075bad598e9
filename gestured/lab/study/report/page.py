"""The page: what stands where, in which words, and what is said of a part that is missing."""

from importlib.resources import files
from pathlib import Path

from . import (
    curves,
    figures_calibration,
    figures_failures,
    figures_right,
    figures_signal,
    figures_time,
    reading,
    summary,
    tables,
    tables_about,
    tables_right,
)
from .layout import Section, absent, folded, paragraph
from .markup import Markup, join, tag
from .reading import Study

TITLE = "Ten gestures on a textile"


def write_report(study: Study, out: Path) -> Path:
    """Write out/index.html: one page that needs nothing else and no network. Returns its path.

    `study` is what `gestured-lab study` writes as study.json. Parts that are null, empty or absent are left out
    with a sentence.
    """
    out.mkdir(parents=True, exist_ok=True)
    path = out / "index.html"
    path.write_text("<!doctype html>\n" + _page(study) + "\n", encoding="utf-8")
    return path


def _page(study: Study) -> Markup:
    sections = _sections(study)
    links = [tag("li", tag("a", section.title, href=f"#{section.name}")) for section in sections]
    contents = tag("nav", tag("h2", "Contents"), tag("ol", *links), aria_label="Contents")
    main = tag("main", _opening(study), contents, *(section.markup() for section in sections))
    style, script = (Markup((files(__package__) / name).read_text("utf-8")) for name in ("style.css", "sort.js"))
    top = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", f"{TITLE}: report of gestured-lab study"),
        tag("style", style),
    )
    return tag("html", top, tag("body", main, tag("script", script)), lang="en")


def _opening(study: Study) -> Markup:
    about, machine = study.get("about") or {}, study.get("machine") or {}
    facts = [f"gestured {about.get('version', '')}", f"seed {about.get('seed', '')}", str(machine.get("date", ""))]
    quick = (
        paragraph(
            tag("strong", "A quick run."),
            " Little data and little training, to see that all works: its figures say nothing of the methods.",
            class_="notice",
        )
        if about.get("quick")
        else Markup("")
    )
    found = [join(tag("dt", word), tag("dd", words)) for word, words in summary.findings(study).items()]
    told = tag("dl", *found, class_="findings") if found else absent("The comparison with the paper was")
    return join(
        tag(
            "header",
            paragraph("gestured-lab study", class_="kicker"),
            tag("h1", TITLE),
            paragraph(
                "Every method of the paper measured again, and some beyond it: what reproduces, and what does not.",
                class_="lead",
            ),
            paragraph(" · ".join(fact for fact in facts if fact), class_="byline"),
        ),
        quick,
        tag("section", tag("h2", "Summary"), _figures_are(study), told, id="summary"),
    )


def _figures_are(study: Study) -> Markup:
    real = bool((study.get("data") or {}).get("real"))
    words = "All figures come from a simulator and are figures about it"
    words += ", but for those that are marked as real recordings." if real else ": no real recording was used."
    return paragraph(words, class_="aside")


def _sections(study: Study) -> list[Section]:
    drawn = {
        "figures": ("The paper's figures and ours", "cells", "The tables of the paper were", _figures),
        "copies": ("Augmentation and copies", "copies", "Copies of test gestures were", tables.copies),
        "online": ("Online", "online", "Sessions with the running daemon were", tables.online),
        "gestures": ("The gestures and their signals", "about", "The gestures were", _gestures),
        "confusion": ("Which gesture for which", "cells", "Confusions were", _confusion),
        "run-time": ("Error against run time", "run_time", "Run times were", _run_time),
        "elapsed": ("Before the gesture has ended", "elapsed", "Error against elapsed time was", curves.elapsed),
        "failures": ("Where it fails", "failures", "Where the methods fail was", figures_failures.failures),
        "calibration": ("How sure it is", "calibration", "Calibration was", figures_calibration.calibration),
        "learning": ("How many people it takes", "learning", "Learning curves were", curves.learning),
        "methods": ("The methods", "methods", "Methods were", tables_about.methods),
        "tuning": ("Tuning", "tuning", "Hyperparameters were", tables_about.tuning),
        "choices": ("What the paper leaves open", "choices", "The effects of open choices were", tables_about.choices),
        "data": ("The data", "data", "The data were", tables_about.data),
        "machine": ("The machine, and how to make this again", "about", "The machine was", tables_about.machine),
    }
    return [
        Section(name, title, draw(study) if study.get(part) else absent(words))
        for name, (title, part, words, draw) in drawn.items()
    ]


def _figures(study: Study) -> Markup:
    explained = [join(tag("dt", name), tag("dd", words)) for name, words in reading.PROTOCOLS.items()]
    return join(
        figures_right.overview(study),
        tag("h3", "What the protocols are"),
        tag("dl", *explained, class_="protocols"),
        tag("h3", "The tables"),
        tables_right.protocols(study),
        tables_right.own(study),
    )


def _confusion(study: Study) -> Markup:
    if not any(row.get("confusion") for row in reading.cells(study)):
        return absent("Confusion matrices were")
    words = "Rows are what was performed, columns what was answered, in per cent of the row; all are in study.json."
    return join(paragraph(words), figures_right.confusions(study))


def _run_time(study: Study) -> Markup:
    return join(figures_time.run_time(study), folded("All points in figures", tables.run_time(study)))


def _gestures(study: Study) -> Markup:
    signals, tap = study.get("signals") or {}, study.get("double_tap")
    cards = figures_signal.gestures(list(study["about"].get("gestures") or []), signals)
    told = [] if signals else [absent("Signals were")]
    return join(cards, *told, figures_signal.double_tap(tap) if tap else absent("A double tap's snapshots were"))
