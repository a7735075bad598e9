"""How an MQTT broker is reached, and why it is not: address, login, encryption, and its refusals in words."""

import argparse
import os
import ssl
from pathlib import Path

from gestured.bridge.options import BridgeError, peer_address
from gestured.core.address import Address

PLAIN_PORT, TLS_PORT = 1883, 8883  # registered with IANA
LOST = 128  # the reason code that the library gives where the broker named none
_LOGIN = "set MQTT_USER and MQTT_PASSWORD, or --credentials FILE, as the broker knows them"
# Reason codes of MQTT 5 (docs.oasis-open.org/mqtt/mqtt/v5.0, 2.4) after which waiting is no help.
REFUSALS = {
    132: "it does not speak MQTT 5: use a broker that does, such as mosquitto 1.6 or newer",
    133: "it does not take the name gestured-{host}: choose another one with --host",
    134: f"user or password are wrong: {_LOGIN}",
    135: f"this user may not connect: {_LOGIN}",
    138: "we are banned: ask whoever runs it",
    142: "another bridge has the same name, {host}: give each its own with --host",
}


def broker_address(text: str, tls: bool) -> Address:
    """HOST or HOST:PORT. Raises BridgeError."""
    try:
        return peer_address(text, TLS_PORT if tls else PLAIN_PORT)
    except argparse.ArgumentTypeError as error:
        raise BridgeError(f"--broker {error}") from None


def credentials(path: Path | None) -> tuple[str | None, str | None]:
    """User and password, from the file or else from the environment. Raises BridgeError."""
    if path is None:
        return os.environ.get("MQTT_USER"), os.environ.get("MQTT_PASSWORD")
    try:
        with path.open() as file:
            if os.fstat(file.fileno()).st_mode & 0o007:
                raise BridgeError(f"--credentials {path}: everybody can read it: chmod o= {path}")
            user, colon, password = file.readline(4096).rstrip("\n").partition(":")
    except (OSError, UnicodeDecodeError) as error:
        raise BridgeError(f"--credentials {path}: {getattr(error, 'strerror', 'is no text')}") from None
    if not user or not colon:
        raise BridgeError(f"--credentials {path}: expected one line, USER:PASSWORD")
    return user, password


def tls_context(args: argparse.Namespace) -> ssl.SSLContext | None:
    """How to encrypt; None for a plain connection. Raises BridgeError."""
    if not args.tls:
        if args.ca or args.cert:
            raise BridgeError("--ca and --cert are for encrypted connections: add --tls")
        return None
    for flag, path in (("--ca", args.ca), ("--cert", args.cert)):
        if path is not None and not os.access(path, os.R_OK):
            raise BridgeError(f"{flag} {path}: there is no such file that we may read")
    try:
        context = ssl.create_default_context(cafile=args.ca)
        if args.cert:
            context.load_cert_chain(args.cert)
    except ssl.SSLError as error:
        raise BridgeError(f"--ca or --cert: {error.reason or error}: expected certificates in PEM form") from None
    return context


def why(error: BaseException, broker: Address, host: str) -> str:
    """The error that ended a connection, in words. Raises BridgeError where waiting does not help."""
    said = str(error)
    if "CERTIFICATE_VERIFY_FAILED" in said:
        wrong = said.partition("verify failed: ")[2].partition(" (_ssl")[0] or said
        raise BridgeError(
            f"the certificate of the broker {broker} is not to be trusted: {wrong}: name its authority with "
            "--ca FILE, and the broker as its certificate does"
        )
    code = getattr(getattr(error, "rc", None), "value", 0)
    if code in REFUSALS:
        raise BridgeError(f"the broker {broker} refuses us: {REFUSALS[code].format(host=host)}")
    if "timed out" in said:
        return "it does not answer as an MQTT broker does (is it one with TLS: --tls?)"
    if code == LOST:
        return "it closed the connection"
    return said
