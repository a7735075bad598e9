"""Events and frames through a real router: Zenoh's own, from its wheel."""

import json
import queue
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from gestured.bridge import forward
from gestured.bridge import zenoh as zenoh_command
from gestured.bridge.counts import Counts
from gestured.bridge.zenoh_session import Zenoh
from gestured.client.program import Parser
from gestured.core.address import Address
from tests.bridge.conftest import Process, emit, page, wait
from tests.bridge.test_mqtt import STATUS, gesture
from tests.bridge.zenoh_site import Site, begin, opened
from tests.daemon.harness import DEADLINE_S, Daemon, Hand, Sensor, counted
from tests.sockets import HELLO, FakeDaemon, free_address

zenoh = pytest.importorskip("zenoh", reason="the bridge to Zenoh needs the extra [zenoh]")


def test_a_real_daemons_events_arrive_and_no_memory_is_shared(bridge, site, daemon: Daemon):
    """The unit's filter on system calls does not let a process make such memory, and events need none."""
    process = begin(bridge, site, daemon)
    assert process.ready()["site"] == "car"
    client = daemon.client()
    for name in ("swipe_left", "one_tap"):
        emit(daemon, name)
        line = client.events("gesture", "armrest")[-1]
        assert site.event() == ("gestured/car/armrest/gesture", line | {"instance": client.hello["instance"]})
    client.close()
    assert "/dev/shm/" not in Path(f"/proc/{process.process.pid}/maps").read_text()
    assert process.stop() == 0, process.said()


def test_tokens_live_as_daemon_and_sensors_do(bridge, site, fake):
    process = begin(bridge, site, fake)
    fake.accept()
    assert site.token() == ("gestured/car/alive", True)
    fake.say(STATUS)
    assert site.token() == ("gestured/car/armrest/alive", True)
    fake.say(STATUS | {"sensors": {"armrest": "stale"}})
    assert site.token() == ("gestured/car/armrest/alive", False)
    fake.say(STATUS | {"sensors": {"armrest": "inverted"}})  # its frames come, though they fall under pressure
    assert site.token() == ("gestured/car/armrest/alive", True)
    fake.say(STATUS | {"sensors": {"armrest": "intermittent"}})
    assert site.token() == ("gestured/car/armrest/alive", False)
    fake.close()  # as after a kill of the daemon
    assert site.token() == ("gestured/car/alive", False)
    fake.accept()
    assert site.token() == ("gestured/car/alive", True)
    process.process.kill()
    assert site.token() == ("gestured/car/alive", False)


def test_latecomers_ask(bridge, site, fake):
    process = begin(bridge, site, fake)
    fake.accept()
    process.ready()
    gates = {"armrest": {"armed": None, "closed": ["door"], "until": None}}
    fake.say(gesture(4), gesture(5, "double_tap"), {"type": "gestures", "gestures": ["one_tap", "wave"]})
    fake.say(STATUS | {"gates": gates})
    hello = "gestured/car/hello"
    wait(lambda: site.get(hello).get(hello, {}).get("states") == {"armrest": "ok"})
    found = site.get("gestured/*/**")
    assert found.keys() == {hello, "gestured/car/armrest/gesture"}
    assert found["gestured/car/armrest/gesture"]["sequence"] == 5
    assert found[hello]["gestures"] == ["one_tap", "wave"] and found[hello]["states"] == {"armrest": "ok"}
    assert found[hello]["instance"] == HELLO["instance"] and found[hello]["sensors"] == {"armrest": 5}
    assert found[hello]["gates"] == gates


def test_a_router_that_goes_and_comes_back(bridge, site, fake):
    process = begin(bridge, site, fake, "--metrics", "127.0.0.1:0")
    fake.accept()
    address = process.ready()["metrics"]
    site.router.close()
    wait(lambda: fake.say(STATUS) or "no router and no peer" in process.said(), process.said)
    fake.say(*(gesture(n) for n in range(1, 50)))
    wait(lambda: 'gestured_bridge_events_total{bridge="zenoh",result="unheard"} 49.0' in page(address))
    site.router = opened("router", listen=site.endpoint)

    def is_back() -> bool:
        fake.say(STATUS)
        return process.said().count("Zenoh is there") == 2

    wait(is_back, process.said)

    def heard() -> bool:
        fake.say(gesture(50))
        return not site.samples.empty()

    wait(heard)
    assert site.event()[1]["sequence"] == 50


