"""`gesturectl export`: write the frames of a tape as .npz."""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from gestured.client.program import Commands
from gestured.client.say import tell
from gestured.client.values import npz
from gestured.core.errors import RecordingError
from gestured.core.frames import Frame, Touch
from gestured.core.mounting import Mounting
from gestured.record import arrays as recording
from gestured.record.check import SESSION
from gestured.record.recordings import Recordings, touch_arrays
from gestured.record.replay import frames_used, opened
from gestured.record.tape import Tape

ROUNDED_S = 1e-3  # more than the times of frames and events, which are made of different sums, differ by rounding


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "export",
        help="write a recording as .npz",
        description="Write the frames of a recording as .npz, one session a sensor, with the gestures that the\n"
        "daemon recognised as its events. A sensor that is mounted turned, mirrored or inverted is written as a\n"
        "person in front of it sees it. Sensors of one file have one grid.",
        epilog="example:\n  gesturectl export drive.mcap drive.npz --sensor armrest",
    )
    parser.takes("file", "FILE", "what gesturectl record or flag wrote", type=Path)
    parser.takes("out", "OUT", "the .npz to write", type=npz)
    parser.takes("--sensor", "NAME", "only this sensor")
    parser.runs(run, "print what was written as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the .npz, and print what it holds."""
    names, made = sessions_of(args.file, args.sensor)
    recording.write(args.out, made)
    frames, events = len(made.frames), 0 if made.event_labels is None else len(made.event_labels)
    summary = {"file": str(args.out), "sessions": names, "frames": frames, "events": events}
    tell(args.json, summary, f"{args.out}: {frames} frames of {', '.join(names)}, {events} gestures")
    return 0


def sessions_of(path: Path, sensor: str | None = None) -> tuple[list[str], Recordings]:
    """The sensors of a tape, or the one named `sensor`, and a session of each. Raises RecordingError."""
    found, known = opened(path)
    sessions = {
        name: [_seen(frame, known.scene.setup(name).mounting) for frame in used]
        for name, used in frames_used(found, known.scene).items()
        if sensor in (None, name)
    }
    if not sessions:
        raise RecordingError(f"{path}: holds no frame of {sensor or 'any sensor'}")
    grids = {name: each[0].values.shape for name, each in sessions.items()}
    if len(set(grids.values())) > 1:
        said = ", ".join(f"{name} {rows}x{columns}" for name, (rows, columns) in grids.items())
        raise RecordingError(f"{path}: sensors of several grids ({said}), choose one with --sensor")
    return list(sessions), _recordings(sessions, found)


def _seen(frame: Frame, mounting: Mounting) -> Frame:
    """A frame and its touches as a person in front of the sensor sees them, since the gestures' names say that."""
    touches = []
    for touch in frame.touches:
        rows, columns = frame.values.shape
        x, y = columns - 1 - touch.x if mounting.mirror else touch.x, touch.y
        for _ in range(mounting.rotate // 90):
            x, y, rows, columns = y, columns - 1 - x, columns, rows
        touches.append(Touch(touch.id, x, y))
    return replace(frame, values=mounting.frame(frame.values), touches=tuple(touches))


def _recordings(sessions: dict[str, list[Frame]], found: Tape) -> Recordings:
    frames = [frame for each in sessions.values() for frame in each]
    touches, ids = touch_arrays(frames)
    events = []
    for g, (name, each) in enumerate(sessions.items()):
        first, last = each[0].t, each[-1].t
        events += [
            (g, e["gesture"], max(e["onset"], first), min(e["offset"], last))
            for e in found.events
            if (e["type"], e.get("sensor")) == ("gesture", name)
            and first - ROUNDED_S <= e["onset"] <= e["offset"] <= last + ROUNDED_S
        ]
    labels = np.array([label for _, label, _, _ in events], dtype="U64")
    return Recordings(
        frames=np.stack([frame.values for frame in frames]),
        times=np.array([frame.t for frame in frames]),
        offsets=np.cumsum([0, *map(len, sessions.values())], dtype=np.int64),
        labels=np.array([SESSION] * len(sessions)),
        subjects=np.array(list(sessions)),
        touches=touches,
        touch_ids=ids,
        event_recording=np.array([g for g, _, _, _ in events], np.int64),
        event_labels=labels,
        event_kinds=labels,
        event_onsets=np.array([onset for _, _, onset, _ in events], np.float64),
        event_offsets=np.array([offset for _, _, _, offset in events], np.float64),
    )
