"""Own recordings as `adapt` takes them: what is learned, what is left out, who is held out, what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gestured.core.errors import GesturedError
from gestured.lab.adapt.learning import OTHER, classes_of
from gestured.lab.adapt.material import held_out, own_recordings
from gestured.lab.fit import CLASSES
from gestured.record.arrays import write
from gestured.record.recordings import Recordings
from gestured.simulator import GESTURES
from tests.lab.adapt.recorded import cut_gestures, whole_session


def test_gestures_kinds_and_names_of_ones_own(tmp_path: Path) -> None:
    made = cut_gestures(("anna", "berta"), (*GESTURES, "long_press", "zigzag", "scribble"))
    labels = made.labels.astype("U40")
    labels[made.labels == "zigzag"] = "wave"  # a name of one's own, which the simulator has for a non-gesture
    labels[np.isin(made.labels, ("long_press", "scribble"))] = "none"
    kinds = np.where(made.labels == "scribble", "none", labels)  # a non-gesture of nobody knows what kind
    kinds[made.labels == "long_press"] = "long_press"
    write(tmp_path / "a.npz", replace(made, labels=labels, kinds=kinds))
    own = own_recordings([tmp_path / "a.npz"])
    assert own.names == ("anna", "berta")
    assert own.left_out == {"wave": 2}
    assert set(own.samples.labels) == {*GESTURES, "none"}
    named = dict(zip(own.samples.kinds.tolist(), classes_of(own.samples).tolist(), strict=True))
    assert named["long_press"] == CLASSES.index("long_press")
    assert named["none"] == OTHER
    assert "wave" not in named
    rejected = own_recordings([tmp_path / "a.npz"], as_none=["wave"])
    assert not rejected.left_out
    assert (rejected.samples.labels[rejected.samples.kinds == "wave"] == "none").all()


def test_what_is_labelled_none_is_no_gesture_though_its_kind_is_the_name_of_one(tmp_path: Path) -> None:
    made = cut_gestures(("anna",), GESTURES, repeats=3)
    spoilt = np.where(made.labels == "swipe_left", "none", made.labels)  # performances that somebody has rejected
    write(tmp_path / "a.npz", replace(made, labels=spoilt, kinds=made.labels))
    own = own_recordings([tmp_path / "a.npz"], as_none=["swipe_up"]).samples
    assert (own.labels == "none").sum() >= 5
    np.testing.assert_array_equal(classes_of(own) == OTHER, own.labels == "none")


def test_a_gesture_that_is_never_cut_out_counts_as_performed(tmp_path: Path) -> None:
    made = cut_gestures(("anna",), GESTURES, repeats=3)
    frames = made.frames.copy()
    first = slice(int(made.offsets[0]), int(made.offsets[1]))
    frames[first] = frames[made.offsets[0]]  # nothing is to be seen
    write(tmp_path / "a.npz", replace(made, frames=frames))
    own = own_recordings([tmp_path / "a.npz"])
    assert own.performed == len(made)
    assert own.missed.tolist() == [[0, 0]]


def test_recordings_without_marks_are_marked_as_the_front_end_sees_them(tmp_path: Path) -> None:
    made = cut_gestures(("anna",), GESTURES, repeats=2)
    write(tmp_path / "marked.npz", made)
    write(tmp_path / "bare.npz", replace(made, onsets=None, releases=None))
    marked, bare = (own_recordings([tmp_path / name]).samples for name in ("marked.npz", "bare.npz"))
    assert bare.labels.tolist() == marked.labels.tolist()


def test_people_are_held_out_else_sessions_else_stretches(tmp_path: Path) -> None:
    names = [f"p{k}" for k in range(7)]
    write(tmp_path / "people.npz", cut_gestures(names, GESTURES[:4]))
    own = own_recordings([tmp_path / "people.npz"])
    groups = held_out(own)
    assert (groups.unit, groups.count) == ("people", 5)
    for person in range(7):
        assert len(set(groups.of_samples[own.samples.people == person].tolist())) == 1
    for k in range(3):
        write(tmp_path / f"{k}.npz", whole_session("anna", seed=k))
    groups = held_out(own_recordings([tmp_path / f"{k}.npz" for k in range(3)]))
    assert (groups.unit, groups.count) == ("sessions", 3)
    write(tmp_path / "one.npz", cut_gestures(("anna",), GESTURES, repeats=3))
    groups = held_out(own_recordings([tmp_path / "one.npz"]))
    assert (groups.unit, groups.count) == ("parts of one session", 5)
    assert (np.diff(groups.of_samples) >= 0).all()


def test_what_cannot_be_learned_from_is_refused_in_one_sentence(tmp_path: Path) -> None:
    good = cut_gestures(("anna",), GESTURES, repeats=3)
    write(tmp_path / "good.npz", good)
    write(tmp_path / "few.npz", cut_gestures(("anna",), GESTURES[:3]))
    waved = replace(good, labels=np.array(["wave"] * len(good)))
    write(tmp_path / "waves.npz", waved)
    one = replace(good, offsets=np.concatenate([[0, 1], good.offsets[1:]]), **{
        field: np.concatenate([getattr(good, field)[:1] * 0 if field in ("onsets", "releases") else
                               getattr(good, field)[:1], getattr(good, field)])
        for field in ("labels", "subjects", "onsets", "releases", "consents")
    })  # fmt: skip
    write(tmp_path / "one.npz", replace(one, onsets=None, releases=None))
    session = whole_session("anna")
    bare = replace(session, **dict.fromkeys(
        ("event_recording", "event_labels", "event_kinds", "event_onsets", "event_offsets")))  # fmt: skip
    write(tmp_path / "bare.npz", bare)
    write(tmp_path / "wide.npz", replace(good, frames=np.repeat(good.frames, 2, axis=2)))
    count = 1001  # people, each with two frames
    frames, times = np.arange(162.0 * count, dtype=np.float32).reshape(-1, 9, 9), np.tile([0.0, 0.1], count)
    labels = np.array(["one_tap"] * count)
    crowd = Recordings(frames, times, np.arange(0, 2 * count + 1, 2), labels, np.arange(count))
    write(tmp_path / "crowd.npz", crowd)
    write(tmp_path / "still.npz", replace(good, frames=np.full_like(good.frames, 100)))
    write(tmp_path / "ms.npz", replace(good, times=good.times * 1e3))
    copies = good.take(np.array([5, 0]))
    write(tmp_path / "copies.npz", replace(copies, subjects=np.array(["berta"] * 2), times=copies.times + 9.0))
    write(tmp_path / "anna.npz", replace(good, subjects=np.array(["ANNA"] * len(good)), times=good.times / 2))
    write(tmp_path / "seven.npz", replace(good, subjects=np.where(np.arange(len(good)) % 2, "07", "7.0")))
    for names, reason in (
        (["good.npz", "anna.npz"], r"anna.npz: subjects: expected one name for each person, found 'anna' and 'ANNA';"),
        (["seven.npz"], r"seven.npz: subjects: expected one name for each person, found '7.0' and '07';"),
        (["few.npz"], r"few.npz: expected at least 20 gestures of the model, found 3"),
        (["waves.npz"], r"found 0; names of your own are enrolled, not learned: wave"),
        (["one.npz"], r"one.npz: frames of recording 0: expected more than one"),
        (["bare.npz"], r"bare.npz: event_labels: missing"),
        (["good.npz", "wide.npz"], r"wide.npz: frames: expected the grid 9x9 .* found 9x18"),
        (["good.npz", "good.npz"], r"good.npz: frames of recording 0: expected no copy of one in .*good.npz"),
        (["good.npz", "copies.npz"], r"copies.npz: frames of recording 0: expected no copy of one in .*good.npz"),
        (["crowd.npz"], r"subjects: expected at most 1000 people"),
        (["still.npz"], rf"still.npz: expected gestures that the front end cuts out, found 0 of {len(good)};"),
        (["good.npz", "ms.npz"], r"ms.npz: times of recording 0: expected 2 to 2500 .* found 0.016; are these seconds"),
    ):
        with pytest.raises(GesturedError, match=reason) as told:
            own_recordings([tmp_path / name for name in names])
        assert "\n" not in str(told.value)
