"""Somebody's recordings, as `gestured-lab collect` and a session write them: simulated people on any sensor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gestured.lab.recordings.store import touched
from gestured.record.recordings import Recordings
from gestured.simulator import Participant, SimulatedSensor, generator, gesture_take, session

CONSENT = "2026-01-31"


def unknown_sensor(seed: int) -> SimulatedSensor:
    """Another grid, gain, noise and lag than any nominal sensor's."""
    usual = SimulatedSensor.nominal(day=seed)
    return replace(usual, rows=12, columns=10, gain=2 * usual.gain, noise=3 * usual.noise,
                   relaxation=(0.4, 0.2), taus_s=(0.08, 0.6))  # fmt: skip


def cut_gestures(
    people: Sequence[str], labels: Sequence[str], *, repeats: int = 1, sensor: SimulatedSensor | None = None
) -> Recordings:
    """Each person performs each of `labels` (kinds of the simulator), `repeats` times.

    The marks are the front end's; what it does not see as one contact is left away.
    """
    takes = [
        (gesture_take(label, Participant(500 + k), sensor or SimulatedSensor.nominal(day=70 + k), generator(31, k, n)),
         label, person)
        for k, person in enumerate(people) for n, label in enumerate(list(labels) * repeats)
    ]  # fmt: skip
    seen = [(touched(take.frames, take.times), take, label, person) for take, label, person in takes]
    marks, kept, names, subjects = zip(*(one for one in seen if one[0] is not None), strict=True)
    onsets, releases = np.array(marks).T
    return Recordings(
        frames=np.concatenate([take.frames for take in kept]),
        times=np.concatenate([take.times for take in kept]),
        offsets=np.cumsum([0, *(len(take.frames) for take in kept)], dtype=np.int64),
        labels=np.array(names),
        subjects=np.array(subjects),
        onsets=onsets,
        releases=releases,
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
