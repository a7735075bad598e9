"""`gestured-bridge zenoh`: gesture events to Zenoh, and with --frames a distant sensor's frames to the daemon.

gestured/{site}/{sensor}/{type}     an event in JSON as on the socket, with the daemon's `instance`
gestured/{site}/alive               liveliness token of the daemon
gestured/{site}/{sensor}/alive      liveliness token of a sensor that is heard
gestured/{site}/hello               asked (get): the daemon's hello; {sensor}/gesture asked: the sensor's last gesture
gestured/{site}/{sensor}/frames     in: OSC packets as over UDP, with counter and time; of this sensor alone
"""

import argparse
import json
import re
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gestured.bridge.counts import Counts
from gestured.bridge.daemon import GONE, MOST_SENSORS, NOTICE_S, OLD_S, Daemon, Line, follow
from gestured.bridge.options import (
    BridgeError,
    add_destination,
    add_filters,
    add_metrics,
    destination,
    host_name,
    need,
    on_stop,
    subscriber,
)
from gestured.client.sensor import sent_after_refusal
from gestured.core.address import Address
from gestured.core.errors import ProtocolError
from gestured.core.osc import decode

ROUTER = "tcp/127.0.0.1:7447"  # where a router of this machine listens unless told otherwise
AGAIN_S = 0.5  # from one attempt to reach the router to the next
MOST_SENDERS = 512  # sensors from Zenoh, each with a socket of its own: the daemon shares its work out by sources
HEARD = frozenset(("ok", "degraded", "starting", "faulty"))  # states of a sensor whose frames come
SITE = re.compile(r"[A-Za-z0-9_-]{1,64}")


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the bridge to the command line."""
    parser = commands.add_parser(
        "zenoh",
        help="events to Zenoh, and frames from there",
        description="Publish events under gestured/SITE/SENSOR/TYPE, with liveliness tokens for daemon and sensors.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="examples:\n  gestured-bridge zenoh --connect tcp/192.168.7.2:7447 --site car7\n"
        "  gestured-bridge zenoh --frames --to 127.0.0.1:9000",
    )
    text = f"a router or peer to call; may be repeated (default: {ROUTER}, unless --listen or --scout is given)"
    parser.add_argument("--connect", action="append", metavar="ENDPOINT", help=text)
    text = "where peers may call us, such as tcp/0.0.0.0:7448; may be repeated"
    parser.add_argument("--listen", action="append", metavar="ENDPOINT", help=text)
    parser.add_argument("--scout", action="store_true", help="look for routers and peers on the network by multicast")
    text = "Zenoh's own configuration (JSON5): certificates, users; the flags come on top of it"
    parser.add_argument("--config", type=Path, metavar="FILE", help=text)
    parser.add_argument("--site", metavar="NAME", help="name of this place in keys (default: the hostname)")
    add_filters(parser)
    parser.add_argument("--frames", action="store_true", help="also take frames from Zenoh to the daemon")
    add_destination(parser)
    add_metrics(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Mirror events until SIGTERM or Ctrl-C."""
    need("zenoh", "eclipse-zenoh", "zenoh")
    import zenoh

    zenoh.init_log_from_env_or("off")  # what is wrong is said here, in one line
    counts = Counts("zenoh")
    bridge = Zenoh(args, counts)
    source = subscriber(args, NOTICE_S)
    on_stop(source.close)
    try:
        bridge.begin(counts.serve(args.metrics))
        for line in follow(source):
            bridge.take(line)
    finally:
        source.close()
        bridge.close()
    return 0


def configuration(args: argparse.Namespace) -> Any:
    """Zenoh's, of the flags. Raises BridgeError."""
    import zenoh

    connect, listen = args.connect or [], args.listen or []
    if not connect and not listen and not args.scout and args.config is None:
        connect = [ROUTER]
    try:
        config = zenoh.Config() if args.config is None else zenoh.Config.from_file(str(args.config))
        settings: dict[str, object] = {"scouting/multicast/enabled": args.scout, "scouting/gossip/enabled": args.scout}
        if args.config is None:
            settings["mode"] = "peer" if listen or args.scout else "client"
        if connect or args.config is None:
            settings["connect/endpoints"] = connect
        if listen or args.config is None:
            settings["listen/endpoints"] = listen
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
    except zenoh.ZError as error:
        where = f"--config {args.config}" if args.config else "--connect or --listen"
        raise BridgeError(f"{where}: {first_words(error)}: an endpoint is such as {ROUTER}") from None
    return config


def first_words(error: BaseException) -> str:
    """What Zenoh says, without the place in its sources."""
    return re.sub(r" at /\S+\.rs:\d+\.?", "", str(error).partition("\n")[0])[:300].strip(" .!")


