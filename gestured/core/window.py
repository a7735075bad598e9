"""The window: a segment in a model's grid, rate and scale, as its net takes it. A model's metadata describe it."""

import json
import math
from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from gestured.core.frames import Segment
from gestured.core.quantiles import median

# Shares of the model's interval, by which a sensor's interval may be longer or shorter for its frames to be taken as
# they are: an average over a faster sensor's frames blurs taps. Models have learned to see slower ones interpolated.
LONGER, SHORTER = 0.12, 0.45
SLACK = 0.25  # of the model's interval: a window is so much longer, since jitter must not decide whether a frame is in
USED = 0.3  # of the most pressed row or column of a long sensor: rows or columns above that are part of the movement
RIM = 2.0  # taxel pitches around the movement that are taken in with it, on both sides together
DEEPEST = 1e6  # times the peak: values are cut off so far below the baseline
LEAST_PEAK = 1e-37  # counts; its reciprocal is still a number in float32


@dataclass(frozen=True, slots=True)
class Window:
    """How a segment is prepared for one model."""

    rows: int
    columns: int
    rate_hz: float
    smooth_frames: int  # running average over so many frames (paper, section on preprocessing); 1 is none
    lead_s: float  # quiet time before the first touched frame
    tail_s: float  # quiet time after the last touched frame
    floor: float  # the segment's peak counts as at least so many times the sensor's noise

    def to_json(self) -> str:
        """The settings as JSON, for a model's metadata."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Window":
        """Read what `to_json` wrote; raises ValueError naming the key."""
        try:
            found = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"window: expected a JSON object, {error}") from error
        names = {f.name: f.type for f in fields(cls)}
        if not isinstance(found, dict) or set(found) != set(names):
            odd = sorted(set(found) ^ set(names)) if isinstance(found, dict) else []
            raise ValueError(
                f"window: expected exactly the keys {', '.join(names)}; at fault: {', '.join(odd) or found!r}"
            )
        for name, kind in names.items():
            value = found[name]
            whole = kind is int
            low = 2 if name in ("rows", "columns") else 1 if whole else 0
            if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
                raise ValueError(f"window: {name}: expected a{' whole' if whole else ''} number, found {value!r}")
            if not low <= value <= 1000 or (name == "rate_hz" and value <= 0):
                raise ValueError(f"window: {name}: expected a number from {low} to 1000, found {value!r}")
        return cls(**found)

    def apply(self, segment: Segment) -> NDArray[np.float32]:
        """(T, R, C) segment -> (T', rows, columns) float32, from 0 to 1 at the segment's own peak."""
        return np.maximum(self.signed(segment), np.float32(0.0))

    def signed(self, segment: Segment) -> NDArray[np.float32]:
        """As `apply`, but with negative values below the baseline, where something was let go."""
        start, end = self.span(segment)
        frames, times = segment.frames[start:end].astype(np.float64), segment.times[start:end]
        frames = self._regrid(frames, segment)
        frames = self._retime(frames, times, float(median(np.diff(segment.times))) if len(times) > 1 else 0.0)
        if self.smooth_frames > 1:
            frames = running_mean(frames, self.smooth_frames)
        peak = max(float(frames.max()), self.floor * segment.noise, LEAST_PEAK)
        return np.maximum(frames / peak, -DEEPEST).astype(np.float32)

    def span(self, segment: Segment) -> tuple[int, int]:
        """The indices [start, end) of its frames: from `lead_s` before the onset to `tail_s` after the offset."""
        slack = SLACK / self.rate_hz
        start = int(np.searchsorted(segment.times, segment.onset - self.lead_s - slack))
        return start, int(np.searchsorted(segment.times, segment.offset + self.tail_s + slack))

    def _regrid(self, frames: NDArray[np.float64], segment: Segment) -> NDArray[np.float64]:
        """The model's grid of a square around the touched place: area average, or bilinear if the sensor is coarser.

        A square keeps the shape of directions and circles on a long sensor. Its side is the sensor's shorter side, or
        the length of the movement if that is longer.
        """
        _, rows, columns = frames.shape
        if (rows, columns) == (self.rows, self.columns):
            return frames
        side = float(min(rows, columns))
        top, left = (rows - side) / 2, (columns - side) / 2
        if rows != columns:
            axis = 1 if rows > columns else 2  # the longer one
            touched = segment.frames[segment.first : segment.last + 1]
            profile = np.maximum(touched.max(axis=(0, 3 - axis)), 0.0)
            used = np.flatnonzero(profile >= USED * profile.max())
            length = frames.shape[axis]
            low, high = float(used[0]), float(used[-1] + 1)
            side = min(max(side, high - low + RIM), float(length))
            start = min(max((low + high - side) / 2, 0.0), length - side)
            top, left = (start, (columns - side) / 2) if axis == 1 else ((rows - side) / 2, start)
        vertical = _resize(rows, top, side, self.rows)
        horizontal = _resize(columns, left, side, self.columns)
        return np.asarray(vertical @ frames @ horizontal.T)

    def keeps(self, usual: float) -> bool:
        """Whether frames that are usually so many seconds apart are taken as they are."""
        step = 1.0 / self.rate_hz
        return -SHORTER * step <= usual - step <= LONGER * step

    def _retime(self, frames: NDArray[np.float64], times: NDArray[np.float64], usual: float) -> NDArray[np.float64]:
        """Frames at `rate_hz`, by time stamps: averaged if the sensor is faster, interpolated if it is slower.

        At a rate near the model's they are taken as they are. To a model of 15 Hz a gesture at 20 Hz then seems a third
        slower, and people differ by as much; `experiments.rates` prints what a rate costs. `usual` is the sensor's
        interval in seconds, of all frames of the segment, since those of a tap are too few.
        """
        if len(times) < 2:
            return frames
        step = 1.0 / self.rate_hz
        steps = np.diff(times)
        flat = frames.reshape(len(frames), -1)
        if self.keeps(usual):
            missing = np.maximum(np.rint(steps / min(usual, step)).astype(int), 1)
            at = np.concatenate([[0], np.cumsum(missing)])
            if at[-1] + 1 == len(flat):
                return frames
            grid = np.arange(at[-1] + 1)
            out = _interpolate(grid.astype(float), at.astype(float), flat)
        else:
            # Half a step beyond the end nothing is left to average. Rounding must not decide whether that frame counts.
            whole = max(math.ceil((times[-1] - times[0]) * self.rate_hz - 0.5 - 1e-6), 0)
            grid = np.arange(whole + 1) * step + times[0]
            if usual > step:
                out = _interpolate(grid, times, flat)
            else:
                out = _box_mean(grid, step, times, flat)
        return out.reshape(len(out), *frames.shape[1:])


def _resize(size: int, start: float, side: float, cells: int) -> NDArray[np.float64]:
    """(cells, size) weights from `side` taxels, from `start` on, to `cells`; what lies outside the grid counts as 0."""
    width = side / cells
    taxel = np.arange(size)
    if width >= 1.0:
        low = start + width * np.arange(cells)[:, None]
        overlap = np.minimum(low + width, taxel + 1.0) - np.maximum(low, taxel)
        return np.asarray(np.maximum(overlap, 0.0) / width)
    centre = start + width * (np.arange(cells)[:, None] + 0.5) - 0.5
    centre = np.clip(centre, start, start + side - 1.0)
    return np.asarray(np.maximum(1.0 - np.abs(centre - taxel), 0.0))


def _interpolate(
    grid: NDArray[np.float64], times: NDArray[np.float64], flat: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Linear interpolation in time, (T, N) -> (len(grid), N); constant beyond the ends."""
    right = np.clip(np.searchsorted(times, grid), 1, len(times) - 1)
    share = np.clip((grid - times[right - 1]) / (times[right] - times[right - 1]), 0.0, 1.0)[:, None]
    return np.asarray(flat[right - 1] * (1 - share) + flat[right] * share)


def _box_mean(
    grid: NDArray[np.float64], step: float, times: NDArray[np.float64], flat: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean of the piecewise linear signal over `step` seconds around each time of `grid`."""
    edges = np.clip(np.stack([grid - step / 2, grid + step / 2]), times[0], times[-1])
    areas = np.diff(times)[:, None] * (flat[1:] + flat[:-1]) / 2
    total = np.concatenate([np.zeros((1, flat.shape[1])), np.cumsum(areas, axis=0)])  # integral up to each time
    sums = []
    for edge in edges:
        left = np.clip(np.searchsorted(times, edge, side="right") - 1, 0, len(times) - 2)
        here = _interpolate(edge, times, flat)
        sums.append(total[left] + (edge - times[left])[:, None] * (flat[left] + here) / 2)
    return np.asarray((sums[1] - sums[0]) / np.maximum(edges[1] - edges[0], 1e-12)[:, None])


def running_mean(frames: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """The mean of (T, ...) frames over `length` of them around each, over fewer at the ends."""
    before, after = length // 2, (length - 1) // 2
    n = len(frames)
    return np.stack([frames[max(0, k - before) : min(n, k + after + 1)].mean(axis=0) for k in range(n)])
