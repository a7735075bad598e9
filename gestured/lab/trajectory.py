"""Trajectory features of a window, computed inside the network's graph, and the net that judges by them.

Where the contact went (centroid path at equal distances, as in the $1 recogniser of Wobbrock et al. 2007), how it
turned (winding, signed area), how straight and how fast it was, how wide it was (second moments), how many
fingers there were (local maxima) and how many contacts. They see what a recurrent net does not, and reject other
things: a second opinion.
"""

import torch
import torch.nn.functional as F
from torch import Tensor

from gestured.lab.nets import Opinion, Perceptron, active_frames, last_active, read_at

PATH_POINTS = 8  # of the path
PATCH = 7  # taxels across the mean contact
FLOOR = 0.12  # of the peak: below it a taxel counts for nothing
EPS = 1e-6
MAXIMUM = 0.2  # of the peak: lower local maxima are no fingers


def _mean(values: Tensor, weight: Tensor) -> Tensor:
    return (values * weight).sum(1) / (weight.sum(1) + EPS)


def _spread(values: Tensor, weight: Tensor) -> Tensor:
    mean = _mean(values, weight)
    return (_mean((values - mean[:, None]) ** 2, weight) + EPS).sqrt()


def _top(values: Tensor, weight: Tensor) -> Tensor:
    return (values * weight).amax(1)


def per_frame(x: Tensor) -> dict[str, Tensor]:
    """(B, T, R, C) -> (B, T) series: total, centroid, second moments, area, number of local maxima, peak."""
    rows, columns = x.shape[2], x.shape[3]
    w = F.relu(x - FLOOR)
    total = w.sum((2, 3))
    norm = total + EPS
    at_y = torch.linspace(1.0, -1.0, rows, dtype=x.dtype)  # y upward
    at_x = torch.linspace(-1.0, 1.0, columns, dtype=x.dtype)
    by_row, by_column = w.sum(3), w.sum(2)  # (B, T, R), (B, T, C)
    cy, cx = (by_row * at_y).sum(2) / norm, (by_column * at_x).sum(2) / norm
    vyy = (by_row * at_y**2).sum(2) / norm - cy**2
    vxx = (by_column * at_x**2).sum(2) / norm - cx**2
    vxy = ((w * at_x).sum(3) * at_y).sum(2) / norm - cx * cy
    flat = x.reshape(-1, 1, rows, columns)
    peak = x.flatten(2).amax(2)
    ridge = (flat >= F.max_pool2d(flat, 3, 1, 1)).to(x.dtype).reshape(x.shape)
    high = (x >= 0.35 * peak[:, :, None, None]).to(x.dtype) * (x >= MAXIMUM).to(x.dtype)
    return {
        "total": total,
        "x": cx,
        "y": cy,
        "vxx": vxx.clamp(min=0),
        "vyy": vyy.clamp(min=0),
        "vxy": vxy,
        "area": (x >= 0.3).to(x.dtype).mean((2, 3)),
        "maxima": (ridge * high).sum((2, 3)),
        "peak": peak,
    }


def mean_blob(x: Tensor, s: dict[str, Tensor], weight: Tensor) -> Tensor:
    """(B, T, R, C) -> (B, PATCH * PATCH): the contact, its frames centred and averaged: finger, two, palm."""
    rows, columns = x.shape[2], x.shape[3]
    offset = torch.arange(PATCH, dtype=x.dtype) - PATCH // 2
    row = (1 - s["y"]) / 2 * (rows - 1)
    column = (s["x"] + 1) / 2 * (columns - 1)
    at_row = row[:, :, None, None] + offset[:, None] - torch.arange(rows, dtype=x.dtype)  # (B, T, PATCH, R)
    at_column = column[:, :, None, None] + offset[:, None] - torch.arange(columns, dtype=x.dtype)
    moved = F.relu(1 - at_row.abs()) @ x @ F.relu(1 - at_column.abs()).transpose(2, 3)
    blob = (moved * weight[:, :, None, None]).sum(1) / (weight.sum(1)[:, None, None] + EPS)
    return (blob / (blob.amax((1, 2), keepdim=True) + 0.05)).flatten(1)


