"""HOST:PORT on the command line."""

import argparse
import re


def host_port(text: str) -> tuple[str, int]:
    """HOST:PORT or [HOST]:PORT as (host, port); for argparse."""
    match = re.fullmatch(r"(?:\[([^\[\]\s]+)\]|([^\[\]:/\s]+)):(\d{1,5})", text)
    if match is None or not 0 < int(match[3]) < 65536:
        raise argparse.ArgumentTypeError(f"{text!r}: expected HOST:PORT, such as 127.0.0.1:9000")
    return match[1] or match[2], int(match[3])
