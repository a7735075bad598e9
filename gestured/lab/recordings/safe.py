"""Of a recording file that is partly bad: what is good, and what was left out and why.

A recording is used only where every field that is kept of it holds. A field that nobody needs (a speed, a touch) is
left out for the whole file where it cannot be told which recording it belongs to. What performed events belong to is
never guessed: without their structure the truth of a session is in doubt, and the file is refused.
"""

from dataclasses import dataclass
from pathlib import Path

from gestured.core.errors import RecordingError
from gestured.record.arrays import load
from gestured.record.check import Wrong, check, structure
from gestured.record.recordings import Recordings

# Fields that may be left out, each with those that mean nothing without it.
OPTIONAL = {field: {field} for field in ("speeds", "inclinations", "kinds", "consents")} | {
    field: pair for pair in ({"onsets", "releases"}, {"touches", "touch_ids"}) for field in pair
}

LEFT_OUT_SHOWN = 10  # of what was left out; the rest is counted


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What could not be used: a recording of a file, a field of all of them, or a line of a text."""

    file: Path
    recording: int | None  # its index in the file; None: the field was left out of every recording
    field: str
    reason: str  # the field, and what was expected
    line: int | None = None  # of a text that is imported

    def __str__(self) -> str:
        what = f"the field {self.field}" if self.recording is None else f"recording {self.recording}"
        what = what if self.line is None else f"line {self.line}"
        return f"{self.file}: {what} is left out: {self.reason}"


def read_what_is_good(path: str | Path) -> tuple[Recordings, list[LeftOut]]:
    """The recordings of a file that can be used, and what had to be left out, in the file's order.

    RecordingError, as of `gestured.record.arrays.read`, where nothing of the file can be told for sure.
    """
    path = Path(path)
    left: list[LeftOut] = []
    without: set[str] = set()
    while True:
        try:
            found = load(path, without)
            structure(found)
            break
        except Wrong as error:
            if error.field in without or error.field not in OPTIONAL:
                raise RecordingError(f"{path}: {error}") from error
            without |= OPTIONAL[error.field]
            left.append(LeftOut(path, None, error.field, str(error)))
    try:
        check(found)
        return found, left
    except Wrong:
        pass
    good = []
    for i in range(len(found)):
        try:
            check(found.take([i]))
            good.append(i)
        except Wrong as error:
            left.append(LeftOut(path, i, error.field, str(error).replace(" of recording 0", "", 1)))
    return found.take(good), left
