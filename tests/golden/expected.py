"""What is expected of the golden tapes: one text file for each, a line for each event, and how lines are compared.

Where a net answers, the last bits depend on the processor and on the library. On the kind of machine that the lines
were recorded with, everything is compared to the last bit; on another, scores and noise within a tolerance, the rest
exactly.
"""

import json
import math
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden.path import Line
from tests.golden.tape import Tape

FOLDER = Path(__file__).parent / "expected"
MACHINE = "machine.json"  # in each group's folder: where its lines were recorded
# On another machine: how far these may be off, and what cannot be compared there at all.
NEAR = {"confidence": 1e-4, "scores": 1e-4, "noise": 1e-6, "sums": 1e-3}
EXACT_ONLY = {"digests", "looks"}
SEGMENTS = ("people", "hand", "faults", "counters", "clock_sensor", "silence")  # groups whose segments are kept
ABSENT = "no such field"
CONTEXT = 3  # lines shown before the first that differs


def machine() -> dict[str, str]:
    """What the last bits of a sum or of a score may depend on."""
    import onnxruntime

    try:
        told = Path("/proc/cpuinfo").read_text()
    except OSError:
        told = ""
    first = dict(re.findall(r"^([\w ]+?)\s*: (.*)$", told.split("\n\n")[0], re.MULTILINE))
    vectors = [flag for flag in first.get("flags", "").split() if re.match(r"avx|fma|sse|amx|f16c", flag)]
    return {
        "processor": " ".join([platform.machine(), *(first.get(k, "") for k in ("vendor_id", "cpu family", "model"))]),
        "vectors": " ".join(sorted(vectors)),
        "numpy": np.__version__,
        "onnxruntime": onnxruntime.__version__,
    }


def same_machine(group: str) -> bool:
    """Whether a group's lines were recorded on a machine whose last bits are the same."""
    return bool(json.loads((FOLDER / group / MACHINE).read_text()) == machine())


def path_of(group: str, tape: Tape, kind: str = "events") -> Path:
    """The file of a tape's lines; `kind` is "events" or "segments"."""
    name = re.sub(r"[^a-z0-9.]+", "-", tape.name.lower().replace("%", "percent")).strip("-")
    return FOLDER / group / f"{name}.{kind}.jsonl"


def written(tape: Tape, lines: Sequence[Line]) -> str:
    """The text of a file: a line that says of what, and the lines."""
    head = {"tape": tape.name, "about": tape.about, "sha256": tape.digest()}
    return "".join(json.dumps(_short(line)) + "\n" for line in (head, *lines))


def _short(line: Mapping[str, Any]) -> Line:
    """Scores are float32; with that many digits they are shorter, and nothing is lost."""
    scores = line.get("scores")
    if scores is None or any(float(np.float32(v)) != v for v in scores.values()):
        return dict(line)
    return dict(line) | {"scores": {name: float(str(np.float32(v))) for name, v in scores.items()}}


def difference(expected: str, found: str, exact: bool) -> str | None:
    """The first difference of two texts, to be read by whoever broke it; None where there is none."""
    before: list[str] = []
    lines = zip_longest(expected.splitlines(), found.splitlines())
    for number, (one, other) in enumerate(lines, start=1):
        if one != other:
            wrong = list(_fields(one, other, exact))
            if wrong:
                return "\n".join([f"line {number} is another one:", *(f"    {x}" for x in before[-CONTEXT:]), *wrong])
        before.append(one)
    return None


def _fields(one: str | None, other: str | None, exact: bool) -> Iterator[str]:
    if one is None or other is None:
        yield f"  expected {one or 'no more lines'}\n  found    {other or 'no more lines'}"
        return
    here, there = json.loads(one), json.loads(other)
    wrong = [key for key in {**here, **there} if not _equal(key, here.get(key, ABSENT), there.get(key, ABSENT), exact)]
    if wrong:
        yield f"  expected {one}\n  found    {other}"
        yield from (f"  {key}: expected {here.get(key, ABSENT)!r}, found {there.get(key, ABSENT)!r}" for key in wrong)


def _equal(key: str, one: Any, other: Any, exact: bool) -> bool:
    if repr(one) == repr(other):  # so NaN, of a frame that was dropped, is itself
        return True
    if exact:
        return False
    if key in EXACT_ONLY:
        return True
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_equal(key, one[name], other[name], exact) for name in one)
    if key in NEAR and isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=NEAR[key], abs_tol=NEAR[key])
    return False
