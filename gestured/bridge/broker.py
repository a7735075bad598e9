"""An MQTT broker: its address, the bridge's login, and why it is not there, in words. Only this imports paho-mqtt."""

import argparse
import os
import ssl
from collections.abc import Callable
from typing import Any

from gestured.bridge.options import LONGEST_S, BridgeError, peer_address
from gestured.core.messages import quoted

PLAIN_PORT, TLS_PORT = 1883, 8883  # registered with IANA
BROKER_S = 5.0  # the longest wait for the broker while connecting
KEEPALIVE_S = 5  # each side takes the other for dead after one and a half times as long without a packet
MOST_BYTES = 65_536  # the largest packet that the broker may send, as CONNECT says; commands are much smaller
ANY_BYTES = 268_435_460  # the largest packet that MQTT knows
HEADER_BYTES = 15  # the most bytes of a PUBLISH of ours beside its topic and payload
_LOGIN = "set MQTT_USER and MQTT_PASSWORD as the broker knows them"
# Reason codes of MQTT 5 (docs.oasis-open.org/mqtt/mqtt/v5.0, 2.4) after which waiting does not help.
NOT_ALLOWED, TOO_LARGE, NO_RETAIN, NO_QOS_1 = 135, 149, 154, 155
REFUSALS = {
    132: "it does not speak MQTT 5: use a broker that does, such as mosquitto 1.6 or newer",
    133: "it does not take the name gestured-{host}: choose another one with --host",
    134: f"user or password are wrong: {_LOGIN}",
    NOT_ALLOWED: f"this user may not connect: {_LOGIN}",
    138: "we are banned: ask whoever runs it",
    142: "another bridge has the same name, {host}: give each its own with --host",
    TOO_LARGE: "it takes no packets as large as ours, which have a few KiB: let it take them",
    NO_RETAIN: "it retains nothing, and whether a sensor is there must be told to whoever comes later: let it retain",
    NO_QOS_1: "it takes no messages with QoS 1, and others may get lost: let it take them",
}
# Reason codes of a PUBLISH: unspecified, one of the broker's own, number in use, quota. The next message may be taken.
PASSING = frozenset((128, 131, 145, 151))
CLOSED, SILENT = 128, 141  # codes of the library: the broker gave no code, or was silent for too long


