"""Fuzz one target with atheris: `python -m tests.fuzz.run decoder --seconds 60`.

It needs the extra [fuzz]. An escape (an exception that the target does not promise, or a crash) ends it with its
traceback; the input is in `--findings`. A stall is an input that takes more than `STALL_S` of this thread's CPU time
in each of three runs: CPU time, because the clock on the wall counts what else the machine does; three, because
collecting garbage is not the input's fault. Instrumented code is slower than the daemon's, so the bound is on the
safe side. Exit status 0: no escapes and no stalls.
"""

import argparse
import mmap
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

# By target. Packets and requests are read in the daemon's loop; a model is opened in a process that may take 8 s, where
# onnxruntime works on as large constants as the memory allows.
STALL_S = {"decoder": 0.020, "request": 0.020, "model": 1.0}
MAX_BYTES = {"decoder": 2048, "request": 8192, "model": 16_384}
INPUTS, SLOWEST_S, STALLS = range(3)  # what the two processes share


def main() -> int:
    """Run until the time or the number of inputs is reached."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", choices=tuple(MAX_BYTES))
    parser.add_argument("--seconds", type=int, default=60, help="stop after this long (default: 60)")
    parser.add_argument("--inputs", type=int, default=-1, help="stop after so many inputs (default: no bound)")
    parser.add_argument("--seed", type=int, default=1, help="of libFuzzer's choices (default: 1)")
    parser.add_argument("--findings", type=Path, help="folder for what it finds (default: a temporary one)")
    args = parser.parse_args()
    findings = args.findings or Path(tempfile.mkdtemp(prefix="gestured-fuzz-"))
    (findings / "corpus").mkdir(parents=True, exist_ok=True)
    counts = np.frombuffer(mmap.mmap(-1, 8 * 3), np.float64)
    began = time.monotonic()
    # libFuzzer leaves without a word, or dies with what it finds: a child fuzzes, and we say how it went.
    log = findings / "log"
    child = os.fork()
    if child == 0:
        said = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, sys.stdout.fileno())
        os.dup2(said, sys.stderr.fileno())
        _fuzz(args, findings, counts)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    stalls, stall_ms = round(counts[STALLS]), 1000 * STALL_S[args.target]
    if status:
        print(log.read_text(errors="replace")[-4000:], file=sys.stderr)
    print(
        f"{args.target}: {counts[INPUTS]:.0f} inputs in {time.monotonic() - began:.0f} s, escapes {int(status != 0)}, "
        f"stalls over {stall_ms:.0f} ms {stalls}, slowest {1000 * counts[SLOWEST_S]:.1f} ms of CPU time"
        + (f"; see {findings}" if status or stalls else "")
    )
    return int(bool(status or stalls))


def _fuzz(args: argparse.Namespace, findings: Path, counts: np.ndarray) -> None:
    """Never returns."""
    try:
        import atheris
    except ImportError:
        print("fuzzing needs atheris: pip install -e '.[fuzz]' (Linux on x86-64)", file=sys.stderr)
        os._exit(1)
    with atheris.instrument_imports(include=["gestured"]):
        from tests.fuzz import targets
    target, stall_s = targets.TARGETS[args.target], STALL_S[args.target]

    def run(data: bytes) -> float:
        start = time.thread_time()
        target(data)
        return time.thread_time() - start

    def one(data: bytes) -> None:
        counts[INPUTS] += 1
        took = run(data)
        if took > stall_s:
            took = min(took, run(data), run(data))
        if took > stall_s:
            counts[STALLS] += 1
            (findings / f"stall-{counts[STALLS]:.0f}").write_bytes(data)
        counts[SLOWEST_S] = max(counts[SLOWEST_S], took)

    seeds = targets.corpus(args.target)[0].parent
    flags = [
        sys.argv[0], f"-max_total_time={args.seconds}", f"-runs={args.inputs}", f"-seed={args.seed}", "-verbosity=0",
        f"-max_len={MAX_BYTES[args.target]}", f"-artifact_prefix={findings}/", "-timeout=60",
        str(findings / "corpus"), str(seeds),
    ]  # fmt: skip
    atheris.Setup(flags, one)
    atheris.Fuzz()
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main())
