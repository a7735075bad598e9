"""`gesturectl view`: who may look, what the page shows in a real browser, and that a stalled one holds up nobody."""

import http.client
import json
import os
import re
import socket
import subprocess
import threading
import tomllib
from collections.abc import Callable, Iterator
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from benchmarks.viewers import viewer
from gestured.client.control import Control
from gestured.client.web.door import HEADER, at_home
from gestured.client.web.server import BODY_BYTES, SHARED, STRANGERS
from gestured.control.view import NICE
from gestured.control.view.server import PAGE
from gestured.control.view.source import Looker
from gestured.core.address import Address
from gestured.core.where import zones_of
from gestured.record.tape_reader import read
from tests.control.browser import PROGRAM, Browser
from tests.daemon import tiny_model
from tests.daemon.harness import DEADLINE_S, Daemon, Frame, Sensor
from tests.documents.blocks import blocks

FILES = [*SHARED.iterdir(), *PAGE.iterdir()]


class Page:
    """The viewer as an HTTP client sees it."""

    def __init__(self, said: str) -> None:
        where = urlsplit(said.strip())
        self.whole, self.address, self.token = said.strip(), Address.parse(where.netloc), where.fragment
        self.secret = ""

    def ask(self, path: str, method: str = "GET", body: object = None, **headers: str) -> tuple[int, Any, bytes]:
        """Status, headers and body; with the secret, unless `headers` say otherwise."""
        connection = http.client.HTTPConnection(*self.address, timeout=DEADLINE_S)
        given = {HEADER: self.secret} | {name.replace("_", "-"): value for name, value in headers.items()}
        data = body if isinstance(body, bytes | None) else json.dumps(body)
        try:
            connection.request(method, path, data, {k: v for k, v in given.items() if v})
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def come_in(self) -> "Page":
        """Use the token."""
        status, _, body = self.ask("/open", "POST", {}, X_Gestured_Token=self.token)
        assert status == 200
        self.secret = json.loads(body)["secret"]
        return self

    def stream(self, sensor: str = "") -> "Stream":
        """The server-sent events."""
        return Stream(self, sensor)


class Stream:
    """Server-sent events, read as they come."""

    def __init__(self, page: Page, sensor: str, received: int | None = None) -> None:
        self.sock = socket.socket(socket.AF_INET)
        if received is not None:
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, received)
        self.sock.settimeout(DEADLINE_S)
        self.sock.connect(page.address)
        request = f"GET /stream?sensor={sensor} HTTP/1.1\r\nHost: {page.address}\r\n{HEADER}: {page.secret}\r\n\r\n"
        self.sock.sendall(request.encode())
        self._file = self.sock.makefile("rb")
        assert b" 200 " in self._file.readline()
        while self._file.readline().strip():
            pass

    def until(self, *kinds: str) -> tuple[str, dict[str, Any]]:
        """The next event of one of these kinds."""
        kind = ""
        while line := self._file.readline().decode():
            if line.startswith("event: "):
                kind = line[7:].strip()
            elif line.startswith("data: ") and kind in kinds:
                return kind, json.loads(line[6:])
        raise AssertionError("the viewer hung up")

    def close(self) -> None:
        """Look no more."""
        self._file.close()
        self.sock.close()


@pytest.fixture
def real(serve, tmp_path: Path) -> Daemon:
    """A daemon that the test alone looks at, with a flight recorder."""
    model = tiny_model.make(tmp_path / "tiny.onnx", provisional=tiny_model.PROVISIONAL)
    return serve("--clock", "sensor", "--stale-s", 30, "--flight-recorder", 4, "--touch", "true", model=model)


@pytest.fixture
def process(start, real: Daemon, tmp_path: Path) -> "subprocess.Popen[bytes]":
    return start("view", "--control", real.ready["control"], "--listen", "127.0.0.1:0", "--folder", tmp_path)


@pytest.fixture
def view(process: "subprocess.Popen[bytes]") -> Page:
    assert process.stdout is not None
    return Page(process.stdout.readline().decode())


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


def test_the_browser_of_the_bench_sees_what_a_page_would(real: Daemon) -> None:
    sensor = Sensor(real, "arm").begin()
    sensor.send([sensor.hand.frame()])
    with viewer(real.ready["control"], "arm"):  # raises unless the browser says that it sees the sensor
        pass


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


