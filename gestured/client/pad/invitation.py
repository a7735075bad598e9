"""The invitation to a pad: what its address opens, and that address as a QR code."""

import io
import sys

from gestured.client.pad.server import PadServer
from gestured.client.say import say, say_drawn
from gestured.client.web.door import is_loopback

WHAT_IT_OPENS = """\
Whoever opens this address first may send frames from this machine to {to} as the sensor {name},
for as long as it serves: they come from its own loopback, so --allow does not keep them out. Nothing is encrypted:
who hears the network can hear the token and the touches, and take the pad over."""


def invite(server: PadServer) -> None:
    """Say on standard error what the address opens, and print it as a QR code if that is a terminal."""
    if is_loopback(server.address.host):
        say("Open this address in a browser on this machine; it works once.", to=sys.stderr)
        return
    if sys.stderr.isatty():
        try:
            import segno
        except ImportError:
            say("With the extra [pad] (pip install 'gestured[pad]') it is printed as a QR code, too.", to=sys.stderr)
        else:
            drawn = io.StringIO()
            segno.make(server.page, micro=False).terminal(drawn, border=2, compact=True)
            say_drawn(drawn.getvalue(), to=sys.stderr)
    say(*WHAT_IT_OPENS.format(to=server.pad.to, name=server.pad.name).splitlines(), to=sys.stderr)
