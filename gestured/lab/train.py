"""The shipped models from nothing: simulate, learn, calibrate, export. Each step is kept, so a run can be continued.

The split (no participant is in two parts): the cohort's participants 0 to 23 teach, 24 to 27 calibrate, 28 to 33 test;
the wide stream's seeds 1, 2 and 3 do the same, each with people of its own; its seed 4 is for the thresholds of
provisional events. Real subjects calibrate and test only networks that have not seen them: three folds, which share
what was learned from simulation.
"""

import hashlib
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

import gestured
from gestured.client.say import say_drawn
from gestured.core.errors import GesturedError
from gestured.core.points import USUAL
from gestured.lab.adapt.material import own_recordings
from gestured.lab.dataset import DAY_S, OTHER_TRIALS, TRIALS, meant_on, recorded, simulated
from gestured.lab.decide import calibration_of, confidence, decided, fit_decision, threshold
from gestured.lab.digest import code_digest
from gestured.lab.early import Foretold
from gestured.lab.export import Facts, export_forest, export_net, write_manifest
from gestured.lab.fit import CLASSES, NETS, RECURRENT, FitConfig, finetune, kept_nets, logits, pretrain, targets
from gestured.lab.forest import grow_forest
from gestured.lab.nets import Judged, Opinion
from gestured.lab.points import by_strictness, operating_points
from gestured.lab.quantiles import answer_figures, quantiles
from gestured.lab.recordings.origin import origins
from gestured.lab.samples import WINDOW, Samples, join
from gestured.lab.verifier import Evidence, fit_verifier, taught, with_past_of
from gestured.model.context import NAMES
from gestured.model.features import feature_names
from gestured.record.arrays import read
from gestured.simulator import GESTURES
from gestured.simulator.cohort import wide_plan

REAL_SETS = ("taps and swipes", "with non-gestures")  # sets of real recordings that judge
MIXED = REAL_SETS[1]  # the one that has non-gestures, too
REAL_FILES = ("capfingerid_gestures_dev.npz", "capfingerid_sessions_dev.npz")
FOLDS = 3
COHORT = 1_000_000  # the wide stream's people have larger numbers
OWN = 100_000  # people of own recordings have larger numbers than the public subjects


