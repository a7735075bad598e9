"""A session of the Zenoh bridge: it publishes one daemon's events and liveliness, and answers queries about them."""

import argparse
import json
import re
import threading
import time
from contextlib import suppress
from functools import partial
from typing import Any

from gestured.bridge.counts import Counts
from gestured.bridge.daemon import MOST_SENSORS, OLD_S, Daemon, Line
from gestured.bridge.forward import Forward
from gestured.bridge.options import FIRST_S, LONGEST_S, BridgeError, host_name

ROUTER = "tcp/127.0.0.1:7447"  # the default address of a router on this machine
CLIENT = '"client"'  # the mode of a session that connects to a router; in other modes, others may connect to it
# Settings unless --config has them: no search for peers on the network.
UNLESS_SAID = {"mode": "client", "scouting/multicast/enabled": False, "scouting/gossip/enabled": False}
ALWAYS = {"transport/shared_memory/enabled": False}  # else Zenoh opens no session under the systemd unit
HEARD = frozenset(("ok", "degraded", "starting", "faulty", "inverted"))  # the states of sensors whose frames come


class Zenoh:
    """One daemon's events and liveliness on Zenoh."""

    def __init__(self, args: argparse.Namespace, counts: Counts) -> None:
        """Raises BridgeError for arguments that cannot be used."""
        import zenoh

        zenoh.init_log_from_env_or("off")  # the bridge logs errors itself, in one line
        self._site = args.site or host_name(None)
        self._config = _configuration(args)
        self._is_called = self._config.get_json("mode") != CLIENT  # then nobody has to be there
        self._daemon = Daemon(args.sensors, args.gestures, counts)
        self._counts = counts
        self._forward = Forward(self._key(), args.to, counts) if args.frames else None
        self._session: Any = None
        self._tokens: dict[str, Any] = {}
        self._holding = threading.Lock()  # guards the tokens, which the thread that opens the session announces first
        self._latest: dict[str, bytes] = {}  # by sensor: its last gesture, as published
        self._closed = threading.Event()
        self._opening = threading.Thread(target=self._open, name="zenoh", daemon=True)

    def begin(self) -> None:
        """Begin to open the session, in a thread of its own."""
        self._opening.start()

    def take(self, line: Line) -> None:
        """Take one line of `follow`."""
        self._daemon.take(line)
        if "sensor" in line:  # an event, which the daemon has filtered already
            self._publish(line)
        self._keep_up()

    def close(self, patience_s: float | None = None) -> bool:
        """Close the session, so that the network knows that it has ended.

        Returns False if Zenoh still waits for a silent router after `patience_s` seconds (None: wait until it is done).
        """
        self._closed.set()
        if self._forward is not None:
            self._forward.close()
        leaving = threading.Thread(target=self._leave, name="leaving", daemon=True)
        leaving.start()
        leaving.join(patience_s)
        return not leaving.is_alive()

    def _leave(self) -> None:
        import zenoh

        if self._opening.is_alive():
            self._opening.join()
        if self._session is not None:
            with suppress(zenoh.ZError):  # the router hangs
                self._session.close()

    def _open(self) -> None:
        """Open the session as soon as a router is there; after that Zenoh connects again by itself."""
        import zenoh
        from zenoh.handlers import Callback

        pause = FIRST_S
        while not self._closed.is_set():
            try:
                session = zenoh.open(self._config)
            except BaseException as error:  # noqa: BLE001 - a panic, such as for want of descriptors, is no `Exception`
                words = f"Zenoh cannot be reached: {_first_words(error)}; trying again"
                self._counts.connected("zenoh", False, words)
                self._closed.wait(pause)
                pause = min(2 * pause, LONGEST_S)
                continue
            self._serve(session)
            self._session = session
            self._keep_up()
            if self._forward is not None:
                take = Callback(self._forward.take, indirect=False)
                self._forward.hear(partial(session.declare_subscriber, handler=take))
            return

    def _serve(self, session: Any) -> None:
        """Begin to answer queries."""
        from zenoh.handlers import Callback

        # Zenoh's own threads call `_answer`: a Python thread that waits for Zenoh would abort the process at its exit.
        self._answers = session.declare_queryable(self._key("**"), Callback(self._answer, indirect=False))

    def _publish(self, event: Line) -> None:
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
            self._put(event, data)
            self._counts.add("events", "sent")

    def _put(self, event: Line, data: bytes) -> None:
        import zenoh

        key = self._key(event["sensor"], event["type"])
        self._session.put(key, data, encoding=zenoh.Encoding.APPLICATION_JSON)

    def _reached(self) -> bool:
        """Whether a router or a peer is there now; a change is logged."""
        if self._session is None:
            return False
        info = self._session.info
        there = self._is_called or bool(list(info.routers_zid()) or list(info.peers_zid()))
        self._counts.connected("zenoh", there, "Zenoh is there" if there else "no router and no peer; trying again")
        return there

    def _keep_up(self) -> None:
        """Announce what is there now, and print once that the bridge works."""
        if self._session is None:
            return
        with self._holding:
            self._announce()
        if self._reached() and self._daemon.hello:
            self._counts.ready(site=self._site)

    def _announce(self) -> None:
        """Hold a liveliness token for the daemon and for each sensor in a state of HEARD, and for nothing else."""
        alive = set()
        if self._daemon.hello:
            heard = (name for name, state in self._daemon.states.items() if state in HEARD)
            alive = {self._key("alive"), *(self._key(name, "alive") for name in heard)}
        for key in self._tokens.keys() - alive:
            self._tokens.pop(key).undeclare()
        for key in alive - self._tokens.keys():
            self._tokens[key] = self._session.liveliness().declare_token(key)

    def _answer(self, query: Any) -> None:
        """Answer a query with the hello and last gestures that it matches; Zenoh calls this in a thread of its own."""
        hello = dict(self._daemon.hello)
        if hello:
            known = {"gestures": self._daemon.gestures, "states": self._daemon.states, "gates": self._daemon.listening}
            self._reply(query, self._key("hello"), json.dumps(hello | known).encode())
        for sensor, data in list(self._latest.items()):
            self._reply(query, self._key(sensor, "gesture"), data)

    def _reply(self, query: Any, key: str, data: bytes) -> None:
        import zenoh

        if query.key_expr.intersects(zenoh.KeyExpr(key)):
            query.reply(key, data, encoding=zenoh.Encoding.APPLICATION_JSON)

    def _key(self, *parts: str) -> str:
        return "/".join(("gestured", self._site, *parts))


def _configuration(args: argparse.Namespace) -> Any:
    """Zenoh's configuration, from the flags. Raises BridgeError."""
    import zenoh

    where, expected = f"--config {args.config}", "expected Zenoh's configuration (JSON5)"
    try:
        config = zenoh.Config() if args.config is None else zenoh.Config.from_file(str(args.config))
        settings = {key: value for key, value in UNLESS_SAID.items() if config.get_json(key) == "null"}
        for key, value in (settings | ALWAYS).items():
            config.insert_json5(key, json.dumps(value))
        calls_nobody = config.get_json("mode") == CLIENT and config.get_json("connect/endpoints") == "[]"
        if args.connect or calls_nobody:
            where, expected = "--connect", f"an endpoint is such as {ROUTER}"
            config.insert_json5("connect/endpoints", json.dumps(args.connect or [ROUTER]))
    except zenoh.ZError as error:
        raise BridgeError(f"{where}: {_first_words(error)}: {expected}") from None
    return config


def _first_words(error: BaseException) -> str:
    """The first line of Zenoh's error, without the place in its sources."""
    return re.sub(r" at /\S+\.rs:\d+\.?", "", str(error).partition("\n")[0])[:300].strip(" .!")
