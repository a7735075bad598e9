"""Tapes of real fingers, made from recordings that are not in the repository: ../shared/data (see its README)."""

from pathlib import Path

from gestured.client.sensor import Form
from gestured.record.arrays import read
from tests.golden.making import Sent, moment, tape
from tests.golden.tape import Tape

SESSIONS = Path(__file__).resolve().parents[3] / "shared" / "data" / "capfingerid_sessions_dev.npz"


def real() -> list[Tape]:
    """Ten whole sessions of ten people on a touchscreen of 27 x 15."""
    recordings = read(SESSIONS)
    form, tapes = Form("phone", "uint8"), []
    for i in range(len(recordings)):
        packets: list[Sent] = [
            (frame.t, ("10.0.0.1", 5001), form.packet(frame, n, moment(frame.t)))
            for n, frame in enumerate(recordings.stream(i))
        ]
        tapes.append(tape(f"session {i}", f"subject {recordings.subjects[i]}", packets, grid="27x15"))
    return tapes
