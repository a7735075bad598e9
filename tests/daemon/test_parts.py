"""Parts of the daemon by themselves, where a whole one cannot be brought into the state."""

import asyncio
import errno
import ipaddress
import json
import socket
import time
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

from gestured.core.errors import SettingsError
from gestured.core.events import Event
from gestured.core.wire import Arrival, Decoder
from gestured.daemon import http, log
from gestured.daemon.health import Health
from gestured.daemon.http import HttpThread, as_json
from gestured.daemon.merge import load
from gestured.daemon.metrics import Metrics
from gestured.daemon.pipeline import Pipeline, allowed
from gestured.daemon.settings import FLAGS, Settings
from gestured.daemon.sockets import AddressError, bind_udp
from gestured.daemon.udp import Receiver
from gestured.daemon.values import Address
from gestured.model.ladder import ladder_for
from tests.daemon import harness
from tests.daemon.harness import DEADLINE_S, Hand


def test_flags_win_over_the_environment_that_over_the_file_that_over_defaults(tmp_path: Path) -> None:
    path = tmp_path / "gestured.toml"
    path.write_text('model = "file"\nstale_s = 3\nmax_sensors = 7\npublish = ["osc://a:1"]\n')
    env = {"GESTURED_MODEL": "env", "GESTURED_STALE_S": "4", "GESTURED_CONFIG": str(path), "OTHER": "x"}
    settings, sources = load({"model": "flag"}, env)
    assert (settings.model, settings.stale_s, settings.max_sensors, settings.clock) == (
        "flag",
        4.0,
        7,
        "arrival",
    )
    assert sources == {
        "model": "command line",
        "stale_s": "environment",
        "max_sensors": str(path),
        "publish": str(path),
    }
    assert load({"config": str(path)}, {})[0].model == "file"


def test_lists_are_written_with_commas_or_repeated(tmp_path: Path) -> None:
    env = {"GESTURED_PUBLISH": "osc://127.0.0.1:1, osc://[::1]:2", "GESTURED_ALLOW": "10.0.0.0/8,::1"}
    settings, _ = load({"gestures": "one_tap,swipe_left"}, env)
    assert [str(a) for a in settings.publish] == ["127.0.0.1:1", "[::1]:2"]
    assert settings.allow == (ipaddress.ip_network("10.0.0.0/8"), ipaddress.ip_network("::1/128"))
    assert settings.gestures == ("one_tap", "swipe_left")


def test_a_subset_and_thresholds_stand_side_by_side_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "gestured.toml"
    path.write_text('[gestures]\nuse = ["one_tap"]\n[gestures.one_tap]\nthreshold = 0.9\nrefractory_s = 1\n')
    settings, _ = load({"config": str(path)}, {})
    assert settings.gestures == ("one_tap",)
    assert settings.per_gesture["one_tap"].threshold == 0.9 and settings.per_gesture["one_tap"].refractory_s == 1


@pytest.mark.parametrize("text", ["127.0.0.1", "127.0.0.1:70000", ":9000", "::1:9000", "a b:1", "", "host:-1"])
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(SettingsError, match=r"listen = .*command line.*expected HOST:PORT"):
        load({"listen": text}, {})


def test_every_setting_is_described_and_the_defaults_can_be_written_down() -> None:
    assert all(field.description for field in Settings.model_fields.values())
    assert set(FLAGS) | {"sensors", "per_gesture", "addresses"} == set(Settings.model_fields)
    text = f'listen = "{Settings().listen}"\nmodel = "{Settings().model}"\n'
    assert Settings.model_validate(tomllib.loads(text)) == Settings()


def test_the_allow_list_knows_mapped_and_scoped_addresses() -> None:
    lan = (ipaddress.ip_network("192.168.7.0/24"), ipaddress.ip_network("fe80::/10"))
    assert allowed("192.168.7.9", lan) and allowed("::ffff:192.168.7.9", lan) and allowed("fe80::1%lo", lan)
    assert not allowed("192.168.8.9", lan) and not allowed("::1", lan)
    assert allowed("8.8.8.8", ())


@pytest.fixture
def pipeline(model: Path) -> tuple[Pipeline, list[Event], Metrics]:
    events: list[Event] = []
    metrics = Metrics()
    settings, _ = load({"model": str(model)}, {})
    return Pipeline(settings, ladder_for(model), metrics, events.append), events, metrics


def feed(pipeline: Pipeline, name: str, frames: list, t: float, source: tuple[str, int] = ("10.0.0.1", 1)) -> float:
    for frame in frames:
        t += 1 / 15
        sensor = pipeline.admit(name, source, t)
        if sensor is not None:
            pipeline.take(sensor, [Arrival(name, frame.astype("f4"), None, None, ())], t)
    return t