def test_peers_need_no_router(bridge, fake, tmp_path):
    """By Zenoh's own file, which says how the bridge may be called."""
    endpoint, config = f"tcp/{free_address(socket.SOCK_STREAM)}", tmp_path / "zenoh.json5"
    config.write_text(f'{{mode: "peer", listen: {{endpoints: ["{endpoint}"]}}}}')
    bridge("zenoh", "--config", config, "--site", "car", "--socket", fake.path)
    fake.accept()

    def called() -> Any:
        try:
            return opened("client", connect=endpoint)
        except zenoh.ZError:
            return None

    peer = wait(called)
    samples: queue.Queue[Any] = queue.Queue()
    hears = peer.declare_subscriber("gestured/**", samples.put)
    assert wait(lambda: fake.say(gesture(1)) or not samples.empty())
    hears.undeclare()
    peer.close()


def test_frames_of_another_machine_give_the_events_of_udp(bridge, site, serve):
    """The same packets go by UDP and through Zenoh, with their counter and time."""
    daemon = serve("--clock", "sensor", "--stale-s", 30)
    begin(bridge, site, daemon, "--frames", "--to", str(daemon.address)).ready()
    distant = site.publisher("gestured/car/distant/frames")
    client = daemon.client().subscribe("gesture")
    hand = Hand()
    sensors = {name: Sensor(daemon, name, counted) for name in ("direct", "distant")}
    swipes = [part for name in ("left", "up", "down") for part in (*hand.swipe(name), *hand.idle(1.0))]
    for n, frame in enumerate([*hand.idle(2.0), *swipes]):
        packets = {name: sensor.packet(frame) for name, sensor in sensors.items()}
        if n == 33:  # this one is lost: its counter tells
            continue
        sensors["direct"].sock.send(packets["direct"])
        distant.put(packets["distant"])
    keys = ("gesture", "id", "sequence", "confidence", "scores", "frames", "lost")
    events: dict[str, list[Any]] = {"direct": [], "distant": []}
    while min(map(len, events.values())) < 3:
        event = client.line()
        events[event["sensor"]].append([event[key] for key in keys])
    assert events["direct"] == events["distant"]
    assert [event[0] for event in events["distant"]] == ["swipe_left", "swipe_up", "swipe_down"]
    assert any(event[-1] for event in events["distant"]), "the frame that is missing was noticed"


def frames_in(bridge: Callable[..., Process], site: Site, fake: FakeDaemon, udp: socket.socket) -> str:
    """A bridge for frames, and where its metrics are."""
    to = f"127.0.0.1:{udp.getsockname()[1]}"
    process = begin(bridge, site, fake, "--frames", "--to", to, "--metrics", "127.0.0.1:0")
    fake.accept()
    return str(process.ready()["metrics"])


def test_frames_are_of_the_sensor_that_their_key_says(bridge, site, fake, udp):
    """Whoever may publish may do so under keys with wildcards, too."""
    metrics = frames_in(bridge, site, fake, udp)
    distant = site.publisher("gestured/car/distant/frames")
    keys = ("**", "*/**", "gestured/car/*/frames", "gestured/car/**/frames")
    for key in keys:
        site.client.put(key, counted("/*/pressure", np.zeros((9, 9)), 1))
    wrong = (b"rubbish", counted("/other/pressure", np.zeros((9, 9)), 1))
    right = counted("/distant/pressure", np.zeros((9, 9)), 1)
    for packet in (*wrong, right):
        distant.put(packet)
    assert udp.recv(65536) == right
    refused = len(keys) + len(wrong)
    assert f'gestured_bridge_frames_total{{bridge="zenoh",result="refused"}} {refused}.0' in page(metrics)


