"""Trajectory features of a window, computed inside the network's graph, and the net that judges by them.

Where the contact went (centroid path at equal distances, as in the $1 recogniser of Wobbrock et al. 2007), how it
turned (winding, signed area), how straight and how fast it was, how wide it was (second moments), how many fingers
there were (local maxima) and how many contacts. They hold what a recurrent net does not see, and reject other contacts:
a second opinion.
"""

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

from gestured.lab.nets import Opinion, Perceptron, read_at
from gestured.model.features import ACTIVE

PATH_POINTS = 8  # of the path
PATCH = 7  # taxels across the mean contact
FLOOR = 0.12  # of the peak: below it a taxel counts for nothing
EPS = 1e-6
MAXIMUM = 0.2  # of the peak: lower local maxima are no fingers


# The series of a frame, and what is found from frame to frame, in the order in which they stand in a tensor.
X, Y, TOTAL, AREA, MAXIMA, PEAK, XX, YY, XY, MAJOR, MINOR, STEP, SLOW, SEVERAL, ONES = range(15)
# Weights of frames: by peak, of all frames, at both ends and in each half; evenly, of all frames, of the first contact,
# of later ones, of each quarter and of each half.
HARD, BEGIN, END, EARLY_HARD, LATE_HARD, ALL, FIRST, LATER, QUARTERS, EARLY, LATE = (*range(9), 12, 13)
SPREAD = ((HARD, X), (HARD, Y), (HARD, MAJOR), (ALL, AREA), (ALL, PEAK), (ALL, TOTAL))
MEANS = (
    (HARD, X), (HARD, Y), (HARD, XX), (HARD, YY), (HARD, XY), (HARD, MAJOR), (HARD, MINOR),
    (ALL, AREA), (ALL, PEAK), (ALL, SLOW), (ALL, MAXIMA), (ALL, SEVERAL), (EARLY, SEVERAL), (LATE, SEVERAL),
)  # fmt: skip
# The place of each single feature, in the order that weights of all model files since version 0.2 expect.
ORDER = [
    0, 1, 5, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 38, 39, 15, 16, 32, 23, 24, 17, 19, 21, 22, 18, 20, 33, 47, 34,
    35, 36, 28, 29, 25, 26, 27, 40, 44, 48, 30, 45, 41, 31, 42, 37, 43, 46, 49, 50, 51, 52, 53,
]  # fmt: skip
BY_QUARTER = tuple((QUARTERS + k, value) for value in (PEAK, X, Y, STEP) for k in range(4))


def _basis(rows: int, columns: int, dtype: torch.dtype) -> Tensor:
    """(R * C, 6) weights of taxels for total, x, y, xx, yy and xy; x to the right, y upward, -1 to 1."""
    at_y, at_x = torch.linspace(1.0, -1.0, rows, dtype=dtype), torch.linspace(-1.0, 1.0, columns, dtype=dtype)
    y, x = torch.meshgrid(at_y, at_x, indexing="ij")
    return torch.stack([torch.ones_like(x), x, y, x * x, y * y, x * y], 2).flatten(0, 1)


def per_frame(x: Tensor) -> Tensor:
    """(B, T, R, C) -> (B, 9, T): the series from `X` to `XY`, which are centroid, what is pressed, second moments."""
    rows, columns = int(x.shape[2]), int(x.shape[3])
    flat = x.flatten(2)
    moments = F.relu(flat - FLOOR) @ _basis(rows, columns, x.dtype)
    total, about = torch.split(moments, [1, 5], 2)
    place, squares, product = torch.split(about / (total + EPS), [2, 2, 1], 2)
    peak = flat.amax(2, keepdim=True)
    each = x.reshape(-1, 1, rows, columns)
    ridge = (each >= F.max_pool2d(each, 3, 1, 1)).reshape(flat.shape)
    high = flat >= (0.35 * peak).clamp(min=MAXIMUM)
    area, maxima = (flat >= 0.3).to(x.dtype).mean(2, keepdim=True), (ridge & high).to(x.dtype).sum(2, keepdim=True)
    second = [(squares - place**2).clamp(min=0), product - place.prod(2, keepdim=True)]
    return torch.cat([place, total, area, maxima, peak, *second], 2).transpose(1, 2)


