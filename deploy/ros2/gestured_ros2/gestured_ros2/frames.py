"""Frames from messages of the type `sensor_msgs/Image`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

ENCODING = "32FC1"  # OpenCV's name for one float32 a pixel
SIDES = range(2, 65)  # rows and columns that a frame may have


def values_of(image: Any) -> NDArray[np.float32]:
    """The frame (rows, columns) of an image, the top row first. Raises ValueError with what was expected."""
    rows, columns, step = image.height, image.width, image.step
    if image.encoding != ENCODING:
        raise ValueError(f"encoding {image.encoding!r}: expected {ENCODING!r}")
    if rows not in SIDES or columns not in SIDES:
        raise ValueError(f"{rows}x{columns} taxels: expected sides of {SIDES[0]} to {SIDES[-1]}")
    if step < 4 * columns or len(image.data) != rows * step:
        raise ValueError(f"step {step} and {len(image.data)} bytes: expected 4 bytes a taxel, {rows} times step in all")
    lines = np.frombuffer(image.data, np.uint8).reshape(rows, step)[:, : 4 * columns]
    values = np.ascontiguousarray(lines).view(">f4" if image.is_bigendian else "<f4").astype(np.float32)
    if not np.isfinite(values).all():
        raise ValueError("not all values are finite")
    return values
