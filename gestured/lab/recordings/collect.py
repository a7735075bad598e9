"""`gestured-lab collect`: a participant, a sensor, a terminal."""

import argparse
from collections import Counter
from contextlib import ExitStack, closing
from pathlib import Path

from gestured.client.pad.pad import Pad
from gestured.client.pad.server import PadServer
from gestured.client.say import say_json
from gestured.core.address import Address
from gestured.core.errors import RecordingError
from gestured.lab.recordings.live import LiveSensor
from gestured.lab.recordings.on_pad import KIND, NON_GESTURES, RATE_HZ, PadTerminal
from gestured.lab.recordings.protocol import order
from gestured.lab.recordings.session import Session
from gestured.lab.recordings.terminal import Terminal
from gestured.model.opening import open_model
from gestured.record.arrays import read
from gestured.record.recordings import Recordings


def run(args: argparse.Namespace) -> int:
    """Collect until all is done or somebody quits; the same command goes on."""
    terminal = PadTerminal() if args.pad else Terminal()
    args.out.mkdir(parents=True, exist_ok=True)
    path: Path = args.out / f"{args.participant}.npz"
    kept = already(path, args.participant, args.grid)
    model = open_model(args.model)
    others = args.non_gestures or (NON_GESTURES if args.pad else ())
    trials = order(args.participant, args.seed, args.gestures, args.repeats, others)
    listen = Address("127.0.0.1", 0) if args.pad else args.listen
    with (
        closing(LiveSensor(listen, args.grid, args.sensor, model)) as sensor,
        ExitStack() as held,
    ):
        session = Session(args.participant, path, kept, sensor, terminal, args.countdown)
        if isinstance(terminal, PadTerminal):
            pad = Pad(Address(*sensor.socket.getsockname()), args.sensor or "pad", args.grid, RATE_HZ)
            terminal.join(held.enter_context(PadServer(args.pad, pad, "gestured-lab collect --pad")).serve())
            session.inclination, session.kind = 0, KIND
            trials = [trial for trial in trials if trial.inclination == session.inclination]
        held.enter_context(terminal)
        session.run(trials)
    if args.json:
        labels = Counter(session.kept.labels.tolist()) if session.kept is not None else {}
        say_json({"file": str(path), "trials": len(trials), "recordings": labels})
    return 0


def already(path: Path, participant: str, grid: tuple[int, int]) -> Recordings | None:
    """What an earlier session kept; RecordingError where the file is somebody else's or another sensor's."""
    if not path.exists():
        return None
    kept = read(path)
    others = sorted(set(kept.subjects.astype(str).tolist()) - {participant})
    if others:
        raise RecordingError(f"{path}: subjects: expected {participant} alone, found {others[0]}; choose another --out")
    if kept.frames.shape[1:] != grid:
        found, expected = ("x".join(map(str, shape)) for shape in (kept.frames.shape[1:], grid))
        raise RecordingError(f"{path}: frames: expected the grid {expected}, found {found}; see --grid")
    return kept