class Zenoh:
    """One daemon's events, and what is known of it, on Zenoh."""

    def __init__(self, args: argparse.Namespace, counts: Counts) -> None:
        """Raises BridgeError for what cannot be."""
        self._site = args.site or host_name(None)
        if not SITE.fullmatch(self._site):
            raise BridgeError(f"--site {self._site}: expected letters, digits, _ and -, at most 64")
        self._config = configuration(args)
        self._is_called = bool(args.listen or args.scout)  # nobody has to be there
        self._daemon = Daemon(args.sensors, args.gestures)
        self._counts = counts
        self._forward = Forward(args.to, counts) if args.frames else None
        self._session: Any = None
        self._tokens: dict[str, Any] = {}
        self._latest: dict[str, bytes] = {}  # sensor -> its last gesture
        self._closed = threading.Event()
        self._opening = threading.Thread(target=self._open, name="zenoh", daemon=True)
        self._metrics: str | None = None

    def begin(self, metrics: str | None) -> None:
        """Reach the router, in a thread of its own; `metrics` is where they are served."""
        self._metrics = metrics
        self._opening.start()

    def take(self, line: Line) -> None:
        """One line of `follow`."""
        kind = line.get("type")
        self._daemon.take(line)
        if kind in ("hello", GONE):
            self._counts.daemon(kind == "hello")
        if "sensor" in line:  # an event: the daemon knows what was asked for, and which answers belong to it
            self._publish(line)
        self._hold_tokens()

    def close(self) -> None:
        """Say good-bye."""
        self._closed.set()
        if self._opening.is_alive():
            self._opening.join()
        if self._session is not None:
            self._session.close()

    def _open(self) -> None:
        """Until it is open: a router that is not there yet is waited for. After that Zenoh connects again by itself."""
        import zenoh
        from zenoh.handlers import Callback

        while not self._closed.is_set():
            try:
                session = zenoh.open(self._config)
            except zenoh.ZError as error:
                words = f"Zenoh cannot be reached: {first_words(error)}; trying again"
                self._counts.connected("zenoh", False, words)
                self._closed.wait(AGAIN_S)
                continue
            # Called by Zenoh's own threads: one of Python's that waits for Zenoh would abort the process at its end.
            answer = Callback(self._answer, indirect=False)
            self._answers = session.declare_queryable(self._key("**"), answer)
            if self._forward is not None:
                take = Callback(self._forward.take, indirect=False)
                self._frames = session.declare_subscriber(self._key("*", "frames"), take)
            self._session = session
            self._hold_tokens()
            return

    def _publish(self, event: Line) -> None:
        import zenoh

        data = self._daemon.payload(event)
        if event["type"] == "gesture":
            if event["sensor"] not in self._latest and len(self._latest) >= MOST_SENSORS:
                self._latest.clear()
            self._latest[event["sensor"]] = data
        if self._daemon.age(event, time.time()) > OLD_S:
            self._counts.add("events", "old")
        elif not self._reached():
            self._counts.add("events", "unheard")
        else:
            key = self._key(event["sensor"], event["type"])
            self._session.put(key, data, encoding=zenoh.Encoding.APPLICATION_JSON)
            self._counts.add("events", "sent")

    def _reached(self) -> bool:
        """Whether a router or a peer is there now; said where that changes."""
        if self._session is None:
            return False
        info = self._session.info
        there = self._is_called or bool(list(info.routers_zid()) or list(info.peers_zid()))
        self._counts.connected("zenoh", there, "Zenoh is there" if there else "no router and no peer; trying again")
        return there

    def _hold_tokens(self) -> None:
        """A token for the daemon and for each sensor that is heard now."""
        if self._session is None:
            return
        alive = set()
        if self._daemon.hello:
            heard = (name for name, state in self._daemon.states.items() if state in HEARD)
            alive = {self._key("alive"), *(self._key(name, "alive") for name in heard)}
        for key in self._tokens.keys() - alive:
            self._tokens.pop(key).undeclare()
        for key in alive - self._tokens.keys():
            self._tokens[key] = self._session.liveliness().declare_token(key)
        if self._reached() and self._daemon.hello:
            self._counts.ready(site=self._site, metrics=self._metrics)

    def _answer(self, query: Any) -> None:
        """What a latecomer asks for; called by Zenoh in a thread of its own."""
        hello = dict(self._daemon.hello)
        if hello:
            known = {"gestures": self._daemon.gestures, "states": self._daemon.states}
            self._reply(query, self._key("hello"), json.dumps(hello | known).encode())
        for sensor, data in list(self._latest.items()):
            self._reply(query, self._key(sensor, "gesture"), data)

    def _reply(self, query: Any, key: str, data: bytes) -> None:
        import zenoh

        if query.key_expr.intersects(zenoh.KeyExpr(key)):
            query.reply(key, data, encoding=zenoh.Encoding.APPLICATION_JSON)

    def _key(self, *parts: str) -> str:
        return "/".join(("gestured", self._site, *parts))


class Forward:
    """Frames from Zenoh to the daemon, byte by byte as they came: their counter and time stay."""

    def __init__(self, to: Address, counts: Counts) -> None:
        """Raises BridgeError where `to` is no address."""
        self._family, self._address = destination(to)
        self._counts = counts
        self._senders: dict[str, Callable[[bytes], bool]] = {}

    def take(self, sample: Any) -> None:
        """One packet; what is none, or of another sensor than its key says, is dropped and counted."""
        sensor, packet = str(sample.key_expr).split("/")[-2], sample.payload.to_bytes()
        try:
            fits = all(message.address.startswith(f"/{sensor}/") for message in decode(packet))
        except ProtocolError:
            fits = False
        if not fits:
            self._counts.add("frames", "refused")
            return
        if sensor not in self._senders and len(self._senders) >= MOST_SENDERS:
            self._counts.add("frames", "overflow")
            return
        try:
            refused = self._sender(sensor)(packet)
        except OSError:  # the network is down, or a packet is too long for it
            refused = True
        self._counts.add("frames", "unheard" if refused else "sent")

    def _sender(self, sensor: str) -> Callable[[bytes], bool]:
        if sensor not in self._senders:
            sender = socket.socket(self._family, socket.SOCK_DGRAM)
            sender.connect(self._address)
            self._senders[sensor] = lambda packet: sent_after_refusal(sender, packet)
        return self._senders[sensor]
