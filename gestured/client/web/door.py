"""Who may look, and who may change anything: a token in the address that works once, then a secret in a header.

There is no cookie: browsers send one to every port of a host, and a neighbour's page on another port of this machine
would be sent it. A page keeps the secret for its own origin and tab, and no other page can read it, or send the header.
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
        self.token = secrets.token_urlsafe(24)  # in the address; whoever opens it first comes in
        self._secret = secrets.token_urlsafe(24)  # of the tab that came in
        self._used = False
        self.closed = False  # from then on nobody is known

    def open(self, headers: Message) -> str | None:
        """The secret for who brings the token, or the secret itself; None for anybody else. The token opens once."""
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
    """Whether a request was meant for the page at this address, and comes from it or from nobody's.

    Another site's page can make a browser ask us, under a name of its own that leads to this machine, too.
    """
    loopback = {"127.0.0.1", "::1", "localhost"} if is_loopback(address.host) else set()
    homes = [str(Address(host, address.port)) for host in {address.host, *loopback}]
    if address.port == 80:  # which browsers leave out
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
