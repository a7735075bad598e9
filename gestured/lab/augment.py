"""Augmentation: variation of windows during training, always after the split and never before it."""

import math

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

# Both tables hold each gesture, even if it keeps its name: a missing one would be trained on its mirror image under its
# own name.
TURN = {  # a quarter turn clockwise, as seen
    "one_tap": "one_tap", "double_tap": "double_tap",
    "swipe_up": "swipe_right", "swipe_right": "swipe_down", "swipe_down": "swipe_left", "swipe_left": "swipe_up",
    "circle_clockwise": "circle_clockwise", "circle_counter_clockwise": "circle_counter_clockwise",
    "swipe_up_two_fingers": "two_finger_swipe_right", "two_finger_swipe_right": "swipe_down_two_fingers",
    "swipe_down_two_fingers": "two_finger_swipe_left", "two_finger_swipe_left": "swipe_up_two_fingers",
}  # fmt: skip
MIRROR = {  # left to right
    "one_tap": "one_tap", "double_tap": "double_tap",
    "swipe_up": "swipe_up", "swipe_right": "swipe_left", "swipe_down": "swipe_down", "swipe_left": "swipe_right",
    "circle_clockwise": "circle_counter_clockwise", "circle_counter_clockwise": "circle_clockwise",
    "swipe_up_two_fingers": "swipe_up_two_fingers", "two_finger_swipe_right": "two_finger_swipe_left",
    "swipe_down_two_fingers": "swipe_down_two_fingers", "two_finger_swipe_left": "two_finger_swipe_right",
}  # fmt: skip


def symmetry_table(classes: list[str]) -> Tensor:
    """(8, K) the class that each class becomes under mirroring (index + 4) and quarter turns clockwise (index % 4).

    A class that TURN and MIRROR do not hold keeps its name.
    """
    place = {name: i for i, name in enumerate(classes)}
    table = np.zeros((8, len(classes)), dtype=np.int64)
    for symmetry in range(8):
        for i, name in enumerate(classes):
            if symmetry >= 4:
                name = MIRROR.get(name, name)
            for _ in range(symmetry % 4):
                name = TURN.get(name, name)
            table[symmetry, i] = place[name]
    return torch.from_numpy(table)


def turned(x: Tensor, symmetry: int) -> Tensor:
    """(B, T, R, C) windows, mirrored and turned by a symmetry of the table."""
    if symmetry >= 4:
        x = x.flip(3)
    return torch.rot90(x, -(symmetry % 4), (2, 3))


def varied(x: Tensor, generator: torch.Generator) -> Tensor:
    """(B, T, R, C) windows -> windows as another sensor, hand or network would have given them.

    Small rotation, scale and shift; gain of single taxels; response curve; crosstalk along rows and columns; blur;
    noise; a lost frame bridged from its neighbours, as `Window` does. The peak stays as it was.
    """
    batch, time = x.shape[:2]

    def draw(*size: int) -> Tensor:
        return torch.rand(*size, generator=generator)

    def some(share: float) -> Tensor:
        return (draw(batch, 1, 1, 1) < share).float()

    peak = x.amax((1, 2, 3), keepdim=True)
    angle = (draw(batch) - 0.5) * (2 * math.pi * 12 / 180)
    scale = torch.exp((draw(batch) - 0.5) * 0.5)
    shift = (draw(batch, 2) - 0.5) * 0.6
    theta = torch.zeros(batch, 2, 3)
    theta[:, 0, 0], theta[:, 0, 1] = scale * angle.cos(), -scale * angle.sin()
    theta[:, 1, 0], theta[:, 1, 1] = scale * angle.sin(), scale * angle.cos()
    theta[:, :, 2] = shift
    moved = F.grid_sample(x, F.affine_grid(theta, list(x.shape), align_corners=False), align_corners=False)
    moved = moved / moved.amax((1, 2, 3), keepdim=True).clamp(min=0.3) * peak
    x = torch.where(some(0.5) > 0, moved, x)
    gain = torch.exp(0.25 * torch.randn(batch, 1, *x.shape[2:], generator=generator) * draw(batch, 1, 1, 1))
    x = torch.where(some(0.4) > 0, x * gain, x)
    x = torch.where(some(0.3) > 0, x.clamp(min=0) ** torch.exp((draw(batch, 1, 1, 1) - 0.5) * 0.9), x)
    rows, columns = (0.12 * draw(batch, 1, 1, 1) * x.mean(over, keepdim=True) * 3 for over in (3, 2))
    x = x + some(0.25) * (rows + columns)
    blurred = F.avg_pool2d(x, 3, 1, 1)
    x = torch.where(some(0.2) > 0, x + (blurred - x) * draw(batch, 1, 1, 1) * 0.7, x)
    if time >= 4:
        lost = torch.randint(1, time - 1, (batch,), generator=generator)
        index = torch.arange(batch)
        bridged = (x[index, lost - 1] + x[index, lost + 1]) / 2
        inside = lost < _last(x)
        keep = ((draw(batch, 1, 1) < 0.8) | ~inside[:, None, None]).float()
        x = x.clone()
        x[index, lost] = keep * x[index, lost] + (1 - keep) * bridged
    noise = torch.randn(x.shape, generator=generator) * (0.08 * draw(batch, 1, 1, 1) ** 2) * some(0.5)
    covered = (torch.arange(time)[None, :] <= _last(x)[:, None]).float()[:, :, None, None]  # padding gets no noise
    x = (x + noise * covered).clamp(min=0)
    return x / x.amax((1, 2, 3), keepdim=True).clamp(min=1e-3) * peak


def _last(x: Tensor) -> Tensor:
    """(B,) index of the last frame that is not padding."""
    return ((x.flatten(2).amax(2) > 0).float() * torch.arange(x.shape[1])).amax(1)
