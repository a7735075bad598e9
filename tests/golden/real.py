"""Tapes of real fingers, made from recordings that are not in the repository: ../shared/data (see its README)."""

from pathlib import Path

from gestured.client.sensor import Form
from gestured.record.arrays import read
from tests.golden.tape import Packet, Tape, arrived

SESSIONS = Path(__file__).resolve().parents[3] / "shared" / "data" / "capfingerid_sessions_dev.npz"
EPOCH_S = 1.7e9  # of the time tags
GRAIN = 1024  # times and time tags are whole parts of a second


def real() -> list[Tape]:
    """Ten whole sessions of ten people on a touchscreen of 27 x 15."""
    recordings = read(SESSIONS)
    form, tapes = Form("phone", "uint8"), []
    for i in range(len(recordings)):
        frames = list(recordings.stream(i))
        packets = (
            Packet(
                round(round((frame.t - frames[0].t) * GRAIN) / GRAIN * 1e9),
                ("10.0.0.1", 5001),
                form.packet(frame, n, EPOCH_S + round(frame.t * GRAIN) / GRAIN),
            )
            for n, frame in enumerate(frames)
        )
        tapes.append(arrived(f"session {i}", f"subject {recordings.subjects[i]}", packets, {"grid": "27x15"}))
    return tapes