def test_a_sensor_is_heard_beside_one_that_floods(bridge, site, fake, udp):
    """Zenoh drops what does not fit through the way to the bridge: the flood must not even be sent there."""
    metrics = frames_in(bridge, site, fake, udp)
    sound, mad = (site.publisher(f"gestured/car/{name}/frames") for name in ("sound", "mad"))
    sound.put(counted("/sound/pressure", np.zeros((9, 9)), 1))
    packet = counted("/mad/pressure", np.zeros((9, 9)), 1)

    def is_held_back() -> bool:
        for _ in range(1000):
            mad.put(packet)
        return not mad.matching_status.matching

    def arrives(frame: bytes, patience_s: float) -> bool:
        """Whether a frame of the sound one arrives, beside what is left of the flood."""
        sound.put(frame)
        while select.select([udp], [], [], patience_s)[0]:
            if udp.recv(65536) == frame:
                return True
        return False

    wait(is_held_back)
    wait(lambda: arrives(counted("/sound/pressure", np.zeros((9, 9)), 2), 0.1))  # once it is subscribed to anew
    for n in range(3, 30):
        mad.put(packet)
        assert arrives(counted("/sound/pressure", np.zeros((9, 9)), n), DEADLINE_S)
    assert 'result="flood"' in page(metrics)


def test_who_is_silent_gives_its_place_to_another(udp, monkeypatch):
    monkeypatch.setattr(forward, "MOST_SENDERS", 2)
    now = 0.0
    counts = Counts("zenoh")
    to = Address(*udp.getsockname())
    frames = forward.Forward("gestured/car", to, counts, clock=lambda: now)

    def became(name: str) -> str:
        """What became of a packet of a sensor."""
        before = counts.values.copy()
        payload = zenoh.ZBytes(counted(f"/{name}/pressure", np.zeros((9, 9)), 1))
        frames.take(SimpleNamespace(key_expr=f"gestured/car/{name}/frames", payload=payload))
        ((_, result),) = (counts.values - before).keys()
        return result

    assert [became(name) for name in ("a", "b", "c")] == ["sent", "sent", "overflow"]
    now = forward.SILENT_S - 1.0
    assert [became(name) for name in ("a", "c")] == ["sent", "overflow"]
    now += 2.0
    assert [became(name) for name in ("c", "a", "b")] == ["sent", "sent", "overflow"]
    now += forward.SILENT_S + 1.0
    frames._to = Address("255.255.255.255", 9)  # as a network that is down, our own kernel refuses it
    assert became("d") == "unheard"


def test_a_link_local_daemon_keeps_its_interface(monkeypatch):
    found = MagicMock()
    found.__enter__.return_value.getpeername = lambda: ("fe80::1", 9000, 0, 1)
    monkeypatch.setattr(forward, "connected", lambda _: found)
    to = Address(f"fe80::1%{socket.if_indextoname(1)}", 9000)
    assert forward.Forward("gestured/car", to, Counts("zenoh"))._to == to


def test_a_router_that_says_nothing_holds_up_no_end(bridge, fake, tmp_path):
    """Zenoh waits for its answer as long as its configuration says, and by nothing can that be ended."""
    timeouts = {"open_timeout": 3_600_000, "accept_timeout": 3_600_000}
    (tmp_path / "patient.json5").write_text(json.dumps({"transport": {"unicast": timeouts}}))
    with socket.create_server(("127.0.0.1", 0)) as router:
        router.settimeout(DEADLINE_S)
        to = ("--connect", f"tcp/127.0.0.1:{router.getsockname()[1]}", "--config", tmp_path / "patient.json5")
        process = bridge("zenoh", *to, "--site", "car", "--socket", fake.path)
        with router.accept()[0]:
            assert process.stop() == 0
            assert "Zenoh cannot be reached" not in process.said()


ROUTER = """
import sys, time, zenoh
config = zenoh.Config.from_json5(sys.argv[1])
with zenoh.open(config):
    print("there", flush=True)
    time.sleep(3600)
"""


