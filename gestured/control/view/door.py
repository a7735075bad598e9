"""Who may look, and who may change anything: a token in the address that works once, then a cookie, then a header."""

import hmac
import secrets
from email.message import Message
from http.cookies import CookieError, SimpleCookie


class Door:
    """The secrets of one run."""

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(24)  # in the address; whoever opens it first comes in
        self.header = secrets.token_urlsafe(24)  # what changes anything needs it, and the page alone is told it
        self._cookie = secrets.token_urlsafe(24)
        self._used = False

    def open(self, token: str) -> bool:
        """Whether this token opens the door: once."""
        if self._used or not _same(token, self.token):
            return False
        self._used = True
        return True

    def cookie(self, port: int) -> str:
        """The value of Set-Cookie for who came in: for the browser's session, and no other site's requests."""
        return f"{_name(port)}={self._cookie}; Path=/; HttpOnly; SameSite=Strict"

    def knows(self, headers: Message, port: int) -> bool:
        """Whether a request brings the cookie."""
        try:
            found = SimpleCookie(headers.get("Cookie", "")).get(_name(port))
        except CookieError:
            return False
        return found is not None and _same(found.value, self._cookie)

    def may_change(self, headers: Message) -> bool:
        """Whether a request brings the header that the page alone knows."""
        return _same(headers.get("X-Gestured-Token", ""), self.header)


def at_home(headers: Message, port: int) -> bool:
    """Whether a request was meant for us, and comes from our own page or from nobody's.

    Another site's page can make a browser ask us, under a name of its own that leads to this machine, too.
    """
    homes = [f"{host}:{port}" for host in ("127.0.0.1", "[::1]", "localhost")]
    origin = headers.get("Origin")
    from_here = headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")
    return (
        headers.get("Host") in homes
        and (origin is None or origin in [f"http://{home}" for home in homes])
        and from_here
    )


def _name(port: int) -> str:
    return f"gestured-view-{port}"  # cookies know no ports


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())
