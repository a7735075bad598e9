"""Somebody's recordings, as `gestured-lab collect` and a session write them: simulated people on any sensor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gestured.lab.recordings.store import touched
from gestured.record.recordings import Recordings
from gestured.simulator import Participant, SimulatedSensor, Take, generator, gesture_take, session

CONSENT = "2026-01-31"


def unknown_sensor(seed: int) -> SimulatedSensor:
    """Another grid, gain, noise and lag than any nominal sensor's."""
    usual = SimulatedSensor.nominal(day=seed)
    return replace(usual, rows=12, columns=10, gain=2 * usual.gain, noise=3 * usual.noise,
                   relaxation=(0.4, 0.2), taus_s=(0.08, 0.6))  # fmt: skip


def cut_gestures(
    people: Sequence[str], labels: Sequence[str], *, repeats: int = 1, sensor: SimulatedSensor | None = None
) -> Recordings:
    """Each person performs each of `labels` (kinds of the simulator), `repeats` times."""
    takes, names, subjects = [], [], []
    for k, person in enumerate(people):
        for n, label in enumerate(list(labels) * repeats):
            on = sensor or SimulatedSensor.nominal(day=70 + k)
            takes.append(gesture_take(label, Participant(500 + k), on, generator(31, k, n)))
            names.append(label)
            subjects.append(person)
    return together(takes, names, subjects)


def together(takes: Sequence[Take], names: Sequence[str], subjects: Sequence[str]) -> Recordings:
    """Takes of one gesture each, with the marks of the front end; what it does not see as one is left away."""
    marks = [touched(take.frames, take.times) for take in takes]
    kept = [i for i, mark in enumerate(marks) if mark is not None]
    both = np.array([marks[i] for i in kept])
    lengths = [len(takes[i].frames) for i in kept]
    return Recordings(
        frames=np.concatenate([takes[i].frames for i in kept]),
        times=np.concatenate([takes[i].times for i in kept]),
        offsets=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        labels=np.array([names[i] for i in kept]),
        subjects=np.array([subjects[i] for i in kept]),
        onsets=both[:, 0],
        releases=both[:, 1],
        consents=np.array([CONSENT] * len(kept)),
    )


def whole_session(person: str, seconds: float = 60.0, *, seed: int = 0, share: float = 0.2) -> Recordings:
    """A session of one person on the nominal sensor, with what was performed as its events."""
    made = session(Participant(700 + seed), SimulatedSensor.nominal(day=seed), generator(33, seed), seconds, share)
    acts = made.events
    return Recordings(
        frames=made.frames,
        times=made.times,
        offsets=np.array([0, len(made.times)]),
        labels=np.array(["session"]),
        subjects=np.array([person]),
        event_recording=np.zeros(len(acts), np.int64),
        event_labels=np.array([act.label for act in acts]),
        event_kinds=np.array([act.kind for act in acts]),
        event_onsets=np.array([act.onset_s for act in acts]),
        event_offsets=np.array([min(act.offset_s, float(made.times[-1])) for act in acts]),
    )
