"""Non-gestures of kinds that were not learned: how many are rejected if heads alone, or whole networks, lack them.

    python -m experiments.unseen --real FOLDER --document docs/figures.md
    python -m experiments.unseen --whole --real FOLDER --document docs/figures.md

With --whole a network and its second opinion are trained without a group of kinds; an interrupted training can be
continued. With --document the tables of that page and of the network's card are written anew.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.heads import Heads
from experiments.pages import command
from experiments.trained import options, trained
from gestured.lab.adapt.learning import opinions
from gestured.lab.augment import symmetry_table
from gestured.lab.cards import with_interval
from gestured.lab.decide import Answers, confidence
from gestured.lab.evaluate import Evaluation, model_answers, outcome
from gestured.lab.fit import CLASSES, targets
from gestured.lab.intervals import interval
from gestured.lab.made_of import made_of, renew
from gestured.lab.samples import Samples
from gestured.lab.train import Trained, TrainingData, TrainingPlan, calibration_set, judged, learn
from gestured.model.opening import open_model
from gestured.simulator import GESTURES

NAME = "cnn_lstm"  # the network that is judged
# Kinds of non-gestures that are held out in turn. A new kind is added at the end of a group, so that published figures
# keep their meaning.
GROUPS = (
    ("arc", "corner", "electrical_burst", "heel_rest", "object_put_down", "press_and_slide", "scribble", "spike",
     "taps_apart", "two_finger_swipe_right", "wipe"),
    ("back_and_forth", "diagonal_swipe", "figure_eight", "knuckles", "palm", "rotation", "sleeve_brush", "spiral",
     "three_finger_swipe", "two_finger_tap", "wrinkle"),
    ("check_mark", "drumming", "forearm", "long_press", "pinch", "rubbing", "slow_touch", "spread",
     "two_finger_swipe_left", "wave", "zigzag"),
)  # fmt: skip
WHOLE = 0  # the group that whole networks are trained without: the first one, chosen before any was trained


def group_of(number: int) -> list[int]:
    """The classes of one of `GROUPS`."""
    return [CLASSES.index(kind) for kind in GROUPS[number]]


def untaught(classes: Sequence[int]) -> list[int]:
    """The classes among `classes` into which training turns or mirrors no other class.

    A swipe of two fingers to the right is an upward one, turned: a network that learns one of them has seen the other.
    """
    left = set(classes)
    table = symmetry_table(CLASSES).numpy()
    while taught := {int(k) for i in range(len(CLASSES)) if i not in left for k in table[:, i]} & left:
        left -= taught
    return sorted(left)


def without_kinds(data: TrainingData, classes: Sequence[int]) -> TrainingData:
    """The data without these classes in what teaches and calibrates; what judges keeps them."""

    def kept(samples: Samples) -> NDArray[np.bool_]:
        return ~np.isin(targets(samples), classes)

    teach = kept(data.teach)
    left = replace(
        data,
        teach=data.teach.take(teach),
        nominal=int(teach[len(teach) - data.nominal :].sum()),
        calibrate=data.calibrate.take(kept(data.calibrate)),
    )
    if data.real is None:
        return left
    real = kept(data.real)
    return replace(left, real=data.real.take(real), real_judged=int(real[: data.real_judged].sum()))


class Said(NamedTuple):
    """Answers on a test set, and the classes of non-gestures that are judged."""

    test: str
    answers: Answers
    samples: Samples
    least: float  # confidence from which answers are published
    classes: Sequence[int]

    def judged(self, performed: int) -> Evaluation:
        """Judge the answers to all gestures, and to these non-gestures alone."""
        labels = targets(self.samples)
        chosen = ((labels >= 0) & (labels < len(GESTURES))) | np.isin(labels, self.classes)
        scores, unknown = self.answers
        of = self.samples.people[chosen]
        return outcome((scores[chosen], unknown[chosen]), labels[chosen], self.least, performed, of)


def rejected(found: Sequence[Said]) -> dict[str, Any]:
    """The share of those non-gestures that was rejected, with its 95 % interval over people, and that of each kind."""
    labels, people, hit = [], [], []
    for said in found:
        known = targets(said.samples)
        chosen = np.isin(known, said.classes)
        labels.append(known[chosen])
        people.append(said.samples.people[chosen])
        hit.append((confidence(said.answers) < said.least)[chosen])
    classes, hits = np.concatenate(labels), np.concatenate(hit)
    share, low, high = interval(hits, np.concatenate(people))
    kinds = {CLASSES[k]: round(float(hits[classes == k].mean()), 3) for k in np.unique(classes)}
    return {"rejected": share, "low": low, "high": high, "count": len(hits), "kinds": kinds}


def held_out_kinds(trained: Trained, data: TrainingData, plan: TrainingPlan) -> dict[str, Any]:
    """How non-gestures of kinds that heads and calibration have not seen are rejected: three groups in turn."""
    heads = Heads.of(trained, data, plan, NAME)
    groups = [group_of(number) for number in range(len(GROUPS))]
    return rejected([Said(*given, classes) for classes in groups for given in heads.without(classes, plan)])


def whole_left_out(trained: Trained, data: TrainingData, plan: TrainingPlan, cache: Path, path: Path) -> dict[str, Any]:
    """How non-gestures are rejected of which a network, its second opinion and its calibration have seen none.

    Beside it are the figures of heads and calibration alone without these kinds, and of the model in `path`, which
    knows them, each with its shares of the gestures. The training is kept in `cache`.
    """
    classes = untaught(group_of(WHOLE))
    print(f"{NAME} and {len(classes)} kinds of non-gestures: {', '.join(CLASSES[k] for k in classes)}", flush=True)
    less = without_kinds(data, classes)
    model = open_model(path)
    answers = {
        "known": [Said(test, model_answers(model, s), s, model.threshold, classes) for test, s in data.tests.items()],
        "heads": [Said(*given, classes) for given in Heads.of(trained, data, plan, NAME).without(classes, plan)],
        "whole": _answers(learn(plan, less, cache, (NAME, "trajectory")), less, plan, classes),
    }
    found: dict[str, Any] = {"kinds": [CLASSES[k] for k in classes]}
    for how, said in answers.items():
        found[how] = rejected(said)
        found[how]["simulated"] = {one.test: asdict(one.judged(data.performed[one.test])) for one in said}
    return found


def _answers(trained: Trained, data: TrainingData, plan: TrainingPlan, classes: Sequence[int]) -> list[Said]:
    """The answers on the test sets of a network that was trained and calibrated on these data."""
    module, calibration, _ = judged(trained, NAME, calibration_set(trained, data))
    least = calibration["threshold"]
    return [
        Said(test, opinions(module, samples).answers(module.decision, module.verifier), samples, least, classes)
        for test, samples in data.tests.items()
    ]


TAUGHT = {
    "known": "nothing: the model that ships",
    "heads": "heads and calibration; the network below the heads has learned them",
    "whole": "everything: network, second opinion, heads and calibration",
}


def lines_of(heads: Mapping[str, Any], whole: Mapping[str, Any] | None) -> list[str]:
    """Lines about non-gestures of kinds that were not learned: by the heads, and by the whole network."""
    lines = [
        "Non-gestures of kinds that heads and calibration had not seen, while the network below the heads had (three",
        f"groups of kinds in turn, {heads['count']} simulated segments): "
        f"{with_interval(heads['rejected'], heads)} rejected.",
    ]
    if whole is None:
        return lines
    tests = list(whole["whole"]["simulated"])
    lines += [
        "", f"One group of kinds ({', '.join(whole['kinds'])}) was then left out of everything: networks were trained "
        "from nothing without them, by the plan of those that ship, and calibrated without them. The share that is "
        f"rejected is of {whole['whole']['count']} simulated segments of these kinds; right and wrong are of all "
        "gestures:", "",
        f"| these kinds were left out of | rejected | {' | '.join(f'{t}: right | wrong' for t in tests)} |",
        f"|---|---|{'---|' * 2 * len(tests)}",
    ]  # fmt: skip
    for how, words in TAUGHT.items():
        sets = [whole[how]["simulated"][test] for test in tests]
        shares = " | ".join(with_interval(one[n], one["intervals"][n]) for one in sets for n in ("right", "wrong"))
        lines.append(f"| {words} | {with_interval(whole[how]['rejected'], whole[how])} | {shares} |")
    return lines


def main() -> None:
    """Print the lines and, with --document, write them."""
    parser = options(__doc__)
    parser.add_argument("--whole", action="store_true", help="also train networks that lack a group of kinds")
    parser.add_argument("--document", type=Path, help="one whose table is written anew, and the card's")
    args = parser.parse_args()
    plan, data, found = trained(args)
    path = args.models / f"{NAME}.onnx"
    heads = held_out_kinds(found, data, plan)
    whole = whole_left_out(found, data, plan, args.cache, path) if args.whole else None
    lines = lines_of(heads, whole)
    print("\n".join(lines))
    for document in (args.document, path.with_suffix(".md")) if args.document else ():
        renew(document, "unseen", [made_of(command(), [path]), "", *lines])


if __name__ == "__main__":
    main()