@dataclass(frozen=True, slots=True)
class TrainingPlan:
    """How much is simulated; the numbers behind the shipped models are the defaults."""

    wide: int = 60_000
    wide_calibrate: int = 12_000  # takes to calibrate
    wide_check: int = 4_000  # takes to test
    wide_early: int = 60_000  # takes for provisional events: the fewer people, the safer a threshold has to be
    cohort: int = len(TRIALS)
    others: int = len(OTHER_TRIALS)
    forest: int = 20_000  # simulated samples for the forest
    days: int = 700  # of everyday life, twelve minutes of a person each
    days_calibrate: int = 1_000  # days to learn the verifier from
    chance: int = 700  # days by `simulator.chance`, to learn from
    chance_calibrate: int = 1_000  # such days to learn the verifier from
    days_points: int = 400  # days on the nominal sensor to choose the operating points by
    fit: FitConfig = field(default_factory=FitConfig)

    @classmethod
    def quick(cls) -> "TrainingPlan":
        """A run of some minutes, to try the pipeline; its models are of no use."""
        return cls(
            wide=1_500, wide_calibrate=400, wide_check=400, wide_early=400, forest=2_000,
            days=10, days_calibrate=10, chance=5, chance_calibrate=5, days_points=10,
            fit=FitConfig(epochs=3, real_epochs=1, real_samples=1_000),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class TrainingData:
    """Everything that is learned from or judged on, split by participant."""

    teach: Samples  # the wide stream, everyday life, then the cohort
    nominal: int  # how many of them are the cohort's
    calibrate: Samples
    tests: dict[str, Samples]  # by name
    performed: dict[str, int]  # gestures that were performed in each test, cut out or not
    real: Samples | None
    real_judged: int  # number of those that judge, the first ones: cut gestures, whose touches sessions hold again
    lived: Samples  # everyday life of people from whom no network learned, for the verifier
    spoken: Samples  # everyday life of further people on the nominal sensor, for operating points


def load_data(
    plan: TrainingPlan, cache: Path, real: Path | None, jobs: int, recordings: Sequence[Path] = ()
) -> TrainingData:
    """Simulate, or read from the cache; also read the real recordings in their folder, and own recordings."""
    found = _real(real, recordings)  # first, so that a wrong file is reported before anything is simulated
    teach, check, test = (
        simulated(cache, "wide", seed, count, jobs)
        for seed, count in ((1, plan.wide), (2, plan.wide_calibrate), (3, plan.wide_check))
    )
    days, lived = (
        join([simulated(cache, "days", seed, count, jobs), simulated(cache, "days_by_chance", seed, chance, jobs)])
        for seed, count, chance in ((1, plan.days, plan.chance), (2, plan.days_calibrate, plan.chance_calibrate))
    )
    cohort = simulated(cache, "cohort", 0, plan.cohort, jobs)
    others = simulated(cache, "others", 0, plan.others, jobs)
    both = join([cohort, others])
    person = both.people % 1000
    plans = np.array([trial.participant for trial in TRIALS[: plan.cohort]])
    own = both.take(person < 24)
    performed = _performed(real, recordings) if found else {}
    return TrainingData(
        join([teach, days, own]),
        len(own),
        join([check, both.take((person >= 24) & (person < 28))]),
        {"nominal": both.take(person >= 28), "wide": test},
        {
            "nominal": int((plans >= 28).sum()),
            "wide": sum(wide_plan(3, index).kind in GESTURES for index in range(plan.wide_check)),
            **performed,
        },
        found and found[0],
        found[1] if found else 0,
        lived,
        simulated(cache, "nominal_days", 3, plan.days_points, jobs),
    )


def _real(folder: Path | None, recordings: Sequence[Path]) -> tuple[Samples, int] | None:
    """All real samples, and how many of them, the first ones, are of the file of cut gestures.

    Own recordings stand at the end; if there are no others, own recordings are judged.
    """
    parts = [recorded(read(path)) for path in _real_files(folder)]
    if recordings:
        own = own_recordings(recordings).samples
        people = len(np.unique(own.people))
        if not parts and people < FOLDS:
            raise GesturedError(
                f"--recordings: expected gestures of at least {FOLDS} people, found {people}, since each person is "
                "judged by what learned from others; gestured-lab adapt learns from fewer"
            )
        parts.append(replace(own, people=own.people + OWN))
    return (join(parts), len(parts[0])) if parts else None


def _performed(folder: Path | None, recordings: Sequence[Path]) -> dict[str, int]:
    """By judging set, how many gestures the files that judge hold, cut out again by the front end or not."""
    judge = [read(path) for path in _real_files(folder)[:1] or recordings]
    parts = [of for found in judge for of in (found.labels, found.event_labels) if of is not None]
    labels = np.concatenate([np.zeros(0, np.str_), *parts])
    return {title: int((is_of(labels, title) & np.isin(labels, GESTURES)).sum()) for title in REAL_SETS}


def is_of(labels: NDArray[np.str_], title: str) -> NDArray[np.bool_]:
    """(N,) whether each label belongs to one of `REAL_SETS`."""
    strokes = np.array([label == "one_tap" or str(label).startswith("swipe") for label in labels], bool)
    return strokes if title == REAL_SETS[0] else np.ones(len(labels), bool)


def _real_files(folder: Path | None) -> list[Path]:
    """The files of real recordings; none without their folder."""
    return [folder / name for name in REAL_FILES] if folder else []


def folds(real: Samples) -> list[NDArray[np.bool_]]:
    """For each fold, whether a sample is held out (N,); every subject is held out once."""
    subjects = np.unique(real.people)
    return [np.isin(real.people, subjects[k::FOLDS]) for k in range(FOLDS)]


@dataclass(slots=True)
class Trained:
    """The networks, and the logits for real subjects of networks that have not seen them."""

    nets: nn.ModuleDict
    held_out: dict[str, Tensor] | None  # (G, K) logits of each net over the real samples, None without any
    folds: list[nn.ModuleDict] = field(default_factory=list)  # of each of `folds`: networks without its subjects
    start: nn.ModuleDict | None = None  # networks before any real recording; None if these are `nets`
    _kept: dict[tuple[str, str], Evidence] = field(default_factory=dict)

    def evidence(self, name: str, samples: Samples) -> Evidence:
        """The evidence of a network and the trajectory net on samples; what they say is computed once for each set."""
        key = name, samples.digest()
        if key not in self._kept:
            self._kept[key] = Evidence.of(self.nets, name, samples)
        return self._kept[key].beside(samples.context)


def learn(plan: TrainingPlan, data: TrainingData, cache: Path, names: Sequence[str] = NETS) -> Trained:
    """Both stages and the folds of these networks; what is finished is read from the cache."""
    told = json.dumps([code_digest("gestured.lab.fit"), asdict(plan.fit), data.teach.digest(), names])
    key = hashlib.sha256(told.encode()).hexdigest()[:12]
    checkpoint = cache / f"checkpoint-{key}.npz"
    start = kept_nets(cache / f"simulated-{key}.npz", lambda: pretrain(data.teach, plan.fit, checkpoint, names))
    if data.real is None:
        return Trained(start, None)
    key += data.real.digest()[:6]

    def learned(file: str, real: Samples, title: str) -> nn.ModuleDict:
        return kept_nets(cache / f"{file}-{key}.npz", lambda: finetune(start, data.teach, real, plan.fit, title))

    held_out = {name: torch.zeros(len(data.real), len(CLASSES)) for name in start}
    apart: list[nn.ModuleDict] = []
    for k, held in enumerate(folds(data.real)):
        apart.append(learned(f"fold{k}", data.real.take(~held), f"fold {k + 1}/{FOLDS}"))
        for name, found in logits(apart[-1], data.real.take(held)).items():
            held_out[name][torch.from_numpy(held)] = found
    return Trained(learned("final", data.real, "final"), held_out, apart, start)


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Logits to calibrate on, and their classes."""

    logits: dict[str, Tensor]
    labels: NDArray[np.int64]
    sets: NDArray[np.int64]  # 0: anybody on any sensor, 1: the cohort, 2: real people


def calibration_set(trained: Trained, data: TrainingData) -> Calibrated:
    """Logits for people that no network has seen: simulated ones, and real ones by the fold that left them out."""
    found, labels = logits(trained.nets, data.calibrate), targets(data.calibrate)
    sets = (data.calibrate.people < COHORT).astype(np.int64)
    if data.real is not None and trained.held_out is not None:
        found = {name: torch.cat([found[name], trained.held_out[name]]) for name in found}
        labels = np.concatenate([labels, targets(data.real)])
        sets = np.concatenate([sets, np.full(len(data.real), 2)])
    usable = labels >= 0
    logits_of = {name: x[torch.from_numpy(usable)] for name, x in found.items()}
    return Calibrated(logits_of, labels[usable], sets[usable])


def foretold(trained: Trained, data: TrainingData, plan: TrainingPlan, cache: Path, jobs: int) -> Foretold:
    """The `Foretold` of calibration people, further ones and real subjects, by networks that have not seen them."""
    further = simulated(cache, "wide", 4, plan.wide_early, jobs)
    parts = [
        (trained.nets, replace(one, context=with_past_of(one, data.lived, n)))
        for n, one in enumerate((data.calibrate, further))
    ]
    if data.real is not None:
        parts += [(nets, data.real.take(held)) for nets, held in zip(trained.folds, folds(data.real), strict=True)]
    return Foretold.sessions(parts)


def judged(
    trained: Trained, name: str, calibrated: Calibrated, data: TrainingData | None = None
) -> tuple[Judged, dict[str, Any], dict[str, Any]]:
    """A network with its second opinion, their calibration, and figures of its answers (`answer_figures`).

    With `data` there is a verifier, too, and the threshold is fitted on its answers.
    """
    first, second = calibrated.logits[name], calibrated.logits["trajectory"]
    decision = fit_decision(first, second, calibrated.labels, len(GESTURES))
    answers, labels, sets, verifier = decided(decision, first, second), calibrated.labels, calibrated.sets, None
    if data is not None:
        alone = data.calibrate.take(targets(data.calibrate) >= 0)
        taken = trained.evidence(name, alone).beside(with_past_of(alone, data.lived, 1))
        learned = [(trained.evidence(name, data.lived), taught(data.lived)), (taken, taught(alone))]
        verifier = fit_verifier(decision, learned, 1)
        answers, labels, sets = taken.answers(decision, verifier), labels[: len(alone)], sets[: len(alone)]
    least = threshold(answers, labels, sets)
    net, trajectory = trained.nets[name], trained.nets["trajectory"]
    assert isinstance(net, Opinion)
    assert isinstance(trajectory, Opinion)
    module = Judged(net, trajectory, decision, verifier).eval()
    return module, calibration_of(decision, least), answer_figures(confidence(answers), labels < len(GESTURES), least)


def measured_points(
    trained: Trained, module: Judged, name: str, data: TrainingData, plan: TrainingPlan
) -> dict[str, Any]:
    """The metadata `operating_points` of a network with a verifier, on hours of people from whom it has not learned."""
    answers = trained.evidence(name, data.spoken).answers(module.decision, module.verifier)
    performed = sum(meant_on(3, index) for index in range(plan.days_points))
    return operating_points(answers, data.spoken, performed, plan.days_points * DAY_S / 3600.0)


def train(
    plan: TrainingPlan, out: Path, cache: Path, real: Path | None, jobs: int, recordings: Sequence[Path] = ()
) -> None:
    """Make the three models in `out`, with an empty manifest; the figures come from `evaluate`."""
    torch.set_num_threads(max(jobs, 1))
    data = load_data(plan, cache, real, jobs, recordings)
    trained = learn(plan, data, cache)
    calibrated = calibration_set(trained, data)
    digest = hashlib.sha256((data.teach.digest() + (data.real.digest() if data.real else "")).encode()).hexdigest()
    common: dict[str, Any] = {
        "version": gestured.__version__, "gestures": list(GESTURES), "window": WINDOW,
        "training_data": digest, "learned_from": origins([*_real_files(real), *recordings]),
    }  # fmt: skip
    seen = quantiles(data.teach)
    out.mkdir(parents=True, exist_ok=True)
    contacts = foretold(trained, data, plan, cache, jobs)
    for name in RECURRENT:
        module, calibration, answered = judged(trained, name, calibrated, data)
        common |= {"kind": name, "calibration": calibration, "quantiles": seen | answered}
        points = measured_points(trained, module, name, data, plan)
        say_drawn(f"{name}\n{by_strictness(points)}", to=sys.stderr)
        rule = contacts.rule(name, module, np.array(list(points[USUAL]["thresholds"].values())))
        more: dict[str, Any] = {"classes": CLASSES, "context": NAMES, "operating_points": points, "provisional": rule}
        export_net(module, out / f"{name}.onnx", Facts(**common, **more))
    wide = len(data.teach) - data.nominal  # the cohort stands at the end
    some = np.random.default_rng(plan.fit.seed).choice(wide, min(plan.forest, wide), replace=False)
    shown = data.teach.take(np.concatenate([some, np.arange(wide, len(data.teach))]))
    forest, calibration, answered = grow_forest(shown, data.real, data.calibrate, plan.fit.seed, jobs)
    common |= {"kind": "touch_pattern_rf", "calibration": calibration, "quantiles": seen | answered}
    path = out / "touch_pattern_rf.onnx"
    export_forest(forest, path, Facts(**common), feature_names(WINDOW.rows, WINDOW.columns))
    write_manifest(out, {})