def mean_blob(x: Tensor, place: Tensor, weight: Tensor) -> Tensor:
    """(B, T, R, C) -> (B, PATCH * PATCH): the mean of centred frames, which tells a finger, two fingers or a palm.

    `place` (B, 2, T) is the centroid of each frame, `weight` (B, 1, T) its weight.
    """
    rows, columns = int(x.shape[2]), int(x.shape[3])
    offset = torch.arange(PATCH, dtype=x.dtype)[:, None] - PATCH // 2
    across, up = place[..., None, None].unbind(1)  # (B, T, 1, 1)
    row, column = (1 - up) * ((rows - 1) / 2), (across + 1) * ((columns - 1) / 2)
    at_row = F.relu(1 - (row + (offset - torch.arange(rows, dtype=x.dtype))).abs())  # (B, T, PATCH, R)
    at_column = F.relu(1 - (column + (offset - torch.arange(columns, dtype=x.dtype))).abs())
    moved = (at_row @ x @ at_column.transpose(2, 3)).flatten(2)
    blob = (weight @ moved)[:, 0] / (weight.sum(2) + EPS)
    return blob / (blob.amax(1, keepdim=True) + 0.05)


def trajectory_features(x: Tensor, lengths: Tensor | None = None) -> Tensor:
    """(B, T, R, C) windows -> (B, F) features; of the idle frames at the end only the first counts.

    `lengths` (B,) as in `nets`. A graph of hundreds of small nodes spends most of its time between the nodes. So series
    (B, n, T) are kept together as long as they are treated alike, and no dimension is dropped before the end.
    """
    time = x.shape[1]
    index = torch.arange(time, dtype=x.dtype)
    series = per_frame(x)
    place, peak = series[:, :TOTAL], series[:, PEAK : PEAK + 1]
    active = (peak >= ACTIVE).to(x.dtype)
    last, first = (active * index).amax(2), time - (active * (time - index)).amax(2)  # (B, 1)
    end = read_at(x, lengths)[:, None]
    over = (end.to(x.dtype) > last).to(x.dtype)
    after = peak.gather(2, end[:, None])[:, 0]  # peak at `end`: little if the gesture is over
    blob = mean_blob(x, place, active * peak)
    duration, n = (last - first + 1).clamp(min=0), active.sum(2)
    rise = active * (1 - _before(active))  # a contact begins

    # From here on active frames alone, moved to the front in their order: a pause is bridged by the last known place.
    order = torch.sort(index + (1 - active) * 1e6, 2).indices
    series = torch.cat([series, active, rise.cumsum(2)], 1)
    series = series.gather(2, order.expand(-1, series.shape[1], -1))
    kept, active, ordinal = torch.split(series, [XY + 1, 1, 1], 1)
    place, _, maxima, peak, squares, product = torch.split(kept, [2, 2, 1, 1, 2, 1], 1)
    index = order.to(x.dtype)
    both = active * _before(active)  # a step leads here from an active frame
    way = (place - _before(place)) * both
    step = (way.square().sum(1, keepdim=True) + EPS**2).sqrt() * both

    # What frames count for.
    one = active * (ordinal <= 1).to(x.dtype)
    near = F.relu(2.0 - (index - torch.stack([first, last], 1)).abs())  # two frames from an end
    progress = (index - first[:, None]) / (duration[:, None] + EPS)
    quarter = torch.arange(4, dtype=x.dtype)[:, None] / 4
    parts = ((progress >= quarter) & (progress < quarter + 0.25)).to(x.dtype) * active
    halves = torch.cat([parts[:, :2].sum(1, keepdim=True), parts[:, 2:].sum(1, keepdim=True)], 1)
    frames = torch.cat([one, active - one], 1)
    weights = torch.cat([torch.cat([active, near * active, halves], 1) * peak, active, frames, parts, halves], 1)

    # Means, and how far values lie from them. How wide a contact is, and whether that changes, tells fingers and palms.
    middle = squares.sum(1, keepdim=True) / 2
    half = ((middle - squares[:, :1]).square() + product.square() + EPS**2).sqrt()
    radii = torch.cat([middle + half, middle - half + EPS], 1).clamp(min=EPS).sqrt()
    flags = torch.cat([step < 0.04, maxima >= 1.5, step >= 0], 1).to(x.dtype)
    values = torch.cat([kept, radii, step, flags], 1)  # (B, 15, T), from `X` to `ONES`
    sums = weights @ values.transpose(1, 2)  # (B, 14, 15), weights from `HARD` to `LATE`
    counts = sums[:, :, ONES:]
    means = sums / (counts + EPS)
    some, other = [value for _, value in SPREAD], [weight for weight, _ in SPREAD]
    apart = (values[:, some] - _picked(means, SPREAD)[:, :, None]).square() * weights[:, other]
    spread = (apart.sum(2) / (counts[:, other, 0] + EPS) + EPS).sqrt()
    lifted = torch.cat([place + 2, 2 - place, values[:, [MAJOR, AREA, TOTAL, MAXIMA, STEP]]], 1) * active
    top = torch.cat([lifted, frames * peak], 1).amax(2)
    high, low, widest, largest, heaviest, most, longest, harder = torch.split(top, [2, 2, 1, 1, 1, 1, 1, 2], 1)
    high, low = high - 2, 2 - low
    box = (high - low).clamp(min=0)  # width and height
    begun, ended = torch.split(_picked(means, ((BEGIN, X), (BEGIN, Y), (END, X), (END, Y))), [2, 2], 1)
    moved = ended - begun
    length, reach = sums[:, ALL, STEP : STEP + 1], (moved.square().sum(1, keepdim=True) + EPS**2).sqrt()

    # Turning: winding about the path's middle, signed area, and turning of successive steps (small steps count little).
    towards, before = place - ((high + low) / 2)[:, :, None], _before(way)
    a, b = torch.stack([towards - way, before], 2), torch.stack([towards, way], 2)  # (B, 2, 2, T): x and y first
    crossed, dot = a * b.flip(1), (a * b).sum(1)
    cross = crossed[:, 0] - crossed[:, 1]
    sense = (dot > 0) | (cross.abs() > 1e-3 * dot.abs())  # half a turn has no sense of rotation
    winds = (step > 0.02) & (active > 0) & sense[:, :1]
    turns = (step > 0.04) & (before.square().sum(1, keepdim=True) > 0.0016)
    counted = torch.cat([winds, turns], 1).to(x.dtype)
    angle = _angle(cross, dot) * counted
    area = (cross * counted).sum(2)[:, :1] / 2

    # The path at equal distances, from its middle.
    share = step / (length[:, None] + EPS)
    share = share.transpose(1, 2)
    marks = torch.arange(PATH_POINTS, dtype=x.dtype) / (PATH_POINTS - 1)
    done = ((marks - (share.cumsum(1) - share)) / (share + 1e-4)).clamp(0, 1)  # (B, T, PATH_POINTS)
    path = way @ done + place[:, :, :1] - means[:, HARD, :TOTAL, None]
    path = path.flatten(1)
    size = box.square().sum(1, keepdim=True).sqrt() + 0.1

    single = torch.cat([
        torch.cat([duration, n, duration - n, counts[:, [FIRST, LATER], 0]], 1) / 15, rise.sum(2),
        length, reach, reach / (length + 0.1), moved, moved / (reach + 0.1), box, longest, longest / (length + 0.1),
        angle.sum(2), angle.abs().sum(2), area, area / (box.prod(1, keepdim=True) + 0.05),
        _picked(means, MEANS), _picked(means, ((ALL, TOTAL),)) / 10, spread[:, :5], spread[:, 5:] / 10,
        widest, largest, heaviest / 10, most, means[:, LATE_HARD, MAJOR:MINOR] - means[:, EARLY_HARD, MAJOR:MINOR],
        means[:, LATER, :TOTAL] - means[:, FIRST, :TOTAL], harder[:, :1] - harder[:, 1:], over, after,
    ], 1)  # fmt: skip
    return torch.cat([single[:, ORDER], path / size, path, _picked(means, BY_QUARTER), blob], 1)


