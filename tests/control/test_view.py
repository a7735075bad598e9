"""`gesturectl view`: who may look, and that nobody holds up another; what the page shows is in test_view_page.py."""

import json
import os
import re
import signal
import socket
from email.message import Message
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from gestured.client.web.door import at_home
from gestured.client.web.server import BODY_BYTES, SHARED, STRANGERS, Handler
from gestured.control.view import NICE
from gestured.control.view.server import PAGE
from gestured.control.view.source import Looker
from gestured.core.address import Address
from tests.control.pages import Page, Stream, viewing
from tests.daemon import tiny_model
from tests.daemon.harness import DEADLINE_S, Daemon, Sensor

FILES = [*SHARED.iterdir(), *PAGE.iterdir()]


def test_the_address_works_once_and_becomes_a_secret_of_the_tab(view: Page) -> None:
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/#[\w-]{32}", view.whole)
    for token in ("", "x", "\x00=;;"):
        assert view.ask("/stream", X_Gestured_Token=token)[0] == 403
        assert view.ask("/open", "POST", {}, X_Gestured_Token=token)[0] == 403
    view.come_in()
    assert view.ask("/open", "POST", {})[0] == 200  # a page that is loaded again
    status, _, body = view.ask("/open", "POST", {}, X_Gestured_Token=view.token)
    assert status == 403 and b"Start gesturectl view again" in body
    assert view.ask("/stream", X_Gestured_Token=view.token)[0] == 403


def test_the_command_prints_the_address_and_stands_back_for_the_daemon(start, real: Daemon) -> None:
    process = start("view", "--control", real.ready["control"], "--listen", "localhost:0")
    page = Page(process.stdout.readline().decode())
    assert page.come_in().ask("/", Origin=f"http://{page.address}")[0] == 200
    niceness = os.getpriority(os.PRIO_PROCESS, process.pid)
    assert niceness == min(os.getpriority(os.PRIO_PROCESS, 0) + NICE, 19)


def test_the_folder_for_what_is_flagged_is_made_before_anything_is(start, run, real: Daemon, tmp_path: Path) -> None:
    flags = ("view", "--control", real.ready["control"], "--listen", "127.0.0.1:0", "--folder")
    assert start(*flags, tmp_path / "new" / "flagged").stdout.readline()
    assert (tmp_path / "new" / "flagged").is_dir()
    (tmp_path / "file").touch()
    status, out, err = run(*flags, tmp_path / "file")
    assert (status, out) == (1, "") and f"--folder {tmp_path / 'file'}" in err


def test_what_a_browser_is_told_to_allow(view: Page) -> None:
    view.come_in()
    for path in FILES:
        status, headers, body = view.ask(f"/{path.name}".removesuffix("index.html"))
        assert status == 200 and body == path.read_bytes()
        policy = headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'") and "unsafe" not in policy and "frame-ancestors 'none'" in policy
        assert headers["Referrer-Policy"] == "no-referrer" and headers["X-Content-Type-Options"] == "nosniff"
        assert not any(name.lower().startswith(("access-control", "set-cookie")) for name in headers)


def test_who_trickles_a_request_keeps_nobody_out(view: Page) -> None:
    """Each further connection that has shown nothing takes the place of the oldest one."""
    view.come_in()
    slow = [socket.create_connection(view.address) for _ in range(2 * STRANGERS)]
    for sock in slow:
        sock.sendall(b"GET / HT")
    assert view.ask("/")[0] == 200
    stream = view.stream()
    slow += [socket.create_connection(view.address) for _ in range(2 * STRANGERS)]
    stream.until("sensors")
    slow[0].settimeout(DEADLINE_S)
    assert slow[0].recv(1) == b""
    for sock in slow:
        sock.close()


