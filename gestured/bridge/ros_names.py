"""A sensor's name as a part of a ROS name.

The daemon takes letters, digits, `_` and `-`. ROS takes no `-` and no digit in front, hides names that begin with `_`,
and discourages `__`. A name without any of these stays as it is, unless it begins with `x`. Any other gets an `x` in
front, and its `_` and `-` are written `_5f` and `_2d`: armrest-1 is xarmrest_2d1. So no two sensors share a topic.
"""

import re

PLAIN = re.compile(r"[A-Za-wyz](_?[A-Za-z0-9])*_?")
WRITTEN = {"_": "_5f", "-": "_2d"}


def token(sensor: str) -> str:
    """The part of a ROS name for a sensor's name."""
    if PLAIN.fullmatch(sensor):
        return sensor
    return "x" + "".join(WRITTEN.get(sign, sign) for sign in sensor)
