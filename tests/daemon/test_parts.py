"""Parts of the daemon by themselves, where a whole one cannot be brought into the state."""

import asyncio
import errno
import ipaddress
import json
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gestured.control.findings import examine_status
from gestured.core.address import Address
from gestured.core.errors import SettingsError
from gestured.core.events import Gate
from gestured.core.hub import REMEMBERED
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.core.wire import Decoder
from gestured.daemon import http, log
from gestured.daemon.http import HttpThread, as_json
from gestured.daemon.merge import load_settings
from gestured.daemon.service import Service
from gestured.daemon.sockets import AGAIN_S, AddressError, bind_udp, name_of
from gestured.daemon.status import healthy, overall, status
from gestured.daemon.tap import Taps, as_lines
from gestured.daemon.udp import Receiver
from tests.daemon import harness
from tests.daemon.harness import DEADLINE_S, Hand
from tests.daemon.parts import SOURCE, Parts, with_service


def test_flags_win_over_the_environment_that_over_the_file_that_over_defaults(tmp_path: Path) -> None:
    path = tmp_path / "gestured.toml"
    path.write_text('model = "file"\nstale_s = 3\nmax_sensors = 7\npublish = ["osc://a:1"]\n')
    env = {"GESTURED_MODEL": "env", "GESTURED_STALE_S": "4", "GESTURED_CONFIG": str(path), "OTHER": "x"}
    settings, sources = load_settings({"model": "flag"}, env)
    assert (settings.model, settings.stale_s, settings.max_sensors, settings.clock) == ("flag", 4.0, 7, "arrival")
    assert sources == {
        "model": "command line",
        "stale_s": "environment",
        "max_sensors": str(path),
        "publish": str(path),
    }
    assert load_settings({"config": str(path)}, {})[0].model == "file"


def test_lists_are_written_with_commas_or_repeated() -> None:
    env = {"GESTURED_PUBLISH": "osc://127.0.0.1:1, osc://[::1]:2", "GESTURED_ALLOW": "10.0.0.0/8,::1"}
    settings, _ = load_settings({"gestures": "one_tap,swipe_left"}, env)
    assert [str(a) for a in settings.publish] == ["osc://127.0.0.1:1", "osc://[::1]:2"]
    assert settings.allow == (ipaddress.ip_network("10.0.0.0/8"), ipaddress.ip_network("::1/128"))
    assert settings.gestures == ("one_tap", "swipe_left")


def test_allow_takes_ipv4_senders_as_a_socket_at_both_families_tells_them() -> None:
    settings, _ = load_settings({}, {"GESTURED_ALLOW": "::ffff:192.168.7.9, ::ffff:10.9.0.0/120"})
    assert settings.allow == (ipaddress.ip_network("192.168.7.9"), ipaddress.ip_network("10.9.0.0/24"))
    with pytest.raises(SettingsError, match="expected an address or a network"):
        load_settings({}, {"GESTURED_ALLOW": "fe80::1%eth0"})  # no packet says its interface


def test_the_allow_list_knows_mapped_and_scoped_addresses() -> None:
    lan = (ipaddress.ip_network("192.168.7.0/24"), ipaddress.ip_network("fe80::/10"))
    scene = Scene(("one_tap",), (9, 9), allow=lan)
    assert all(map(scene.may_send, ("192.168.7.9", "::ffff:192.168.7.9", "fe80::1%lo")))
    assert not scene.may_send("192.168.8.9") and not scene.may_send("::1")
    assert Scene(("one_tap",), (9, 9)).may_send("8.8.8.8")


@pytest.fixture
def parts(model: Path) -> Parts:
    return Parts(model)


def test_a_link_local_address_is_told_with_its_interface() -> None:
    bound: Any = SimpleNamespace(family=socket.AF_INET6, getsockname=lambda: ("fe80::1", 9000, 0, 1))
    address = name_of(bound)
    assert address == f"[fe80::1%{socket.if_indextoname(1)}]:9000"
    assert str(Address.parse(address)) == address
    unplugged: Any = SimpleNamespace(family=socket.AF_INET6, getsockname=lambda: ("fe80::1", 9000, 0, 2**31 - 1))
    assert name_of(unplugged) == "[fe80::1%2147483647]:9000"  # the status still comes


