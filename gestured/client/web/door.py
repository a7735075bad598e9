"""The door of a page: a token in the address that works once, then a secret in a header of each request.

There is no cookie, since browsers send cookies to every port of a host, also to a page of another user on this machine.
A page keeps the secret for its own origin and tab; no other page can read the secret, or send the header.
"""

import hmac
import ipaddress
import secrets
from email.message import Message

from gestured.core.address import Address

HEADER = "X-Gestured-Token"


class Door:
    """The secrets of one run of `program`, which printed the address that opens it."""

    def __init__(self, program: str) -> None:
        self.program = program
        self.token = secrets.token_urlsafe(24)  # in the address; the first browser that brings it comes in
        self._secret = secrets.token_urlsafe(24)  # of the tab that came in
        self._used = False
        self.closed = False  # if so, nobody comes in or is known

    def open(self, headers: Message) -> str | None:
        """The secret, for a request with the unused token or with the secret itself; None for any other."""
        if self.knows(headers):
            return self._secret
        if self.closed or self._used or not _same(headers.get(HEADER, ""), self.token):
            return None
        self._used = True
        return self._secret

    def knows(self, headers: Message) -> bool:
        """Whether a request brings the secret."""
        return not self.closed and _same(headers.get(HEADER, ""), self._secret)


def at_home(headers: Message, address: Address) -> bool:
    """Whether a request was meant for the page at this address, and comes from this page or from no page.

    A page of another site can make a browser send us requests, even under a host name that leads to this machine.
    """
    loopback = {"127.0.0.1", "::1", "localhost"} if is_loopback(address.host) else set()
    homes = [str(Address(host, address.port)) for host in {address.host, *loopback}]
    if address.port == 80:  # browsers leave it out
        homes += [home.removesuffix(":80") for home in homes]
    origin = headers.get("Origin")
    from_here = headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")
    return (
        headers.get("Host") in homes
        and (origin is None or origin in [f"http://{home}" for home in homes])
        and from_here
    )


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())