def _picked(means: Tensor, pairs: Sequence[tuple[int, int]]) -> Tensor:
    """(B, 14, 15) means -> (B, n): those of the given pairs of weight and value."""
    return means.flatten(1)[:, [weight * (ONES + 1) + value for weight, value in pairs]]


def _before(v: Tensor) -> Tensor:
    """(..., T) -> the values of the frame before, 0 first."""
    return F.pad(v, (1, -1))


def _angle(y: Tensor, x: Tensor) -> Tensor:
    """atan2, kept away from arguments for which ONNX has no answer or another one: y = 0 and the origin."""
    still = x * x + y * y < 1e-12
    return torch.atan2(torch.where(still | (y == 0), 1e-9, y), torch.where(still, 1.0, x))


class TrajectoryNet(Opinion):
    """Windows -> logits, by trajectory features alone."""

    def __init__(self, rows: int, columns: int, classes: int) -> None:
        super().__init__()
        features = trajectory_features(torch.zeros(1, 3, rows, columns)).shape[1]
        self.perceptron = Perceptron(features, classes)

    def embed(self, x: Tensor, lengths: Tensor | None = None) -> Tensor:
        """(B, T, R, C) -> (B, units): the last hidden layer."""
        return self.perceptron.embed(trajectory_features(x, lengths))

    def judge(self, state: Tensor) -> Tensor:
        """(B, units) -> (B, classes) logits."""
        logits: Tensor = self.perceptron.layers[-1](state)
        return logits