def test_a_bug_in_the_path_of_one_sensor_ends_its_contact_and_nothing_else(parts: Parts, monkeypatch, capfd) -> None:
    log.configure("warning")
    hand, events = Hand(), parts.events
    t = max(parts.feed(name, hand.idle(2.0), 0.0) for name in ("good", "bad"))
    parts.feed("bad", hand.tap(), t)
    push = Sensor.push

    def broken(self, frame):
        if self.name == "bad":
            raise ZeroDivisionError("a bug")
        return push(self, frame)

    with monkeypatch.context() as patch:
        patch.setattr(Sensor, "push", broken)
        parts.feed("bad", hand.tap(), t + 0.2)
        parts.feed("good", hand.swipe("left") + hand.idle(1.0), t)
    kinds = [(type(e).__name__, e.sensor) for e in events]
    assert kinds[:3] == [("Onset", "bad"), ("Cancelled", "bad"), ("Release", "bad")]
    assert [kind for kind, sensor in kinds if sensor == "good"] == ["Onset", "Gesture", "Release"]
    assert parts.metrics.internal_errors.total() == 2
    log.close()
    assert capfd.readouterr().err.count("ZeroDivisionError: a bug") == 1  # logged at a bounded rate
    parts.feed("bad", hand.idle(2.0) + hand.swipe("left") + hand.idle(1.0), t + 1)
    assert [type(e).__name__ for e in events[-3:]] == ["Onset", "Gesture", "Release"] and events[-1].sensor == "bad"


def test_the_flight_recorder_knows_what_the_latest_sensors_listen_to_and_no_more_of_them_than_the_hub() -> None:
    """Whoever may send can invent names for years."""
    taps = Taps(1000)
    for n in range(REMEMBERED + 100):
        taps.publish(Gate(f"s{n}", False, (), None, 0.0), 0.0)
    told = [gate.sensor for gate in taps.flight()]
    assert len(told) <= REMEMBERED + 10 and told[-1] == f"s{REMEMBERED + 99}"


def test_what_the_flight_recorder_holds_has_one_clock_though_the_wall_clock_was_set(monkeypatch) -> None:
    taps, now, wall = Taps(10_000), time.monotonic(), time.time_ns
    taps.publish(Gate("arm", True, (), now + 5.0, now), time.time() - now)
    taps.packets([(b"frame", ("127.0.0.1", 5))], now)
    monkeypatch.setattr(time, "time_ns", lambda: wall() + 3600 * 10**9)
    gate, packet = map(json.loads, as_lines(taps.flight(), epoch_ns := taps.epoch_ns))
    assert gate["since"] == pytest.approx((packet["t_ns"] + epoch_ns) / 1e9, abs=1e-6)
    monkeypatch.setattr(time, "time_ns", lambda: 0)  # set back to 1970: a tape holds no earlier time
    assert packet["t_ns"] + taps.epoch_ns >= 0


def test_a_bug_in_the_decoder_costs_one_packet(parts: Parts, monkeypatch) -> None:
    decode = Decoder.decode
    monkeypatch.setattr(Decoder, "decode", lambda self, data, source: decode(self, data, source) if data else 1 / 0)
    good = harness.floats("/a/pressure", Hand().frame(), 0)
    parts.desk.take(parts.hub.receive([(packet, SOURCE) for packet in (good, b"", b"rubbish!", b"", good)], 1.0))
    metrics = parts.metrics
    assert metrics.internal_errors.total() == 2 and metrics.dropped.values == {("not_osc",): 1}
    assert metrics.frames.values == {("a", "ok"): 2}


