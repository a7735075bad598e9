"""Who the bridge to MQTT is to a broker: user and password, and the certificates of an encrypted connection."""

import argparse
import os
import ssl
from pathlib import Path

from gestured.bridge.options import BridgeError


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