class Broker:
    """The address of a broker, and the bridge's login there."""

    def __init__(self, args: argparse.Namespace, host: str) -> None:
        """`host` is this machine's name in topics. Raises BridgeError for arguments that cannot be used."""
        try:
            self.address = peer_address(args.broker, TLS_PORT if args.tls else PLAIN_PORT)
        except argparse.ArgumentTypeError as error:
            raise BridgeError(f"--broker {error}") from None
        self._host, self._prefix = host, args.discovery
        if not self._prefix.rpartition("/")[2] or set("#+") & set(self._prefix) or not self._prefix.isprintable():
            expected = "expected the beginning of a topic, without #, +, and a / at its end"
            raise BridgeError(f"--discovery {quoted(self._prefix)}: {expected}")
        self._user, self._password = _variable("MQTT_USER"), _variable("MQTT_PASSWORD")
        if args.gates is not None and self._user is None and args.cert is None:
            raise BridgeError(f"--gates: a broker that knows nobody may close no gate: {_LOGIN}, or name a --cert")
        self._tls = tls_context(args)

    def client(self, will: str) -> Any:
        """A client for one connection. The broker publishes `offline` at the topic `will` if the client vanishes.

        The client's `on_failure` must be set: its thread calls `on_failure` if it dies of an exception.
        """
        from paho.mqtt.client import Client, MQTTv5
        from paho.mqtt.enums import CallbackAPIVersion

        class Guarded(Client):
            """A client whose thread reports an exception that ends it; else the client would still seem connected."""

            on_failure: Callable[[OSError], None]

            def loop_forever(self, *arguments: Any, **options: Any) -> Any:
                try:
                    return super().loop_forever(*arguments, **options)
                except Exception as error:  # for a broken packet the library raises a dozen types
                    if (sock := self.socket()) is not None:
                        sock.close()
                    self.on_failure(OSError(f"it sent what cannot be read ({error!r})"))

        # After a kill the name is the same, so that the broker ends the old session, with its last will, first.
        name = f"gestured-{self._host}"
        client = Guarded(CallbackAPIVersion.VERSION2, name, protocol=MQTTv5, reconnect_on_failure=False)
        client.connect_timeout = BROKER_S
        client.username_pw_set(self._user, self._password)
        client.will_set(will, "offline", qos=1, retain=True)
        if self._tls is not None:
            client.tls_set_context(self._tls)
        return client

    def call(self, client: Any) -> None:
        """Connect, and start the library's thread that serves the connection. Raises OSError."""
        most = properties("CONNECT", MaximumPacketSize=MOST_BYTES)
        client.connect(self.address.host, self.address.port, KEEPALIVE_S, clean_start=True, properties=most)
        client.loop_start()

    def why(self, error: Any, held_s: float | None) -> str:
        """The OSError or reason code that ended a connection, in words. Raises BridgeError if waiting does not help.

        `held_s` is how long the connection lasted once the broker had accepted it; None if it did not.
        """
        said, code = str(error), getattr(error, "value", 0)
        if "CERTIFICATE_VERIFY_FAILED" in said:
            wrong = said.partition("verify failed: ")[2].partition(" (_ssl")[0] or said
            raise BridgeError(
                f"the certificate of the broker {self.address} is not to be trusted: {wrong}: name its authority with "
                "--ca FILE, and the broker as its certificate does"
            )
        if code in REFUSALS:
            raise self.refusal(code)
        other = "is it one without TLS, or does it ask for a --cert that it knows?"
        hint = "is it one with TLS: --tls?" if self._tls is None else other
        if code == SILENT or "timed out" in said:
            return f"it does not answer as an MQTT broker does ({hint})" if held_s is None else "it no longer answers"
        if code != CLOSED and not isinstance(error, ConnectionResetError | ssl.SSLEOFError):
            return said
        if held_s is None:
            return f"it closed the connection before it let us in ({hint})"
        who = f" at once: does another bridge have the name gestured-{self._host}? (--host)"
        return f"it closed the connection{who if held_s < LONGEST_S else ''}"

    def check(self, terms: Any) -> int:
        """Check the properties of the broker's CONNACK; returns the size in bytes of the largest packet that it takes.

        Raises BridgeError if it takes no retained messages, or none with QoS 1. A broker that is sent what it does not
        take says why and closes the connection, but what it says is lost if packets of ours were on their way.
        """
        if not getattr(terms, "RetainAvailable", 1):
            raise self.refusal(NO_RETAIN)
        if not getattr(terms, "MaximumQoS", 1):
            raise self.refusal(NO_QOS_1)
        largest: int = getattr(terms, "MaximumPacketSize", ANY_BYTES)
        return largest

    def refusal(self, code: int) -> BridgeError:
        """The error to raise for a reason code of REFUSALS."""
        return BridgeError(f"the broker {self.address} refuses us: {REFUSALS[code].format(host=self._host)}")

    def hear(self, client: Any, topic: str) -> None:
        """Subscribe to commands at `topic`: no retained ones, and each with the flag whether it is to be retained."""
        from paho.mqtt.subscribeoptions import SubscribeOptions

        client.subscribe(topic, options=SubscribeOptions(qos=1, retainAsPublished=True, retainHandling=2))

    def refused(self, code: Any, topic: str) -> BridgeError:
        """What to say if the broker refuses a message at a topic with a reason code."""
        if code.value == NOT_ALLOWED:
            topics = f"gestured/{self._host}/# and {self._prefix}/+/gestured_{self._host}/#"
            return self._unallowed(f"publish ({code})", f"write {topics}")
        return BridgeError(f"the broker {self.address} refuses a message at {topic}: {code}")

    def unreadable(self, code: object, topic: str) -> BridgeError:
        """The error to raise if the broker does not let the bridge subscribe to commands."""
        return self._unallowed(f"hear commands ({code})", f"read {topic}")

    def _unallowed(self, what: str, right: str) -> BridgeError:
        said = f"the broker {self.address} does not let us {what}"
        return BridgeError(f"{said}: allow this user to {right} in its access list")


def _variable(name: str) -> str | None:
    """An environment variable (user or password); None if it is not set or empty. Raises BridgeError."""
    found = os.environ.get(name) or None
    try:
        (found or "").encode()
    except UnicodeEncodeError:  # the message has no value, which may be secret
        raise BridgeError(f"{name}: expected text in UTF-8") from None
    return found


def topic_of(host: str, *parts: str) -> str:
    """A topic of this machine, such as gestured/HOST/SENSOR/TYPE."""
    return "/".join(("gestured", host, *parts))


def properties(packet: str, **values: int) -> Any:
    """The MQTT 5 properties of a packet of that type, such as CONNECT."""
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties

    found = Properties(getattr(PacketTypes, packet))  # type: ignore[no-untyped-call]
    for name, value in values.items():
        setattr(found, name, value)
    return found


def tls_context(args: argparse.Namespace) -> ssl.SSLContext | None:
    """The TLS context; None for a plain connection. Raises BridgeError."""
    if not args.tls:
        if args.ca or args.cert:
            raise BridgeError("--ca and --cert are for encrypted connections: add --tls")
        return None
    for flag, path in (("--ca", args.ca), ("--cert", args.cert)):
        if path is not None and (path.is_dir() or not os.access(path, os.R_OK)):
            raise BridgeError(f"{flag} {path}: there is no such file that we may read")
    try:
        context = ssl.create_default_context(cafile=args.ca)
        if args.cert:
            context.load_cert_chain(args.cert)
    except ssl.SSLError as error:
        raise BridgeError(f"--ca or --cert: {error.reason or error}: expected certificates in PEM form") from None
    return context
