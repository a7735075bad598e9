"""Model cards: what a shipped model is, what it learned from, how good it is and what its limits are."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from textwrap import fill
from typing import Any

from jinja2 import Environment, PackageLoader

from gestured.lab.export import NAME
from gestured.lab.fit import REAL_KINDS
from gestured.lab.made_of import kept, made_of, renew
from gestured.lab.recordings.origin import said
from gestured.lab.train import MIXED, REAL_FILES, TrainingPlan
from gestured.lab.written import write
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER
from gestured.simulator import NON_GESTURES


def write_cards(folder: Path, figures: Mapping[str, Mapping[str, Any]], plan: TrainingPlan) -> None:
    """Write one Markdown file beside each model."""
    for name, found in figures.items():
        write(folder / f"{name}.md", _card(folder / f"{name}.onnx", name, found, plan))


def write_blocks(
    documents: Sequence[Path], folder: Path, figures: Mapping[str, Mapping[str, Any]], command: str
) -> None:
    """Renew the tables of a folder's models: `figures` in the first document, `worst` of one model in the others.

    Raises GesturedError if their marks are missing.
    """
    files = [*(folder / f"{name}.onnx" for name in figures), folder / NAME]
    name, found = next(iter(figures.items()))
    tables = [*table(figures), "", *_worst(figures), "", *_by_kind(name, found)]
    renew(documents[0], "figures", [made_of(command, files), "", *tables])
    for document in documents[1:]:
        renew(document, "worst", [made_of(command, files[:1]), "", *_worst({name: found})])


def table(figures: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A row for each model and each set that it was judged on."""
    return [*head(), *(line for name, found in figures.items() for line in _rows(found, f"`{name}.onnx`, "))]


def _worst(figures: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """For each model and set, the worst gesture, person and kind of non-gesture."""
    lines = [f"| the worst | {' | '.join(SETS)} |", f"|---{'|---' * len(SETS)}|"]
    for name, found in figures.items():
        sets = [*(found["simulated"].get(test, {}) for test in ("nominal", "wide")), found.get("real", {}).get(MIXED)]
        for title, words in WORST_OF.items():
            cells = [(of or {}).get("worst", {}).get(title) for of in sets]
            told = " | ".join(f"{one[0]} {one[1]:.3f} of {one[2]}" if one else "-" for one in cells)
            lines.append(f"| {f'`{name}`: ' if len(figures) > 1 else ''}{words} | {told} |")
    return lines


def _by_kind(name: str, found: Mapping[str, Any]) -> list[str]:
    """The share of each kind of non-gesture that is rejected: a table, the worst kind first."""
    sets = {f"simulated, {test}": values["kinds"] for test, values in found["simulated"].items()}
    if real := found.get("real", {}).get("kinds"):
        sets["real"] = {REAL_KINDS.get(kind, ""): share for kind, share in real.items()}
    shares = {kind: [of.get(kind) for of in sets.values()] for kind in NON_GESTURES}
    least = {kind: min(known) for kind, row in shares.items() if (known := [one for one in row if one is not None])}
    worst = sorted(least, key=least.__getitem__)
    cells = {kind: " | ".join("-" if one is None else f"{one:.3f}" for one in shares[kind]) for kind in worst}
    rest = fill(f"{', '.join(worst[WORST:]) or 'none'}.", 118).splitlines()
    return [
        f"| non-gestures rejected by `{name}.onnx` | {' | '.join(sets)} |",
        f"|---{'|---' * len(sets)}|",
        *(f"| {kind} | {cells[kind]} |" for kind in worst[:WORST]),
        "",
        f"Of each other kind at least {min((least[kind] for kind in worst[WORST:]), default=1.0):.3f} is rejected:",
        *rest,
    ]


PUBLIC_DATA = "the real development recordings of CapFingerId (ten subjects; MIT licence, see NOTICE)"
SETS = ("simulated, nominal", "simulated, wide", "real")
WORST_OF = {
    "gesture": "gesture, named rightly",
    "person": "person, named rightly",
    "non-gesture": "non-gesture, rejected",
}
WORST = 12  # kinds of non-gestures that have a row; always as many, since a table may not lose rows
# Marked parts of a card that experiments write: of every model, and of the first one.
OF_ALL, OF_THE_FIRST = ("judged",), ("unseen", "seeds", "judged")


def _card(path: Path, name: str, found: Mapping[str, Any], plan: TrainingPlan) -> str:
    templates = Environment(loader=PackageLoader("gestured.lab", "."), keep_trailing_newline=True)
    blank = "<!-- {0}: begin -->\n<!-- {0}: end -->"
    parts = OF_THE_FIRST if name == LADDER[0] else OF_ALL
    apart = [kept(path.with_suffix(".md"), part) or blank.format(part) for part in parts]
    return templates.get_template("card.md").render(
        name=name, model=open_model(path), plan=plan, settings=asdict(plan.fit), recordings=_recordings(path),
        public=PUBLIC_DATA, table=[*head(), *_rows(found)], others=apart,
    )  # fmt: skip


def _recordings(path: Path) -> str:
    """The real recordings that a model learned from."""
    files = [one.file for one in said(path) or []]
    own = [file for file in files if file not in REAL_FILES]
    parts = [PUBLIC_DATA] if len(own) < len(files) else []
    parts += [f"recordings of one's own ({', '.join(own)})"] if own else []
    return " and ".join(parts) or "no real recordings"


def _rows(found: Mapping[str, Any], before: str = "") -> list[str]:
    """A row for each set that a model was judged on; `before` precedes its name."""
    sets = {f"simulated, {test}": values for test, values in found["simulated"].items()}
    sets |= {f"real, {test}": values for test, values in found.get("real", {}).items() if test != "kinds"}
    return [row(f"{before}{title}", values) for title, values in sets.items()]


def head(of: str = "set") -> tuple[str, str]:
    """The head of a table whose lines are those of `row`."""
    names = (of, "gestures", "right\\*", "right", "wrong", "lost", "non-gestures", "rejected")
    return f"| {' | '.join(names)} |", f"|{'---|' * len(names)}"


def row(title: str, values: Mapping[str, Any]) -> str:
    """The line of one set, of an `Evaluation` as a dictionary."""
    ends = values["intervals"]
    # What each is a share of; without any of these it is NaN, or null in JSON.
    of = {"right": "gestures", "wrong": "gestures", "lost": "gestures", "rejected": "others"}
    *shares, rejected = (with_interval(values[n], ends[n]) if values[of[n]] else "-" for n in of)
    before = f"{values['right_before']:.3f}" if values["gestures"] else "-"
    return f"| {title} | {values['gestures']} | {before} | {' | '.join(shares)} | {values['others']} | {rejected} |"


def with_interval(share: float, ends: Mapping[str, float]) -> str:
    """A share and, in brackets, the ends of its interval."""
    return f"{share:.3f} ({ends['low']:.3f}–{ends['high']:.3f})"
