"""ROWSxCOLUMNS on the command line."""

import argparse
import re


def rows_by_columns(text: str) -> tuple[int, int]:
    """Rows and columns of a sensor; for argparse."""
    match = re.fullmatch(r"(\d{1,2})x(\d{1,2})", text)
    if match is None or not all(2 <= int(number) <= 64 for number in match.groups()):
        raise argparse.ArgumentTypeError(f"{text!r}: expected ROWSxCOLUMNS, each from 2 to 64, such as 9x9")
    return int(match[1]), int(match[2])
