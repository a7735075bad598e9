"""HOST:PORT on the command line."""

import argparse

from gestured.core.address import Address


def host_port(text: str) -> Address:
    """The address of a peer, whose port is known; for argparse."""
    try:
        address = Address.parse(text)
        if address.port:
            return address
    except ValueError:
        pass  # said below, with an example
    raise argparse.ArgumentTypeError(f"{text!r}: expected HOST:PORT, such as 127.0.0.1:9000")


def bind_address(text: str) -> Address:
    """An address of our own, where port 0 means any free one; for argparse."""
    try:
        return Address.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: expected {error}") from None
