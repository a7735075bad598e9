"""An MQTT broker, reached and spoken to; and in words why it is not. Nothing else here imports the MQTT library."""

import argparse
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from gestured.bridge.login import credentials, tls_context
from gestured.bridge.options import BridgeError, peer_address
from gestured.core.address import Address

PLAIN_PORT, TLS_PORT = 1883, 8883  # registered with IANA
EXPIRY_S = 1  # how long a broker keeps an event for a subscriber: as OLD_S says, which MQTT counts in whole seconds
BROKER_S = 5.0  # s that the broker may take for any answer
LAST_S = 1.0  # for its answer to our good-bye; without it, it publishes our last will
KEEPALIVE_S = 5  # a broker that vanished without a word is noticed, and ours declared dead, after one and a half
MOST_BYTES = 65_536  # of a packet from the broker, which is told so; we subscribe to nothing, so that all are small
QUIET = logging.Logger("mqtt", logging.CRITICAL)  # how the connection is, the bridge says in its own words
UNNAMED = 128  # the reason code that the library gives where the broker named none
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


class Lost(Exception):
    """The broker cannot be reached, or went; the text says why. It may come back."""


def topic_of(host: str, *parts: str) -> str:
    """A topic of this machine's at any broker, such as gestured/HOST/SENSOR/TYPE."""
    return "/".join(("gestured", host, *parts))


class Broker:
    """Where a broker is, and who we are to it."""

    def __init__(self, args: argparse.Namespace, host: str) -> None:
        """`host` is this machine's name in topics. Raises BridgeError for what cannot be."""
        self.address = _address(args.broker, args.tls)
        self.host = host
        self._user, self._password = credentials(args.credentials)
        self._tls = tls_context(args)
        self._prefix = args.discovery

    @asynccontextmanager
    async def connected(self, will: str) -> AsyncIterator["Connection"]:
        """A connection while it lasts; where we vanish without a good-bye, the broker says `offline` at `will`.

        Raises Lost when it ends or cannot be, BridgeError where waiting does not help.
        """
        import aiomqtt

        client = self._client(will)
        connection = Connection(client, self)
        try:
            async with client:
                yield connection
        except (aiomqtt.MqttError, ExceptionGroup) as error:
            connection.check()
            raise Lost(self._why(_cause(error))) from None

    def refusal(self, reason_code: object) -> BridgeError:
        """What is to be said where the broker does not take what we publish."""
        return BridgeError(
            f"the broker {self.address} does not let us publish ({reason_code}): allow this user to write "
            f"gestured/{self.host}/# and {self._prefix}/+/gestured_{self.host}/# in its access list"
        )

    def _client(self, will: str) -> Any:
        import aiomqtt

        class Client(aiomqtt.Client):
            """A client that does not pass over a broker's refusal to take a message."""

            refused: object = None

            def _on_publish(self, *args: Any) -> None:
                reason_code = args[3]
                if reason_code.is_failure:
                    self.refused = reason_code
                super()._on_publish(*args)

        return Client(
            self.address.host,
            self.address.port,
            username=self._user,
            password=self._password,
            identifier=f"gestured-{self.host}",  # the same after a kill, so that an old last will comes before us
            protocol=aiomqtt.ProtocolVersion.V5,
            will=aiomqtt.Will(will, "offline", qos=1, retain=True),
            timeout=BROKER_S,
            keepalive=KEEPALIVE_S,
            clean_start=True,
            properties=_properties("CONNECT", MaximumPacketSize=MOST_BYTES),
            tls_context=self._tls,
            logger=QUIET,
        )

    def _why(self, error: BaseException) -> str:
        """The error that ended a connection, in words. Raises BridgeError where waiting does not help."""
        said = str(error)
        if "CERTIFICATE_VERIFY_FAILED" in said:
            wrong = said.partition("verify failed: ")[2].partition(" (_ssl")[0] or said
            raise BridgeError(
                f"the certificate of the broker {self.address} is not to be trusted: {wrong}: name its authority with "
                "--ca FILE, and the broker as its certificate does"
            )
        code = getattr(getattr(error, "rc", None), "value", 0)
        if code in REFUSALS:
            raise BridgeError(f"the broker {self.address} refuses us: {REFUSALS[code].format(host=self.host)}")
        if "timed out" in said:
            return "it does not answer as an MQTT broker does (is it one with TLS: --tls?)"
        if code == UNNAMED:
            return "it closed the connection"
        return said


class Connection:
    """A broker that is there. All is sent with QoS 1, so that it may come twice but is not lost on the way."""

    def __init__(self, client: Any, broker: Broker) -> None:
        self._client, self._broker = client, broker
        self._fresh = _properties("PUBLISH", MessageExpiryInterval=EXPIRY_S)

    async def event(self, topic: str, payload: bytes) -> None:
        """Publish something that is soon old, and wait until the broker has it. Errors as `retain`."""
        await self._client.publish(topic, payload, qos=1, properties=self._fresh)
        self.check()

    async def retain(self, topic: str, payload: str) -> None:
        """Have the broker keep something for all who come later; an empty text makes it forget.

        Raises the library's error where the connection ends, BridgeError where the broker does not want it.
        """
        await self._client.publish(topic, payload.encode(), qos=1, retain=True)
        self.check()

    async def leave(self, topic: str) -> None:
        """Say `offline`, our last word."""
        await self._client.publish(topic, "offline", qos=1, retain=True, timeout=LAST_S)

    async def lost(self) -> None:
        """Until the connection ends, which raises the library's error."""
        async for _ in self._client.messages:
            pass  # nothing was subscribed to

    def check(self) -> None:
        """Raise BridgeError where the broker has refused to take something."""
        if self._client.refused is not None:
            raise self._broker.refusal(self._client.refused)


def _properties(packet: str, **values: int) -> Any:
    """Properties of a kind of packet of MQTT 5."""
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties

    properties = Properties(getattr(PacketTypes, packet))  # type: ignore[no-untyped-call]
    for name, value in values.items():
        setattr(properties, name, value)
    return properties


def _cause(error: BaseException) -> BaseException:
    """What ended the connection; what is none of the library's errors is raised as it is."""
    import aiomqtt

    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    if not isinstance(error, aiomqtt.MqttError):
        raise error
    return error.__cause__ or error


def _address(text: str, tls: bool) -> Address:
    """HOST or HOST:PORT. Raises BridgeError."""
    try:
        return peer_address(text, TLS_PORT if tls else PLAIN_PORT)
    except argparse.ArgumentTypeError as error:
        raise BridgeError(f"--broker {error}") from None