def test_a_bug_in_the_path_of_one_sensor_ends_its_contact_and_nothing_else(pipeline, monkeypatch, capfd) -> None:
    log.configure("warning")
    line, events, metrics = pipeline
    hand = Hand()
    t = max(feed(line, name, hand.idle(2.0), 0.0) for name in ("good", "bad"))
    feed(line, "bad", hand.tap(), t)
    front_end = type(line.sensors["bad"].recognizer.front_end)
    push = front_end.push

    def broken(self, frame):
        if self.sensor == "bad":
            raise ZeroDivisionError("a bug")
        return push(self, frame)

    with monkeypatch.context() as patch:
        patch.setattr(front_end, "push", broken)
        feed(line, "bad", hand.tap(), t + 0.2)
        feed(line, "good", hand.swipe("left") + hand.idle(1.0), t)
    kinds = [(type(e).__name__, e.sensor) for e in events]
    assert kinds[:3] == [("Onset", "bad"), ("Cancelled", "bad"), ("Release", "bad")]
    assert [kind for kind, sensor in kinds if sensor == "good"] == ["Onset", "Gesture", "Release"]
    assert metrics.internal_errors.total() == 2
    log.close()
    assert capfd.readouterr().err.count("ZeroDivisionError: a bug") == 1  # logged at a bounded rate
    feed(line, "bad", hand.idle(2.0) + hand.swipe("left") + hand.idle(1.0), t + 1)
    assert [type(e).__name__ for e in events[-3:]] == ["Onset", "Gesture", "Release"] and events[-1].sensor == "bad"


def test_a_bug_in_the_decoder_costs_one_packet(pipeline, monkeypatch) -> None:
    line, _, metrics = pipeline
    decode = Decoder.decode
    monkeypatch.setattr(Decoder, "decode", lambda self, data, source: decode(self, data, source) if data else 1 / 0)
    good = harness.floats("/a/pressure", Hand().frame(), 0)
    line.receive([(packet, ("10.0.0.1", 1)) for packet in (good, b"", b"rubbish!", b"", good)], 1.0)
    assert metrics.internal_errors.total() == 2 and metrics.dropped.values == {("not_osc",): 1}
    assert metrics.frames.values == {("a", "ok"): 2}


@pytest.mark.parametrize(("apart", "taken"), [(0.067, 5), (0.0, 1)])
def test_packets_that_come_thick_are_taken_together_and_no_others_wait(pipeline, apart: float, taken: int) -> None:
    line, _, metrics = pipeline
    hand, rests, now = Hand(), [], 0.0

    async def main() -> None:
        nonlocal now
        loop = asyncio.get_running_loop()
        loop.call_later = lambda _, listen: rests.append(listen) or asyncio.Handle(listen, (), loop)
        with bind_udp(Address("127.0.0.1", 0)) as sock, socket.socket(type=socket.SOCK_DGRAM) as sender:
            receiver = Receiver(sock, line, lambda: now)
            sender.connect(sock.getsockname())
            for k in range(5):
                now += apart
                sender.send(harness.floats("/a/pressure", hand.frame(), k))
                await turn()
            assert metrics.frames.values == {("a", "ok"): taken} and len(rests) == (taken < 5)
            for listen in rests:
                listen()
            await turn()
            assert metrics.frames.values == {("a", "ok"): 5}
            receiver.close()

    async def turn() -> None:
        for _ in range(3):
            await asyncio.sleep(0)

    asyncio.run(main())


def test_healthz_says_when_the_loop_hangs(pipeline, model: Path) -> None:
    health = Health(pipeline[0])
    assert health.healthz()[0] == 200 == health.readyz()[0]
    health.beat = time.monotonic() - 10
    assert health.healthz()[0] == 503
    status, body = health.readyz()
    assert status == 503 and "hangs" in str(body["reason"])
    health.beat, health.stopping = time.monotonic(), True
    assert "stopping" in str(health.readyz()[1]["reason"])


@pytest.fixture
def web() -> "tuple[tuple[str, int], HttpThread]":
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
    for request, status in (
        (b"GET /no HTTP/1.1\r\n\r\n", b"404"), (b"POST /ok HTTP/1.1\r\n\r\n", b"405"),
        (b"rubbish\r\n\r\n", b"400"), (b"GET /broken HTTP/1.1\r\n\r\n", b"500"),
    ):  # fmt: skip
        assert ask(address, request).split()[1] == status
    assert ask(address, b"x" * 20_000) == b""


def slow(address: tuple[str, int], count: int) -> list[socket.socket]:
    """Connections that have begun a request and go no further."""
    socks = [socket.create_connection(address, DEADLINE_S) for _ in range(count)]
    for sock in socks:
        with suppress(OSError):  # it had to make place already
            sock.sendall(b"GET /ok HT")
    return socks


def test_slow_http_clients_hold_nobody_up(web) -> None:
    address, _ = web
    socks = slow(address, 3 * http.CONNECTIONS)
    for _ in range(3):
        assert ask(address, b"GET /ok HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 200")
        socks += slow(address, http.CONNECTIONS)
    for sock in socks[: http.CONNECTIONS]:  # those that came first made place
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


def test_http_that_cannot_start_says_so_instead_of_waiting(monkeypatch) -> None:
    def broken() -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(asyncio, "SelectorEventLoop", broken)
    with socket.create_server(("127.0.0.1", 0)) as sock, pytest.raises(AddressError, match="metrics: .*Too many open"):
        HttpThread(sock, {})