async def test_what_waits_since_the_socket_was_bound_keeps_its_times(
    parts: Parts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A start takes a while; a sensor is learned from the frames that came meanwhile, too."""
    served: list[float] = []
    receive = parts.hub.receive
    monkeypatch.setattr(parts.hub, "receive", lambda packets, now: served.append(now) or receive(packets, now))

    with bind_udp(Address("127.0.0.1", 0)) as sock, socket.socket(type=socket.SOCK_DGRAM) as sender:
        empty = time.monotonic()
        sender.connect(sock.getsockname())
        moments = []
        for k in range(2):
            time.sleep(0.1)  # the sensor's pace
            moments.append(time.monotonic())
            sender.send(harness.floats("/a/pressure", Hand().frame(), k))
            moments.append(time.monotonic())
        receiver = Receiver(sock, empty, parts.hub, parts.desk, parts.taps)
        while parts.metrics.frames.values != {("a", "ok"): 2}:
            receiver.read()
        receiver.close()
    apart = moments[2] - moments[1]
    assert len(served) == 2 and served[1] - served[0] >= apart - 1e-4  # s, by which the two clocks may drift


def test_health_and_readiness_say_what_is_wrong(model: Path, tmp_path: Path) -> None:
    async def look(service: Service) -> None:
        parts = service.parts
        assert healthy(parts)["healthy"] and status(parts)["ready"]["reason"] is None
        parts.stopping = parts.desk.models_failed = True
        parts.pulse.beat -= 10.0
        assert not healthy(parts)["healthy"] and healthy(parts)["loop_age_s"] >= 10
        told = "the event loop hangs; the daemon is stopping; no model could classify the last segment"
        assert status(parts)["ready"]["reason"] == told and status(parts)["loop_lag_s"] >= 9

    with_service(model, tmp_path, look)


def test_an_overload_is_told_by_how_late_packets_are_read(model: Path, tmp_path: Path) -> None:
    """Its loop turns in time meanwhile, and for some seconds nothing is dropped."""

    async def look(service: Service) -> None:
        service.parts.receiver.behind_s = 3.0
        found = status(service.parts)
        assert found["loop_lag_s"] == 3.0 and healthy(service.parts)["healthy"]
        assert any("the daemon runs 3000 ms late" in finding.what for finding in examine_status(found))

    with_service(model, tmp_path, look)


@pytest.mark.parametrize(
    ("sensors", "impaired", "state"),
    [({}, True, "no_data"), ({"a": "stale"}, False, "no_data"), ({"a": "stale", "b": "ok"}, False, "ok"),
     ({"a": "ok"}, True, "degraded")],
)  # fmt: skip
def test_the_daemons_state_is_made_of_its_sensors(sensors: dict[str, str], impaired: bool, state: str) -> None:
    assert overall(sensors, impaired=impaired) == state


def test_who_takes_the_processor_while_the_clocks_are_read_does_not_change_an_events_times(model, monkeypatch) -> None:
    parts, epochs, late_s = Parts(model), list[float](), iter([0.0, 0.4, 0.4, 0.4])
    parts.desk.sinks = (SimpleNamespace(publish=lambda event, epoch, test: epochs.append(epoch)),)
    clocks = SimpleNamespace(time=lambda: 1000.0, monotonic=lambda: 10.0 + next(late_s, 0.4))
    monkeypatch.setattr("gestured.daemon.desk.time", clocks)
    parts.desk.publish(Gate("arm", None, (), None, 0.0))
    late_s = iter([0.4, 0.4, 0.0])
    parts.desk.publish(Gate("arm", None, (), None, 0.0))
    assert epochs == [990.0, 990.0]


@pytest.fixture
def web() -> "Iterator[tuple[tuple[str, int], HttpThread]]":
    sock = socket.create_server(("127.0.0.1", 0))
    sock.setblocking(False)

    def broken():
        raise RuntimeError("a bug")

    thread = HttpThread(sock, {"/ok": lambda: as_json(200, {"fine": True}), "/broken": broken})
    yield sock.getsockname(), thread
    thread.close()


def ask(address: tuple[str, int], request: bytes) -> bytes:
    with socket.create_connection(address, DEADLINE_S) as sock:
        sock.sendall(request)
        answer = b""
        while part := sock.recv(4096):
            answer += part
    return answer


def test_http_answers_whatever_it_is_asked(web) -> None:
    address, _ = web
    answer = ask(address, b"GET /ok?x=1 HTTP/1.1\r\nHost: a\r\n\r\n")
    head, body = answer.split(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200 OK") and json.loads(body) == {"fine": True}
    assert ask(address, b"HEAD /ok HTTP/1.0\r\n\r\n").endswith(b"\r\n\r\n")
    for request, code in (
        (b"GET /no HTTP/1.1\r\n\r\n", b"404"), (b"POST /ok HTTP/1.1\r\n\r\n", b"405"),
        (b"rubbish\r\n\r\n", b"400"), (b"GET /broken HTTP/1.1\r\n\r\n", b"500"),
    ):  # fmt: skip
        assert ask(address, request).split()[1] == code
    assert ask(address, b"x" * 20_000) == ask(address, b"GET /ok HTTP/1.1\r\n" + b"a: b\r\n" * 2_000) == b""


@pytest.mark.parametrize(
    "request_",
    [b"GET /ok HTTP/1.0\n\n", b"\r\nGET /ok HTTP/1.1\nHost: a\r\n\n", b"GET HTTP://a:1/ok?x HTTP/1.1\r\n\r\n"],
)
def test_http_takes_bare_line_feeds_an_empty_line_before_and_a_whole_address(web, request_: bytes) -> None:
    assert ask(web[0], request_).startswith(b"HTTP/1.1 200 OK")


def slow(address: tuple[str, int], count: int) -> list[socket.socket]:
    """Connections that have begun a request and go no further."""
    socks = [socket.create_connection(address, DEADLINE_S) for _ in range(count)]
    for sock in socks:
        with suppress(OSError):  # it had to make place already
            sock.sendall(b"GET /ok HT")
    return socks


def test_slow_http_clients_hold_nobody_up(web) -> None:
    address, _ = web
    socks = slow(address, 3 * http.HTTP_CONNECTIONS)
    for _ in range(3):
        assert ask(address, b"GET /ok HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 200")
        socks += slow(address, http.HTTP_CONNECTIONS)
    for sock in socks[: http.HTTP_CONNECTIONS]:  # those that came first made place
        with suppress(ConnectionResetError):
            assert sock.recv(1) == b""
    for sock in socks:
        sock.close()


def test_a_request_has_so_much_time_in_all_however_it_trickles(web, monkeypatch) -> None:
    monkeypatch.setattr(http, "DEADLINE_S", 0.05)
    (sock,) = slow(web[0], 1)
    with sock, pytest.raises(OSError):
        while True:
            sock.sendall(b"x")


class Exhausted(socket.socket):
    """A listener of a process that has no descriptor left, as long as it is `full`."""

    full = True

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as sock:
            super().__init__(fileno=sock.detach())
        self.setblocking(False)
        self.refused = 0  # times

    def accept(self):
        if self.full:
            self.refused += 1
            raise OSError(errno.EMFILE, "Too many open files")
        return super().accept()


def test_where_no_descriptor_is_left_http_tries_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []
    sock = Exhausted()

    async def sleep(seconds: float) -> None:
        pauses.append(seconds)
        sock.full = len(pauses) < 3

    monkeypatch.setattr(asyncio, "sleep", sleep)
    thread = HttpThread(sock, {"/ok": lambda: as_json(200, {"fine": True})})
    assert ask(sock.getsockname(), b"GET /ok HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 200")
    assert pauses[:3] == [AGAIN_S] * 3 == [AGAIN_S] * sock.refused
    thread.close()


def test_who_asks_without_end_leaves_the_interpreter_to_the_daemon_most_of_the_time(monkeypatch) -> None:
    pauses: list[float] = []
    worked: list[float] = []

    async def sleep(seconds: float) -> None:
        pauses.append(seconds)

    def page() -> http.Response:
        began = time.thread_time()
        while time.thread_time() < began + 0.005:
            pass
        worked.append(time.thread_time() - began)
        return as_json(200, {})

    monkeypatch.setattr(asyncio, "sleep", sleep)
    with socket.create_server(("127.0.0.1", 0)) as sock:
        sock.setblocking(False)
        thread = HttpThread(sock, {"/page": page})
        for _ in range(5):
            ask(sock.getsockname(), b"GET /page HTTP/1.1\r\n\r\n")
        thread.close()
    assert sum(pauses) >= http.REST * sum(worked[:-1])  # the pause for the last one comes after the next


def test_http_that_cannot_start_says_so_instead_of_waiting(monkeypatch) -> None:
    def broken() -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(asyncio, "SelectorEventLoop", broken)
    with socket.create_server(("127.0.0.1", 0)) as sock, pytest.raises(AddressError, match="metrics: .*Too many open"):
        HttpThread(sock, {})