def test_who_takes_his_time_is_hung_up_on_and_who_looks_is_not(view: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gestured.client.web.server.ASK_S", 0.5)
    monkeypatch.setattr(Handler, "timeout", 2 * DEADLINE_S)  # of a single read
    stream = view.come_in().stream()
    with socket.create_connection(view.address, timeout=DEADLINE_S) as slow:
        slow.sendall(b"GET / HT")
        assert slow.recv(1) == b""
    for _ in range(2):
        stream.until("sensors")


@pytest.mark.parametrize("error", [BrokenPipeError, KeyError])
def test_of_a_bug_there_is_a_traceback_and_of_a_browser_that_has_gone_there_is_none(
    view: Page, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: type[Exception]
) -> None:
    monkeypatch.setattr(Handler, "stream", Mock(side_effect=error))
    with pytest.raises(ConnectionResetError):
        view.come_in().ask("/stream")
    assert ("KeyError" in capsys.readouterr().err) == (error is KeyError)
    assert view.ask("/")[0] == 200


@pytest.mark.parametrize("target", ["http://[", "http://[x]/", "//[::1/stream", "*"])
def test_an_address_that_is_none_gets_an_answer(view: Page, target: str) -> None:
    with socket.create_connection(view.address, timeout=DEADLINE_S) as sock:
        sock.sendall(f"GET {target} HTTP/1.1\r\nHost: {view.address}\r\n\r\n".encode())
        said = sock.makefile("rb").readline()
    assert said.split()[1:2] in ([b"400"], [b"404"])


def test_a_sensor_that_cannot_be_is_refused_and_the_other_pages_go_on(view: Page, real: Daemon, arm: str) -> None:
    view.come_in()
    sensor = Sensor(real, arm).begin()
    stream = view.stream(arm)
    sensor.send([sensor.hand.frame()])
    stream.until("frame")
    for name in ("arm%20rest", "a" * 65, "%00"):
        assert view.ask(f"/stream?sensor={name}")[0] == 400
    sensor.send([sensor.hand.frame()])
    stream.until("frame")


@pytest.mark.parametrize(
    ("address", "headers", "home"),
    [
        ("127.0.0.1:80", {"Host": "127.0.0.1"}, True),
        ("127.0.0.1:81", {"Host": "127.0.0.1"}, False),
        ("127.0.0.2:81", {"Host": "localhost:81", "Origin": "http://localhost:81"}, True),
        ("192.0.2.1:81", {"Host": "localhost:81"}, False),
        ("127.0.0.1:80", {"Host": "evil.example:80"}, False),
        ("127.0.0.1:80", {"Host": "127.0.0.1", "Origin": "http://evil.example"}, False),
        ("127.0.0.1:80", {"Host": "127.0.0.1", "Origin": "null"}, False),
        ("127.0.0.1:80", {"Host": "127.0.0.1", "Sec-Fetch-Site": "cross-site"}, False),
        ("127.0.0.1:80", {"Host": "127.0.0.1", "Sec-Fetch-Site": "same-site"}, False),
    ],
)
def test_who_asks_by_another_name_or_from_another_page_is_not_at_home(
    address: str, headers: dict[str, str], home: bool
) -> None:
    asked = Message()
    for name, value in headers.items():
        asked[name] = value
    assert at_home(asked, Address.parse(address)) == home


def test_another_site_gets_nothing(view: Page) -> None:
    evil = {"Origin": "http://evil.example"}
    assert view.ask("/open", "POST", {}, X_Gestured_Token=view.token, **evil)[0] == 403  # it is not used up
    view.come_in()
    status, _, body = view.ask("/", Host="localhost:1")  # as of a forwarded port of another number
    assert status == 403 and f"http://{view.address}/" in body.decode()
    assert view.ask("/", **evil)[0] == view.ask("/stream", **evil)[0] == view.ask("/flag", "POST", {}, **evil)[0] == 403


def test_what_changes_anything_needs_the_header(view: Page, real: Daemon, arm: str) -> None:
    view.come_in()
    Sensor(real, arm).begin()
    for wrong in ("", "x", view.token):
        for path in ("/recalibrate", "/flag", "/silence", "/hear"):
            status, _, body = view.ask(path, "POST", {"sensor": arm}, X_Gestured_Token=wrong)
            assert status == 403 and "error" in json.loads(body)
    mine = {"Origin": f"http://{view.address}"}
    status, _, body = view.ask("/recalibrate", "POST", {"sensor": arm}, **mine)
    assert status == 200 and f"learning {arm} anew" in json.loads(body)["done"]
    assert view.ask("/recalibrate", "POST", {"sensor": "nobody"}, **mine)[0] == 409
    assert view.ask("/else", "POST", {}, **mine)[0] == 404
    for sent in ([], {"sensor": 1}, {"note": "x" * BODY_BYTES}, b"[" * 4000):
        assert view.ask("/flag", "POST", sent, **mine)[0] == 400


@pytest.mark.parametrize("listen", ["0.0.0.0:0", "192.0.2.1:9109", "[::]:0"])
def test_it_is_served_on_this_machine_alone(run, real: Daemon, listen: str) -> None:
    status, out, err = run("view", "--listen", listen, "--control", real.ready["control"])
    assert (status, out) == (1, "") and "expected a loopback address" in err


def test_a_port_that_is_taken_is_said(run, real: Daemon) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        status, _, err = run("view", "--listen", where, "--control", real.ready["control"])
    assert status == 1 and where in err and "sudo ss -tlpn" in err


def test_the_page_is_small_and_nothing_in_it_comes_from_elsewhere() -> None:
    assert sum(path.stat().st_size for path in FILES) < 60_000
    for path in FILES:
        text = path.read_text()
        assert not re.search(r"https?://|//[a-z]+\.|innerHTML|outerHTML|insertAdjacent|document\.write|eval\(", text)


def test_a_browser_that_stalls_is_back_in_the_present_and_holds_up_nobody(
    view: Page, real: Daemon, arm: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gestured.client.web.server.SENT_BYTES", 4096)
    view.come_in()
    sensor = Sensor(real, arm).begin()
    other = view.stream(arm)
    while other.until("sensors")[1]["sensors"].get(arm) is None:
        pass
    stalled = Stream(view, arm, received=4096)
    stalled.until("sensors")
    sensor.send([sensor.hand.frame()])  # who joins is shown what comes from then on
    stalled.until("frame")
    sent: list[float] = []
    for _ in range(60):  # each one is shown to who reads before the next one comes
        sensor.send([sensor.hand.frame()])
        sent.append(other.until("frame")[1]["t"])
    assert len(set(sent)) == 60
    newest, seen = sent[-1], []
    while not seen or seen[-1] < newest:
        seen.append(stalled.until("frame")[1]["t"])
    assert len(seen) < 40  # what was on its way, and then the newest: the rest it was spared
    assert seen == sorted(set(seen))


def test_the_daemon_foresees_nothing_of_sensors_that_nobody_looks_at(view: Page, real: Daemon) -> None:
    plain = real.client().subscribe("gesture")
    view.come_in()
    stream = view.stream("seen")
    seen, unseen = Sensor(real, "seen").begin(), Sensor(real, "unseen").begin()
    stream.until("frame")
    told: list[tuple[str, str, str | None]] = []

    def hear(name: str, last: str) -> None:
        while not told or told[-1][:2] != (name, last):
            _, event = stream.until("event")
            told.append((event["sensor"], event["type"], event.get("provisional")))

    seen.send(seen.hand.swipe("left"))
    hear("seen", "provisional")  # for which the daemon takes its time
    seen.send(seen.hand.idle(1.0))
    hear("seen", "gesture")
    unseen.perform("left")
    hear("unseen", "gesture")
    answers = [(name, given) for name, kind, given in told if kind == "gesture"]
    assert answers == [("seen", "confirmed"), ("unseen", None)]  # events of all sensors are listed
    assert [name for name, kind, _ in told if kind == "provisional"] == ["seen"]
    assert len(told) == len(set(told))
    assert [plain.events("gesture", name, 1)[0]["provisional"] for name in ("seen", "unseen")] == ["confirmed", None]


def test_whoever_looks_elsewhere_sees_that_and_what_is_silent_is_seen_too(view: Page, real: Daemon) -> None:
    view.come_in()
    Sensor(real, "one").begin().send([])
    two = Sensor(real, "two").begin()
    for name in ("one", "two", "one", "one"):  # the last one finds it looked at already
        assert view.stream(name).until("frame")[1]["sensor"] == name
    stream = view.stream("two")
    two.send([two.hand.frame(4, 4), two.hand.frame(4, 4)])
    while stream.until("frame")[1]["activity"] < 5:
        pass


def test_a_daemon_that_hangs_is_said_to_and_heard_again(
    view: Page, real: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gestured.control.view.source.SILENT_S", 1.5)  # it tells its state each second
    stream = view.come_in().stream()
    stream.until("sensors")
    real.signal(signal.SIGSTOP)
    try:
        for _ in range(2):  # while it is asked, and when it is called again
            assert "it hangs" in stream.until("gone")[1]["reason"]
    finally:
        real.signal(signal.SIGCONT)
    stream.until("sensors")


def test_who_comes_after_the_daemon_has_gone_is_not_told_how_it_was(tmp_path: Path) -> None:
    daemon = Daemon.start(tmp_path, tiny_model.make(tmp_path / "tiny.onnx"))
    with viewing(daemon.ready["control"]) as page:
        first = page.come_in().stream()
        first.until("sensors")
        daemon.stop()
        first.until("gone")
        assert page.stream().until("sensors", "gone")[0] == "gone"


@pytest.mark.parametrize("wrong", [{"model": "x"}, {"type": 1}, {"type": "view"}, {"type": "view", "sensor": []}])
def test_what_no_daemon_says_is_a_sentence_on_the_page(
    fake_control, wrong: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gestured.control.view.source.AGAIN_S", 0.05)
    with viewing(fake_control("mad", **wrong)) as page:
        stream = page.come_in().stream()
        for _ in range(2):  # and it is asked again
            assert "says something that gestured" in stream.until("gone")[1]["reason"]


def test_moves_of_a_finger_wait_for_a_browser_as_one() -> None:
    looker = Looker("arm", raw=False)
    move: dict[str, Any] = {
        "type": "touch", "id": 1, "touch": 0, "phase": "move", "x": 0.5, "dx": 0.25, "dy": 0.0
    }  # fmt: skip
    for told in (move | {"phase": "down"}, move, move | {"touch": 1}, move | {"x": 0.75}):
        looker.touch(told)
    looker.put("event", {"type": "gesture"})
    looker.touch(move | {"phase": "up"})
    parts = (looker.take(1.0) or b"").split(b"data: ")[1:]
    sent: list[dict[str, Any]] = [json.loads(part.splitlines()[0]) for part in parts]
    fingers = [(one["touch"], one["phase"], one["x"], one["dx"]) for one in sent if one["type"] == "touch"]
    assert fingers == [
        (0, "down", 0.5, 0.25), (0, "move", 0.75, 0.5), (1, "move", 0.5, 0.25), (0, "up", 0.5, 0.25)
    ]  # fmt: skip
    assert move["dx"] == 0.25  # others are shown it, too
