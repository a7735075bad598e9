"""Model cards: what a shipped model is, what it learned from, what it is worth and where it ends."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gestured.lab.made_of import kept, made_of, renew
from gestured.lab.manifest import NAME
from gestured.lab.recordings.origin import said
from gestured.lab.train import TrainingPlan
from gestured.model.opening import open_model

WHAT = {
    "cnn_lstm": "Two convolutions with ReLU and max-pooling on each frame, an LSTM of 32 units over the frames (the paper's "
    "CNN-LSTM), and a second opinion: a small net on trajectory features. Both give the scores and the rejection together.",
    "lstm": "An LSTM of 32 units on the 81 taxels of each frame (the paper's LSTM), with the same second opinion, which is not "
    "the paper's.",
    "touch_pattern_rf": "A random forest (200 trees, depth 9) on the paper's touch-pattern features. They ignore the order of "
    "the frames, so it cannot tell a swipe from its reverse; it publishes only where it is sure.",
}
LIMITS = """\
- Not a safety function. A wrong event must not be able to hurt anybody.
- Trained on simulated textile recordings and on real touchscreen recordings; no textile recording was at hand.
- Circles and two-finger swipes are simulated only. Two fingers that the sensor shows as one blob are one finger.
- Gestures that follow each other without the finger leaving for two frames are one segment, and unknown."""


def write_cards(folder: Path, figures: Mapping[str, Mapping[str, Any]], plan: TrainingPlan) -> None:
    """One Markdown file beside each model."""
    for name, found in figures.items():
        (folder / f"{name}.md").write_text(_card(folder / f"{name}.onnx", name, found, plan))


def write_block(document: Path, folder: Path, figures: Mapping[str, Mapping[str, Any]]) -> None:
    """Renew the table of a folder's models in a document; GesturedError where its marks are missing."""
    files = [*(folder / f"{name}.onnx" for name in figures), folder / NAME]
    rows = [row for name, found in figures.items() for row in _rows(found, f"`{name}.onnx`, ")]
    renew(document, "figures", [made_of("gestured-lab evaluate --document docs/figures.md", files), "", *HEAD, *rows])


MEASURED_APART = ("unseen", "judged")  # parts of a card between marks, which experiments write
HEAD = (
    "| set | gestures | right\\* | right | wrong | lost | non-gestures | rejected |",
    "|---|---|---|---|---|---|---|---|",
)


def _card(path: Path, name: str, found: Mapping[str, Any], plan: TrainingPlan) -> str:
    model = open_model(path)
    real = bool(said(path))
    table = "\n".join([*HEAD, *_rows(found)])
    others = "\n\n".join(kept(path.with_suffix(".md"), part) for part in MEASURED_APART)
    return f"""# {name}

{WHAT[name]}

| | |
|---|---|
| version | {model.metadata.version} |
| SHA-256 | `{model.sha256}` |
| size | {model.size:,} bytes |
| gestures | {", ".join(model.gestures)} |
| window | `{model.metadata.window.to_json()}` |
| published from a confidence of | {model.threshold:.3f} |
| training data (SHA-256) | `{model.metadata.training_data}` |

## Data

{plan.wide} takes of the simulator's wide stream, the simulated cohort's participants 0 to 23 (gestures and non-gestures)
{"and the real development recordings of CapFingerId (ten subjects; MIT licence, see NOTICE)" if real else "and no real recordings"}.
Training settings: `{asdict(plan.fit)}`.

## Figures

Printed by `gestured-lab evaluate`. *Simulated* is gestured's own simulator, which made what was
learned from, too, with other seeds: *nominal* the cohort's participants 28 to 33 on the
nominal 9 x 9 sensor, *wide* other people on randomised sensors of every quality, some of them hopeless. *Real* is CapFingerId,
each subject judged by networks that have not seen them (three folds). Shares of the gestures that were performed; *right\\** is
before rejection, *lost* is unknown or never cut out; *rejected* is of the non-gestures. In brackets: 95 % intervals over people.

{table}

{others}

## Limits

{LIMITS}
"""


def _rows(found: Mapping[str, Any], before: str = "") -> list[str]:
    """A row for each set that a model was judged on; `before` stands before its name."""
    sets = {f"simulated, {test}": values for test, values in found["simulated"].items()}
    sets |= {f"real, {test}": values for test, values in found.get("real", {}).items() if test != "kinds"}
    return [_row(f"{before}{title}", values) for title, values in sets.items()]


def _row(title: str, values: Mapping[str, Any]) -> str:
    ends = values["intervals"]
    shares = " | ".join(with_interval(values[n], ends[n]) for n in ("right", "wrong", "lost"))
    rejected = with_interval(values["rejected"], ends["rejected"]) if values["others"] else "-"
    before = f"{values['right_before']:.3f}"
    return f"| {title} | {values['gestures']} | {before} | {shares} | {values['others']} | {rejected} |"


def with_interval(share: float, ends: Mapping[str, float]) -> str:
    """A share and, in brackets, where its interval begins and ends."""
    return f"{share:.3f} ({ends['low']:.3f}–{ends['high']:.3f})"