def test_a_router_that_hangs_holds_up_no_end(bridge, fake):
    endpoint = f"tcp/{free_address(socket.SOCK_STREAM)}"
    config = {"mode": "router", "listen": {"endpoints": [endpoint]}, "scouting": {"multicast": {"enabled": False}}}
    command = [sys.executable, "-c", ROUTER, json.dumps(config)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as router:
        try:
            assert router.stdout is not None and router.stdout.readline()
            process = bridge("zenoh", "--connect", endpoint, "--site", "car", "--socket", fake.path)
            fake.accept()
            process.ready()
            router.send_signal(signal.SIGSTOP)
            fake.say(*(gesture(n) for n in range(1, 3000)))  # more than the way to the router holds
            assert process.stop() == 0, process.said()
        finally:
            router.kill()


def unconnected() -> Zenoh:
    """What a bridge has of Zenoh, to a router that is not there."""
    parser = Parser()
    zenoh_command.add(parser.add_subparsers())
    return Zenoh(parser.parse_args(["zenoh", "--site", "car", "--connect", "tcp/127.0.0.1:1"]), Counts("zenoh"))


def test_a_line_that_comes_while_the_session_is_opened_declares_no_token_twice():
    """The one that is thrown away would be undeclared, and tell others that the daemon is gone."""
    bridge, declared = unconnected(), list[str]()
    other = threading.Thread(target=bridge._keep_up)

    def declare(key: str) -> object:
        declared.append(key)
        if other.ident is None:
            other.start()
            other.join(0.2)  # it would be done by now
        return object()

    bridge._daemon.take(HELLO)
    liveliness = SimpleNamespace(declare_token=declare)
    info = SimpleNamespace(routers_zid=lambda: ["router"])
    bridge._session = SimpleNamespace(liveliness=lambda: liveliness, info=info)
    bridge._keep_up()
    other.join()
    assert declared == ["gestured/car/alive"]


def test_a_router_that_is_not_there_is_asked_for_ever_more_seldom(monkeypatch):
    """Said once, and tried again with growing pauses, two seconds at most: a router that comes is found soon."""
    session = unconnected()
    pauses: list[float] = []
    closed = SimpleNamespace(is_set=lambda: len(pauses) == 8, wait=pauses.append)
    monkeypatch.setattr(session, "_closed", closed)
    session._open()
    assert pauses == sorted(pauses) and len(set(pauses)) > 2
    assert pauses[0] < 0.5 and pauses[-2:] == [2.0, 2.0]


def test_after_a_panic_of_zenohs_it_is_tried_again(monkeypatch, capfd):
    """As for want of descriptors or threads: the bridge would live on, and never reach a router."""

    class Panic(BaseException):
        """What Rust's panics are in Python."""

    def opened(_: object) -> None:
        raise Panic("Failed to init net")

    session = unconnected()
    pauses: list[float] = []
    monkeypatch.setattr(zenoh, "open", opened)
    monkeypatch.setattr(session, "_closed", SimpleNamespace(is_set=lambda: bool(pauses), wait=pauses.append))
    session._open()
    assert pauses and "Failed to init net; trying again" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--connect", "rubbish"], "tcp/127.0.0.1:7447"),
        (["--site", "a/b"], "argument --site: 'a/b'"),
        (["--config", "/none.json5"], "/none.json5"),
        (["--frames", "--to", "nowhere.invalid:9000"], "cannot send to nowhere.invalid:9000"),
    ],
)
def test_bad_input_is_one_sentence(refused, tmp_path, flags, words):
    said = refused("zenoh", "--socket", tmp_path / "none.sock", *flags)
    assert words in said and "Traceback" not in said


def test_of_a_file_and_an_endpoint_the_wrong_one_is_named(refused, tmp_path):
    config = tmp_path / "zenoh.json5"
    config.write_text("{}")
    assert "gestured-bridge: --connect: " in refused("zenoh", "--config", config, "--connect", "rubbish")
    config.write_text('{mode: "x"}')
    said = refused("zenoh", "--config", config)
    assert f"--config {config}: " in said and "an endpoint is" not in said
