"""`gestured-lab inspect`: what a file of recordings holds, in figures and drawn with characters."""

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.client.picture import draw, shrunk
from gestured.client.say import say, say_drawn, say_json
from gestured.core.errors import GesturedError
from gestured.lab.recordings.protocol import INCLINATION_NAMES
from gestured.lab.recordings.quality import gaps
from gestured.lab.recordings.safe import LEFT_OUT_SHOWN, LeftOut, read_what_is_good
from gestured.record.recordings import Recordings

BAR = 30  # characters
DRAWN_FRAMES = 72  # frames of a drawn pressure; longer recordings are drawn in groups of frames
SNAPSHOTS = 6
BARS = "▁▂▃▄▅▆▇█"


def run(args: argparse.Namespace) -> int:
    """Print what the file holds, or one of its recordings."""
    recordings, left = read_what_is_good(args.file)
    if not len(recordings):
        raise GesturedError(f"{args.file}: none of its recordings can be used; {left[0] if left else 'it is empty'}")
    if args.index is None:
        figures = overview(recordings)
    elif 0 <= args.index < len(recordings):
        figures = one(recordings, args.index)
    else:
        raise GesturedError(f"--index: expected 0 to {len(recordings) - 1}, found {args.index}")
    figures = {"file": str(args.file)} | figures | {"left_out": [str(what) for what in left]}
    if args.json:
        say_json(figures)
        return 0
    _tell(args.file, figures, left)
    colour = sys.stdout.isatty()
    drawn = _map(recordings, colour) if args.index is None else _gesture(recordings, args.index, colour)
    say_drawn("\n".join(drawn))
    return 0


def overview(r: Recordings) -> dict[str, Any]:
    """Counts and figures over all recordings; times in seconds, pressure in counts above each taxel's own median."""
    rows, columns = r.frames.shape[1:]
    timing = [_timing(r.times_of(i)) for i in range(len(r))]
    found: dict[str, Any] = {
        "recordings": len(r),
        "grid": f"{rows}x{columns}",
        "frames": len(r.frames),
        "seconds": round(float(sum(r.times_of(i)[-1] - r.times_of(i)[0] for i in range(len(r)))), 2),
        "labels": _counts(r.labels),
        "participants": _counts(r.subjects),
    }
    for name in ("speeds", "inclinations", "consents"):
        value = getattr(r, name)
        if value is not None:
            found[name] = _counts(_words(value) if name == "inclinations" else value)
    if r.event_labels is not None:
        found["events"] = _counts(r.event_labels)
    rates = [t["rate_hz"] for t in timing if t["rate_hz"]]
    found |= {
        "rate_hz": round(float(np.median(rates)), 2) if rates else None,
        "jitter_ms": round(float(np.median([t["jitter_ms"] for t in timing])), 2),
        "lost_frames": sum(t["lost_frames"] for t in timing),
        "peak": _spread([_peak(r.frames_of(i)) for i in range(len(r))]),
        "touched_s": _spread(_touched_s(r)) if r.onsets is not None and r.releases is not None else None,
    }
    return found


def one(r: Recordings, index: int) -> dict[str, Any]:
    """What is known of one recording."""
    times = r.times_of(index)
    found: dict[str, Any] = {"index": index, "label": str(r.labels[index]), "participant": str(r.subjects[index])}
    for name in ("kinds", "speeds", "inclinations", "consents", "onsets", "releases"):
        value = getattr(r, name)
        if value is not None:
            value = _words(value) if name == "inclinations" else value
            found[name.removesuffix("s")] = value[index].item()
    found |= {"frames": len(times), "seconds": round(float(times[-1] - times[0]), 3)} | _timing(times)
    found["peak"] = round(_peak(r.frames_of(index)), 1)
    if r.event_recording is not None and r.event_labels is not None:
        found["events"] = _counts(r.event_labels[r.event_recording == index])
    return found


def _counts(values: NDArray[Any]) -> dict[str, int]:
    return dict(sorted(Counter(map(str, values.tolist())).items()))


def _words(inclinations: NDArray[Any]) -> NDArray[Any]:
    """As the protocol calls them, where they are its numbers; else as they are."""
    if inclinations.dtype.kind in "iu" and np.isin(inclinations, range(len(INCLINATION_NAMES))).all():
        return np.take(np.array(INCLINATION_NAMES), inclinations)
    return inclinations


