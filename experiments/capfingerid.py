"""The text files of CapFingerId -> recordings: `python -m experiments.capfingerid FILE... --out capfingerid.npz`.

A line is `participant;hand;finger;task;-1;` and, with commas, seconds and nanoseconds since the Unix epoch (without
leading zeros), 27 x 15 counts row by row from the top, and nothing after a last comma. The task (TAP, DRAG, SCROLL ...)
is no gesture: each stretch of one task becomes an event labelled `other`. Frames that are there twice are taken once.
"""

import argparse
from itertools import groupby
from pathlib import Path

import numpy as np

from gestured.client.values import npz
from gestured.lab.recordings.store import compact, join_recordings
from gestured.record.arrays import write
from gestured.record.check import SESSION
from gestured.record.judge import UNNAMED
from gestured.record.recordings import Recordings

GRID = (27, 15)  # electrodes of the Nexus 5's panel
PAUSE = "PAUSE"


def session(path: Path) -> Recordings:
    """One session of one finger of one participant."""
    heads, rows = zip(*(line.strip().rstrip(",").rsplit(";", 1) for line in path.read_text().splitlines()), strict=True)
    numbers = np.array([row.split(",") for row in rows], np.float64)
    seconds = numbers[:, 0] + 1e-9 * numbers[:, 1]
    once = np.append(True, np.diff(seconds) > 0)
    who = [head.split(";") for head, new in zip(heads, once, strict=True) if new]
    times, frames = seconds[once] - seconds[0], numbers[once, 2:].reshape(-1, *GRID)
    tasks = [(task, [k for k, _ in of]) for task, of in groupby(enumerate(who), key=lambda one: one[1][3])]
    tasks = [(task, of) for task, of in tasks if task != PAUSE]
    return Recordings(
        frames=compact(frames),
        times=times,
        offsets=np.array([0, len(times)], np.int64),
        labels=np.array([SESSION]),
        subjects=np.array(who[0][:1]),
        kinds=np.array([f"{who[0][2]} finger, {who[0][1]} hand"]),
        event_recording=np.zeros(len(tasks), np.int64),
        event_labels=np.array([UNNAMED] * len(tasks)),
        event_kinds=np.array([task.lower() for task, _ in tasks]),
        event_onsets=np.array([times[of[0]] for _, of in tasks]),
        event_offsets=np.array([times[of[-1]] for _, of in tasks]),
    )


def main() -> None:
    """Write one file of recordings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    parser.add_argument("--out", type=npz, required=True, metavar="F.npz")
    args = parser.parse_args()
    write(args.out, join_recordings([session(path) for path in args.files]))


if __name__ == "__main__":
    main()