def trajectory_features(x: Tensor, lengths: Tensor | None = None) -> Tensor:
    """(B, T, R, C) windows -> (B, F) features; of the idle frames at the end only the first counts.

    `lengths` (B,) as in `nets`.
    """
    time = x.shape[1]
    index = torch.arange(time, dtype=x.dtype)
    active = active_frames(x)
    last = last_active(x).to(x.dtype)[:, None]
    span = (index[None, :] <= last).to(x.dtype)
    s = per_frame(x)
    end = read_at(x, lengths)
    after = s["peak"].gather(1, end[:, None])[:, 0]  # what is still pressed there: little where the gesture is over
    over = (end.to(x.dtype) > last[:, 0]).to(x.dtype)
    blob = mean_blob(x, s, active * s["peak"])
    n = active.sum(1) + EPS
    first = (active * (time - index)).amax(1)
    first = time - first  # index of the first active frame
    duration = (last[:, 0] - first + 1).clamp(min=0)

    # Contacts: rising edges of activity, their gaps and lengths.
    rise = active * (1 - _before(active))
    rises = rise.sum(1)
    pauses = (span * (1 - active) * (index[None, :] >= first[:, None]).to(x.dtype)).sum(1)
    ordinal = rise.cumsum(1)

    # From here on active frames alone, moved to the front in their order: a pause is bridged by the last known place.
    order = torch.sort(index + (1 - active) * 1e6, 1).indices
    s = {name: series.gather(1, order) for name, series in s.items()}
    active, ordinal = active.gather(1, order), ordinal.gather(1, order)
    index = order.to(x.dtype)
    one = active * (ordinal <= 1).to(x.dtype)
    two = active * (ordinal >= 2).to(x.dtype)
    both = active * _before(active)  # a step leads here from an active frame
    weight = active * s["peak"]
    dx, dy = (s["x"] - _before(s["x"])) * both, (s["y"] - _before(s["y"])) * both
    step = (dx**2 + dy**2 + EPS**2).sqrt() * both
    length = step.sum(1)
    mx, my = _mean(s["x"], weight), _mean(s["y"], weight)
    x0, y0 = _ends(s["x"], weight, index, first), _ends(s["y"], weight, index, first)
    x1, y1 = _ends(s["x"], weight, index, last[:, 0]), _ends(s["y"], weight, index, last[:, 0])
    ex, ey = x1 - x0, y1 - y0
    reach = (ex**2 + ey**2 + EPS**2).sqrt()
    high_x, low_x = _top(s["x"] + 2, active) - 2, 2 - _top(2 - s["x"], active)
    high_y, low_y = _top(s["y"] + 2, active) - 2, 2 - _top(2 - s["y"], active)
    width, height = (high_x - low_x).clamp(min=0), (high_y - low_y).clamp(min=0)

    # Turning: winding about the path's middle, signed area, and turning of successive steps (small steps count little).
    rx, ry = s["x"] - ((high_x + low_x) / 2)[:, None], s["y"] - ((high_y + low_y) / 2)[:, None]
    px, py = rx - dx, ry - dy
    cross, dot = px * ry - py * rx, px * rx + py * ry
    moved = (step > 0.02).to(x.dtype) * active
    moved = moved * ((dot > 0) | (cross.abs() > 1e-3 * dot.abs())).to(x.dtype)  # half a turn has no sense
    angle = _angle(cross, dot) * moved
    area = (cross * moved).sum(1) / 2
    qx, qy = _before(dx), _before(dy)
    turn = _angle(qx * dy - qy * dx, qx * dx + qy * dy)
    turn = turn * (step > 0.04).to(x.dtype) * ((qx**2 + qy**2) > 0.0016).to(x.dtype)

    # The path at equal distances, from its middle, and how its parts lie in time.
    share = step / (length[:, None] + EPS)
    reached = share.cumsum(1)
    marks = torch.arange(PATH_POINTS, dtype=x.dtype) / (PATH_POINTS - 1)
    done = ((marks - (reached - share)[:, :, None]) / (share[:, :, None] + 1e-4)).clamp(0, 1)
    path_x = torch.einsum("btk,bt->bk", done, dx) + (s["x"][:, :1] - mx[:, None])
    path_y = torch.einsum("btk,bt->bk", done, dy) + (s["y"][:, :1] - my[:, None])
    size = (width**2 + height**2).sqrt()[:, None] + 0.1
    progress = (index - first[:, None]) / (duration[:, None] + EPS)
    slots = [active * ((progress >= k / 4) & (progress < (k + 1) / 4)).to(x.dtype) for k in range(4)]
    by_slot = [torch.stack([_mean(v, slot) for slot in slots], 1) for v in (s["peak"], s["x"], s["y"], step)]

    # Width of the contact, and how it changes: two fingers, palms, pinches.
    half = ((s["vxx"] - s["vyy"]) ** 2 / 4 + s["vxy"] ** 2 + EPS**2).sqrt()
    middle = (s["vxx"] + s["vyy"]) / 2
    major, minor = (middle + half).clamp(min=0).sqrt(), (middle - half + EPS).clamp(min=EPS).sqrt()
    early, late = slots[0] + slots[1], slots[2] + slots[3]
    several = (s["maxima"] >= 1.5).to(x.dtype)

    single = [
        duration / 15, n / 15, rises, pauses / 15, one.sum(1) / 15, two.sum(1) / 15,
        length, reach, reach / (length + 0.1), ex, ey, ex / (reach + 0.1), ey / (reach + 0.1), width, height,
        _spread(s["x"], weight), _spread(s["y"], weight), step.amax(1), step.amax(1) / (length + 0.1),
        _mean((step < 0.04).to(x.dtype), active), mx, my,
        angle.sum(1), angle.abs().sum(1), area, area / (width * height + 0.05), turn.sum(1), turn.abs().sum(1),
        _mean(s["maxima"], active), s["maxima"].amax(1), _mean(several, active), _mean(several, early),
        _mean(several, late),
        _mean(major, weight), _mean(minor, weight), _mean(s["vxx"], weight), _mean(s["vyy"], weight),
        _mean(s["vxy"], weight), _spread(major, weight), _top(major, active),
        _mean(major, late * weight) - _mean(major, early * weight),
        _mean(s["area"], active), _top(s["area"], active), _spread(s["area"], active),
        _mean(s["peak"], active), _spread(s["peak"], active), _mean(s["total"], active) / 10,
        _spread(s["total"], active) / 10, _top(s["total"], active) / 10,
        _mean(s["x"], two) - _mean(s["x"], one), _mean(s["y"], two) - _mean(s["y"], one),
        _top(s["peak"], one) - _top(s["peak"], two), over, after,
    ]  # fmt: skip
    return torch.cat([torch.stack(single, 1), path_x / size, path_y / size, path_x, path_y, *by_slot, blob], 1)


def _before(v: Tensor) -> Tensor:
    """(B, T) -> the same one frame later, 0 first."""
    return F.pad(v, (1, 0))[:, :-1]


def _angle(y: Tensor, x: Tensor) -> Tensor:
    """atan2, kept away from the places where ONNX has no answer or another one: y = 0 and the origin."""
    still = x * x + y * y < 1e-12
    return torch.atan2(torch.where(still | (y == 0), 1e-9, y), torch.where(still, 1.0, x))


def _ends(v: Tensor, weight: Tensor, index: Tensor, at: Tensor) -> Tensor:
    """(B,) weighted mean within two frames of `at`."""
    near = weight * F.relu(2.0 - (index - at[:, None]).abs())
    return _mean(v, near)


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