def _timing(times: NDArray[np.float64]) -> dict[str, Any]:
    """Rate by the median step; jitter is the median absolute deviation of the steps, scaled to a standard deviation."""
    steps = np.diff(times)
    if not len(steps):
        return {"rate_hz": None, "jitter_ms": 0.0, "lost_frames": 0}
    usual = float(np.median(steps))
    jitter_ms = 1482.6 * float(np.median(np.abs(steps - usual)))
    return {"rate_hz": round(1 / usual, 2), "jitter_ms": round(jitter_ms, 2), "lost_frames": int(gaps(times).sum())}


def _rise(frames: NDArray[Any]) -> NDArray[np.float64]:
    """(T, R, C) counts above each taxel's idle count, which is taken to be its lower quartile."""
    values = frames.astype(np.float64)
    return np.asarray(np.maximum(values - np.quantile(values, 0.25, axis=0), 0.0))


def _peak(frames: NDArray[Any]) -> float:
    return float(_rise(frames).max())


def _touched_s(r: Recordings) -> list[float]:
    """How long each was touched; a frame stands for the time to the next one."""
    assert r.onsets is not None and r.releases is not None
    found = []
    for i in range(len(r)):
        times = r.times_of(i)
        step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        found.append(float(times[r.releases[i]] - times[r.onsets[i]]) + step)
    return found


def _spread(values: list[float]) -> dict[str, float]:
    low, median, high = np.quantile(values, (0.05, 0.5, 0.95))
    return {"p5": round(float(low), 3), "median": round(float(median), 3), "p95": round(float(high), 3)}


def _tell(file: Path, figures: dict[str, Any], left: list[LeftOut]) -> None:
    say(file)
    for name, value in figures.items():
        if name in ("file", "left_out") or value is None or value == {}:
            continue
        title = name.replace("_", " ")
        if name in ("peak", "touched_s") and isinstance(value, dict):
            say(f"  {title:<14}{value['median']:g} (5 to 95 %: {value['p5']:g} to {value['p95']:g})")
        elif isinstance(value, dict):
            most = max(value.values())
            for k, (key, count) in enumerate(value.items()):
                bar = "█" * max(1, round(BAR * count / most))
                say(f"  {title if not k else '':<14}{key or '(not known)':<26}{count:6d}  {bar}")
        else:
            say(f"  {title:<14}{value}")
    for what in left[:LEFT_OUT_SHOWN]:
        say(f"  {what}")
    say(f"  {'left out':<14}{len(left)}")


def _map(r: Recordings, colour: bool) -> list[str]:
    """Where it was touched: every recording's peak of each taxel, averaged."""
    total = np.mean([_rise(r.frames_of(i)).max(axis=0) for i in range(len(r))], axis=0)
    return ["", "  where it was touched", *(f"  {line}" for line in draw(shrunk(_scaled(total)), colour))]


def _gesture(r: Recordings, index: int, colour: bool) -> list[str]:
    """The pressure summed over the taxels against time, and snapshots of it."""
    rise = _rise(r.frames_of(index))
    times = r.times_of(index)
    groups = np.array_split(np.arange(len(rise)), min(DRAWN_FRAMES, len(rise)))
    summed = np.array([rise[group].sum(axis=(1, 2)).max() for group in groups])
    levels = _scaled(summed - summed.min())
    drawn = "".join(BARS[round((len(BARS) - 1) * float(level))] for level in levels)
    first, last = 0, len(rise) - 1
    lines = ["", f"  {drawn}  {times[-1] - times[0]:.2f} s"]
    if r.onsets is not None and r.releases is not None:
        first, last = int(r.onsets[index]), int(r.releases[index])
        marks = "".join("━" if group[-1] >= first and group[0] <= last else " " for group in groups)
        lines.append(f"  {marks}  touched")
    chosen = np.unique(np.linspace(first, last, SNAPSHOTS).round().astype(int))
    top = max(float(rise.max()), 1e-30)
    pictures = [draw(shrunk((rise[k] / top).astype(np.float32)), colour) for k in chosen]
    lines += ["", *("  " + "   ".join(row) for row in zip(*pictures, strict=True))]
    lines.append("  " + "   ".join(f"{times[k] - times[0]:<9.2f}" for k in chosen).rstrip())
    return lines


def _scaled(values: NDArray[Any]) -> NDArray[np.float32]:
    return np.asarray(values / max(float(values.max()), 1e-30), np.float32)