def test_a_sensor_that_cannot_be_is_refused_and_the_other_pages_go_on(view: Page, real: Daemon) -> None:
    view.come_in()
    sensor = Sensor(real, "arm").begin()
    stream = view.stream("arm")
    sensor.send([sensor.hand.frame()])
    stream.until("frame")
    for name in ("arm%20rest", "a" * 65, "%00"):
        assert view.ask(f"/stream?sensor={name}")[0] == 400
    sensor.send([sensor.hand.frame()])
    stream.until("frame")


@pytest.mark.parametrize("listen", ["127.0.0.2:0", "localhost:0"])
def test_each_loopback_address_is_at_home(start, real: Daemon, listen: str) -> None:
    process = start("view", "--control", real.ready["control"], "--listen", listen)
    page = Page(process.stdout.readline().decode())
    assert page.ask("/")[0] == 200 and page.come_in().ask("/", Origin=f"http://{page.address}")[0] == 200


def test_port_80_is_at_home_without_its_number() -> None:
    asked = Message()
    asked["Host"] = "127.0.0.1"
    assert at_home(asked, Address("127.0.0.1", 80)) and not at_home(asked, Address("127.0.0.1", 81))


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example:80"},
        {"Host": "127.0.0.1"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
def test_another_site_gets_nothing(view: Page, headers: dict[str, str]) -> None:
    token = {"X_Gestured_Token": view.token}
    assert view.ask("/open", "POST", {}, **token, **headers)[0] == 403  # and the token is not used up
    view.come_in()
    assert view.ask("/", **headers)[0] == 403 and view.ask("/stream", **headers)[0] == 403
    assert view.ask("/flag", "POST", {}, **headers)[0] == 403


def test_what_changes_anything_needs_the_header(view: Page, real: Daemon) -> None:
    view.come_in()
    Sensor(real, "arm").begin()
    for wrong in ("", "x", view.token):
        for path in ("/recalibrate", "/flag", "/silence", "/hear"):
            status, _, body = view.ask(path, "POST", {"sensor": "arm"}, X_Gestured_Token=wrong)
            assert status == 403 and "error" in json.loads(body)
    mine = {"Origin": f"http://{view.address}"}
    status, _, body = view.ask("/recalibrate", "POST", {"sensor": "arm"}, **mine)
    assert status == 200 and "arm: learned anew, leave" in json.loads(body)["done"]
    assert view.ask("/recalibrate", "POST", {"sensor": "nobody"}, **mine)[0] == 409
    assert view.ask("/else", "POST", {}, **mine)[0] == 404
    for sent in ([], {"sensor": 1}, {"note": "x" * BODY_BYTES}, b"[" * 4000):
        assert view.ask("/flag", "POST", sent, **mine)[0] == 400


def test_without_a_flight_recorder_flag_says_what_keeps_packets(start, serve, tmp_path: Path) -> None:
    viewer = start("view", "--control", serve().ready["control"], "--listen", "127.0.0.1:0", "--folder", tmp_path)
    page = Page(viewer.stdout.readline().decode())
    page.come_in()
    status, _, body = page.ask("/flag", "POST", {"note": "a tap"}, Origin=f"http://{page.address}")
    assert status == 409 and "--flight-recorder" in json.loads(body)["error"]
    assert list(tmp_path.glob("flag-*")) == []


@pytest.mark.parametrize("listen", ["0.0.0.0:0", "192.0.2.1:9109", "[::]:0"])
def test_it_is_served_on_this_machine_alone(run, real: Daemon, listen: str) -> None:
    status, out, err = run("view", "--listen", listen, "--control", real.ready["control"])
    assert (status, out) == (1, "") and "expected a loopback address" in err


def test_a_port_that_is_taken_and_a_daemon_that_is_not_there(run, real: Daemon, tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        status, _, err = run("view", "--listen", where, "--control", real.ready["control"])
    assert status == 1 and where in err and f"(pid {os.getpid()})" in err
    status, _, err = run("view", "--control", tmp_path / "none.ctl")
    assert status == 1 and "no daemon on" in err


def test_the_page_is_small_and_nothing_in_it_comes_from_elsewhere() -> None:
    assert sum(path.stat().st_size for path in FILES) < 60_000
    for path in FILES:
        text = path.read_text()
        assert not re.search(r"https?://|//[a-z]+\.|innerHTML|outerHTML|insertAdjacent|document\.write|eval\(", text)


def test_a_browser_that_stalls_is_back_in_the_present_and_holds_up_nobody(view: Page, real: Daemon) -> None:
    view.come_in()
    sensor = Sensor(real, "arm").begin()
    other = view.stream("arm")
    while other.until("sensors")[1]["sensors"].get("arm") is None:
        pass
    stalled = Stream(view, "arm", received=4096)
    stalled.until("sensors")
    sensor.send([sensor.hand.frame()])  # who joins is shown what comes from then on
    stalled.until("frame")
    sent: list[float] = []
    for _ in range(300):  # each one is shown to who reads before the next one comes
        sensor.send([sensor.hand.frame()])
        sent.append(other.until("frame")[1]["t"])
    assert len(set(sent)) == 300
    newest, seen = sent[-1], []
    while not seen or seen[-1] < newest:
        seen.append(stalled.until("frame")[1]["t"])
    assert len(seen) < 200  # what was on its way, and then the newest: the rest it was spared
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


def test_it_stands_back_for_the_daemon(process: "subprocess.Popen[bytes]", view: Page) -> None:
    niceness = os.getpriority(os.PRIO_PROCESS, process.pid)
    assert niceness == min(os.getpriority(os.PRIO_PROCESS, 0) + NICE, 19)


def test_it_waits_for_a_daemon_that_starts_again(start, tmp_path: Path) -> None:
    model = tiny_model.make(tmp_path / "tiny.onnx")
    first = Daemon.start(tmp_path, model)
    process = start("view", "--control", first.ready["control"], "--listen", "127.0.0.1:0")
    stream = Page(process.stdout.readline().decode()).come_in().stream()
    stream.until("sensors")
    first.stop()
    assert "daemon on" in stream.until("gone")[1]["reason"]
    second = Daemon.start(tmp_path, model)
    try:
        assert stream.until("sensors")[1]["state"] == "no_data"
    finally:
        second.stop()


@pytest.mark.parametrize("wrong", [{"model": "x"}, {"type": 1}, {"type": "view"}, {"type": "view", "sensor": []}])
def test_what_no_daemon_says_is_a_sentence_on_the_page(start, fake_control, wrong: dict[str, object]) -> None:
    process = start("view", "--control", fake_control("mad", **wrong), "--listen", "127.0.0.1:0")
    stream = Page(process.stdout.readline().decode()).come_in().stream()
    for _ in range(2):  # and it is asked again
        assert "something that gestured does not say" in stream.until("gone")[1]["reason"]


# In a real browser


@pytest.fixture
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if PROGRAM is None:
        pytest.skip("chromium is not installed (apt install chromium)")
    with Browser(tmp_path_factory.mktemp("chromium")) as browser:
        yield browser


def follow(page: Page, browser: Browser, name: str, real: Daemon) -> Sensor:
    """Open the page, and a sensor that it looks at."""
    sensor = Sensor(real, name).begin()
    browser.call("Page.navigate", url=page.whole)
    browser.until(f"document.getElementById('sensor')?.value === {name!r} && state.drawn > 0")
    return sensor


def perform(sensor: Sensor, browser: Browser, direction: str) -> None:
    """A swipe, of which the page sees each frame."""
    show(sensor, browser, [*sensor.hand.swipe(direction), *sensor.hand.idle(1.0)])


def show(sensor: Sensor, browser: Browser, frames: list[Frame]) -> None:
    """Frames, each of which the page sees before the next one comes."""
    for frame in frames:
        before = browser.run("state.frames.length ? state.frames[state.frames.length - 1].t : 0")
        sensor.send([frame])
        browser.until(f"state.frames[state.frames.length - 1].t > {before}")


@pytest.mark.parametrize("width", [400, 1400])
def test_a_swipe_is_drawn_named_and_flagged(view: Page, real: Daemon, browser: Browser, tmp_path, width: int) -> None:
    browser.size(width, 900)
    browser.colours("dark" if width < 600 else "light")
    sensor = follow(view, browser, "armrest", real)
    assert browser.run("location.hash + location.search") == ""  # the token is gone from the address
    perform(sensor, browser, "right")
    browser.until("document.getElementById('name').textContent === 'swipe right'")
    for part in ("name", "matrix"):  # above the fold
        assert browser.run(f"document.getElementById('{part}').getBoundingClientRect().bottom") < 800
    path = browser.run("state.frames.filter(f => f.centroid).map(f => f.centroid[1])")
    assert len(path) >= 6 and path[-1] - path[0] > 4
    phases = browser.run("[...new Set(state.frames.map(f => f.phase))]")
    assert {"IDLE", "CONTACT", "RELEASING"} <= set(phases)
    rows = browser.run("[...document.querySelectorAll('#scores tbody td:first-child')].map(td => td.textContent)")
    assert rows[0] == "swipe right" and rows[2:] == ["none of these"]
    shares = browser.run("[...document.querySelectorAll('#scores meter')].map(meter => meter.value)")
    assert 0.9 < shares[0] and sum(shares) <= 1.001
    assert browser.run("document.querySelector('#events tbody tr').cells.length") == 5
    browser.until("document.querySelector('#sensors tbody tr')?.cells[6].textContent === '1'")  # in the last hour
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")  # nothing sticks out
    browser.run("document.getElementById('note').value = 'a test'; document.getElementById('flag').click()")
    said = browser.until("document.getElementById('done').textContent.includes('.mcap') && done.textContent")
    (kept,) = tmp_path.glob("flag-*.mcap")
    assert str(kept) in said
    tape = read(kept)
    assert any(event["type"] == "gesture" for event in tape.events) and tape.scene["note"] == "a test"
    assert browser.complaints() == []
    if folder := os.environ.get("PYTEST_PICTURES"):
        browser.picture(Path(folder) / f"view-{width}.png")


@pytest.mark.parametrize("width", [400, 1400])
def test_a_provisional_answer_is_shown_as_such_and_then_confirmed_or_revoked(
    view: Page, real: Daemon, browser: Browser, width: int
) -> None:
    browser.size(width, 900)
    sensor = follow(view, browser, "arm", real)
    hand = sensor.hand

    def said(name: str) -> str:
        return browser.run(f"document.getElementById('{name}').textContent")

    def picture(name: str) -> None:
        if folder := os.environ.get("PYTEST_PICTURES"):
            browser.picture(Path(folder) / f"view-{name}-{width}.png")

    show(sensor, browser, hand.swipe("right"))
    browser.until("document.getElementById('name').textContent === 'swipe right'")
    assert browser.run("document.getElementById('name').className") == "guess"
    assert re.fullmatch(r"a guess, \d+ %, \d+ ms after it began", said("name-note"))
    picture("provisional")
    show(sensor, browser, hand.idle(0.5))
    browser.until("document.getElementById('name').className === 'gesture'")
    assert said("name") == "swipe right"
    note = r"\d+ %, \d+ ms after the finger left, confirmed, \d+ ms after the guess"
    assert re.fullmatch(note, said("name-note"))
    show(sensor, browser, [*hand.idle(1.0), *hand.tap(), *hand.idle(0.2)])
    browser.until("document.getElementById('name').className === 'guess'")
    assert said("name") == "one tap"
    show(sensor, browser, [*hand.tap(), *hand.idle(1.0)])
    browser.until("document.getElementById('name').className === 'gesture'")
    assert said("name") == "one tap double tap"
    assert browser.run("document.querySelector('#name s').textContent") == "one tap"
    assert re.fullmatch(note.replace("confirmed", "revoked"), said("name-note"))
    rows = browser.run("[...document.querySelectorAll('#events tbody tr')].map(row => row.cells[2].textContent)")
    assert [row for row in reversed(rows) if row not in ("onset", "release")] == [
        "probably swipe right", "swipe right; provisional confirmed",
        "probably one tap", "double tap; provisional revoked",
    ]  # fmt: skip
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")
    picture("revoked")
    assert browser.complaints() == []


def test_the_scale_comes_back_after_an_outlier(view: Page, real: Daemon, browser: Browser) -> None:
    browser.size(1400, 900)
    sensor = follow(view, browser, "arm", real)
    mad = sensor.hand.frame(4.0)
    mad[2, 2] = 2000.0
    show(sensor, browser, [mad, *sensor.hand.idle(0.5)])
    perform(sensor, browser, "left")
    assert browser.run("state.full") == 200


def test_an_answer_is_drawn_where_it_was_and_a_zone_is_pulled_up_with_the_mouse(
    start, serve, tmp_path: Path, browser: Browser
) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text("[sensors.arm.zones.left]\nat = [0, 0, 0.5, 1]\n")
    real = serve(
        "--clock", "sensor", "--stale-s", 30, "--config", config, model=tiny_model.make(tmp_path / "tiny.onnx")
    )
    process = start("view", "--control", real.ready["control"], "--listen", "127.0.0.1:0")
    browser.size(1400, 900)
    sensor = follow(Page(process.stdout.readline().decode()), browser, "arm", real)
    browser.until("over.zones.left?.join() === '0,0,0.5,1'")
    perform(sensor, browser, "right")
    said = browser.until("document.getElementById('where').textContent")
    assert re.fullmatch(r"From 1\d %, 5\d %.* way 0\.\d\d .* \d+ counts, one finger, in the zone left\.", said)
    box = browser.run("(b => [b.left, b.top, b.width, b.height])(at('matrix').getBoundingClientRect())")

    def pull(*places: tuple[float, float]) -> str:
        for kind, (x, y) in zip(("mousePressed", "mouseMoved", "mouseReleased"), places, strict=True):
            at = {"x": box[0] + (x * 8 + 0.5) / 9 * box[2], "y": box[1] + ((1 - y) * 8 + 0.5) / 9 * box[3]}
            browser.call("Input.dispatchMouseEvent", type=kind, button="left", buttons=1, clickCount=1, **at)
        return browser.run("document.getElementById('zone-note').textContent")

    assert pull((0.6, 0.9), (1.0, 0.25), (1.0, 0.25)) == ""
    lines = browser.run("document.getElementById('zone').textContent")
    pulled = tomllib.loads(lines)["sensors"]["arm"]["zones"]
    assert pulled["volume"]["at"] == pytest.approx([0.6, 0.25, 1.0, 0.9], abs=0.02)
    assert zones_of(pulled | {"left": (0, 0, 0.5, 1)})
    browser.run("navigator.clipboard.writeText = async text => { window.copied = text }")
    browser.run("document.getElementById('copy').click()")
    browser.until("document.getElementById('zone-note').textContent.startsWith('Copied')")
    assert browser.run("window.copied") == lines
    if folder := os.environ.get("PYTEST_PICTURES"):
        browser.picture(Path(folder) / "view-zones.png")
    assert pull((0.3, 0.9), (0.8, 0.25), (0.8, 0.25)) == "It overlaps left: zones must share no place."
    assert browser.complaints() == []


def test_sliders_follow_a_finger(view: Page, real: Daemon, browser: Browser) -> None:
    """One goes to the finger, the other one begins where it stands; the code is the documents' to the letter."""
    (shown,) = [block.text for block in blocks() if block.language == "js"]
    assert shown == (PAGE / "slider.js").read_text()
    sensor = follow(view, browser, "arm", real)
    hand = sensor.hand
    at = "['absolute', 'relative'].map(id => Number(document.getElementById(id).value))"
    for begin, end in ((1, 3), (5, 6)):
        before = browser.run(at)[1]
        for column in np.linspace(begin, end, 10):
            show(sensor, browser, [hand.frame(4.0, column)])
        browser.until(f"Math.abs({at}[0] - {end / 8}) < 0.03")
        assert browser.run(at)[1] == pytest.approx(before + (end - begin) / 8, abs=0.06)
        show(sensor, browser, hand.idle(1.0))
    assert browser.complaints() == []


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


def test_what_lies_on_a_sensor_is_said(view: Page, real: Daemon, browser: Browser) -> None:
    browser.size(1400, 900)
    sensor = follow(view, browser, "arm", real)
    sensor.send([sensor.hand.frame(4.0 + 2 * (k % 2)) for k in range(90)])  # it moves, so that it is not learned
    browser.until("document.getElementById('name').textContent === 'something lies here'")
    assert "learned" in browser.run("document.getElementById('name-note').textContent")
    sensor.send(sensor.hand.idle(2.0))
    browser.until("document.getElementById('name').textContent === '…'")


def test_the_page_says_what_is_wrong_and_what_to_do(start, tmp_path: Path, browser: Browser) -> None:
    daemon = Daemon.start(tmp_path, tiny_model.make(tmp_path / "tiny.onnx"), "--clock", "sensor", "--stale-s", 30)
    process = start("view", "--control", daemon.ready["control"], "--listen", "127.0.0.1:0")
    browser.call("Page.navigate", url=Page(process.stdout.readline().decode()).whole)
    findings = "document.getElementById('findings')?.textContent ?? ''"
    browser.until(f"({findings}).includes('no sensor was heard')")
    assert "gesturectl sniff" in browser.run(findings)
    assert browser.run("document.getElementById('flag').disabled")
    assert "--flight-recorder" in browser.run("document.getElementById('done').textContent")
    sensor = Sensor(daemon, "arm").begin()
    swipe = sensor.hand.swipe("left")
    for _ in range(6):
        sensor.send([40.0 - frame for frame in swipe], sensor.hand.idle(1.0))
    browser.until(f"({findings}).includes('[sensors.arm] invert = true')")
    assert not browser.run("document.body.classList.contains('absent')")
    daemon.stop()
    browser.until("document.body.classList.contains('absent')")  # what is shown is of before


def test_recalibrate_asks_before(view: Page, real: Daemon, browser: Browser) -> None:
    browser.size(1400, 900)
    follow(view, browser, "arm", real)
    for answer in ("false", "true"):
        assert browser.run("document.getElementById('done').textContent") == ""
        browser.run(f"window.confirm = question => {{ window.asked = question; return {answer} }}")
        browser.run("document.getElementById('recalibrate').click()")
        assert "Learn the idle sensor arm anew?" in browser.run("window.asked")
    browser.until("document.getElementById('done').textContent.includes('learned anew')")


def test_pause_step_back_and_keys(view: Page, real: Daemon, browser: Browser) -> None:
    browser.size(1400, 900)
    sensor = follow(view, browser, "arm", real)
    perform(sensor, browser, "left")

    def key(name: str, code: str) -> None:
        for kind in ("keyDown", "keyUp"):
            browser.call("Input.dispatchKeyEvent", type=kind, key=name, code=code, text=name if len(name) == 1 else "")

    key(" ", "Space")
    assert browser.run("state.paused && document.getElementById('pause').getAttribute('aria-pressed')") == "true"
    now = browser.run("state.moment")
    for _ in range(5):
        key("ArrowLeft", "ArrowLeft")
    assert browser.run("state.moment") < now
    shown = browser.run("state.moment")
    sensor.send([sensor.hand.frame()])
    browser.until("state.frames[state.frames.length - 1].time > state.moment + 0.1")
    assert browser.run("state.moment") == shown
    key("c", "KeyC")
    assert browser.run("document.getElementById('counts').checked") is True
    key(" ", "Space")
    browser.until("!state.paused && document.getElementById('ago').textContent === 'now'")
    key("m", "KeyM")
    sensor.send([sensor.hand.frame()])
    browser.until("document.getElementById('raw').checked && state.frames.some(f => f.raw)")
    assert browser.complaints() == []


def test_a_switch_silences_a_sensor_after_a_question(view: Page, real: Daemon, browser: Browser) -> None:
    sensor = follow(view, browser, "arm", real)

    def says(word: str, hears: bool) -> None:
        browser.until(f"document.getElementById('listens').textContent === {word!r}")
        assert browser.run("document.getElementById('gate').getAttribute('aria-checked')") == str(hears).lower()

    says("listens", True)
    for answer, word in ((False, "listens"), (True, "silent, gates closed: view")):
        browser.run(f"window.confirm = question => {{ window.asked = question; return {str(answer).lower()} }}")
        browser.run("document.getElementById('gate').click()")
        assert browser.run("window.asked") == (
            'Silence arm? No program hears a gesture of it until its gate "view" is opened.'
        )
        says(word, not answer)
    perform(sensor, browser, "left")
    browser.until("document.getElementById('name-note').textContent.startsWith('inhibited view,')")
    with Control(Path(real.ready["control"])) as control:
        control.ask("inhibit", sensor="arm", gate="door")
    says("silent, gates closed: door, view", False)
    browser.run("document.getElementById('gate').click()")
    says("silent, gates closed: door", True)
    browser.until("document.getElementById('done').textContent === 'arm: silent, gates closed: door'")
    assert browser.complaints() == []


def test_everything_has_a_name_for_who_does_not_see_it(view: Page, real: Daemon, browser: Browser) -> None:
    browser.size(1400, 900)
    perform(follow(view, browser, "arm", real), browser, "left")
    nodes = browser.call("Accessibility.getFullAXTree")["nodes"]
    roles = {
        "button",
        "checkbox",
        "combobox",
        "slider",
        "textbox",
        "image",
        "table",
        "meter",
        "region",
        "group",
        "link",
    }
    seen = set()
    for node in nodes:
        role = node.get("role", {}).get("value", "").lower()
        if node.get("ignored") or role not in roles:
            continue
        seen.add(role)
        assert node.get("name", {}).get("value"), node
    assert {"button", "checkbox", "combobox", "slider", "textbox", "image", "region"} <= seen
    assert browser.run("document.querySelectorAll('[aria-live=polite]').length") == 1


def test_a_page_on_another_port_of_this_machine_gets_nothing(view: Page, real: Daemon, browser: Browser) -> None:
    """A neighbour serves it, and the owner's browser is led there after it has looked."""
    follow(view, browser, "arm", real)
    secret = browser.run("door.secret")
    heard: list[str] = []

    class Neighbour(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            heard.append(str(self.headers))
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<p id=evil>evil")

        def log_message(self, *_: Any) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), Neighbour) as neighbour:
        threading.Thread(target=neighbour.serve_forever, daemon=True).start()
        browser.call("Page.navigate", url="http://{}:{}/".format(*neighbour.server_address))
        browser.until("document.getElementById('evil') !== null")
        assert browser.run("document.cookie + JSON.stringify(sessionStorage) + JSON.stringify(localStorage)") == "{}{}"
        tried = f"""Promise.all(['include', 'omit'].flatMap(credentials => [
            fetch('http://{view.address}/stream?sensor=arm', {{credentials}}).then(r => r.text(), () => 'refused'),
            fetch('http://{view.address}/recalibrate', {{credentials, method: 'POST', body: '{{"sensor":"arm"}}',
              headers: {{'X-Gestured-Token': 'x'}}}}).then(r => r.text(), () => 'refused')]))"""
        assert browser.run(tried) == ["refused"] * 4
        neighbour.shutdown()
    assert heard and not any(secret in what or "Cookie" in what for what in heard)
    browser.call("Page.navigate", url=f"http://{view.address}/")
    browser.until("document.getElementById('sensor')?.value === 'arm'")  # the tab has kept its secret


def test_a_name_is_never_markup(start, fake_control, browser: Browser) -> None:
    evil = "<img src=x onerror=document.title='owned'>"
    control = fake_control(evil)
    process = start("view", "--control", control, "--listen", "127.0.0.1:0")
    browser.call("Page.navigate", url=Page(process.stdout.readline().decode()).whole)
    browser.until("document.querySelectorAll('#sensors tbody tr').length === 1")
    assert browser.run("document.querySelector('#sensors td').textContent") == evil
    assert browser.run("document.querySelectorAll('img').length") == 0 and browser.run("document.title") != "owned"


@pytest.fixture
def fake_control(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """A daemon whose sensors are called as no real one's can be."""
    listener = socket.socket(socket.AF_UNIX)
    path = tmp_path / "fake.ctl"
    listener.bind(str(path))
    listener.listen()

    def begin(name: str, **wrong: object) -> Path:
        sensor = {"state": name, "rate_hz": 15.0, "jitter_s": 0.0, "lost": 0, "bad_taxels": 0, "source": "a:1"}
        status = {
            "type": "state", "version": name, "state": "ok", "sensors": {name: sensor},
            "model": {"active": name, "gestures": [name]}, "flight_recorder": {"limit_bytes": 0},
            "input": {"dropped": {}, "kernel_drops": 0},
        } | wrong  # fmt: skip

        def answer(client: socket.socket) -> None:
            with client, client.makefile("rb") as file:
                for line in file:
                    asked = json.loads(line)["verb"]
                    told = [{"ok": True}, status] if asked == "follow" else [{"ok": False, "reason": name}]
                    client.sendall(b"".join(json.dumps(line).encode() + b"\n" for line in told))

        def serve() -> None:
            while True:
                try:
                    client, _ = listener.accept()
                except OSError:
                    return
                threading.Thread(target=answer, args=(client,), daemon=True).start()

        threading.Thread(target=serve, daemon=True).start()
        return path

    yield begin
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()
