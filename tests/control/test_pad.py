"""`gesturectl pad`: what is drawn on a pad is felt, sent and named; who may touch it, and how much."""

import errno
import json
import math
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import Mock

import pytest

from gestured.client.pad.contacts import MOST, SILENT_S, Contacts
from gestured.client.pad.invitation import invite
from gestured.client.pad.pad import Pad
from gestured.client.pad.server import MESSAGES, PadServer
from gestured.client.web.server import BODY_BYTES
from gestured.core.address import Address
from gestured.core.events import Gesture
from gestured.core.frames import Frame
from gestured.simulator import GESTURES, SimulatedSensor
from gestured.simulator.live import LiveTextile
from tests.control.browser import Browser
from tests.control.pages import Page, Stream
from tests.daemon.harness import DEADLINE_S, Sensor
from tests.sockets import FakeDaemon, free_address

Way = Callable[[float], tuple[float, float]]  # share of the time -> x, y, from the bottom-left corner


def line(x0: float, y0: float, x1: float, y1: float) -> Way:
    return lambda u: (x0 + u * (x1 - x0), y0 + u * (y1 - y0))


def circle(sense: float) -> Way:
    return lambda u: (0.5 + sense * 0.28 * math.sin(6.5 * u), 0.5 + 0.28 * math.cos(6.5 * u))


def two(y0: float, y1: float) -> list[Way]:
    return [line(x, y0, x, y1) for x in (0.34, 0.66)]


STILL = line(0.5, 0.5, 0.5, 0.5)
PERFORMED: dict[str, list[tuple[list[Way], float]]] = {  # strokes of some fingers, and how long each takes, s
    "one_tap": [([STILL], 0.12)],
    "double_tap": [([STILL], 0.12), ([STILL], 0.12)],
    "swipe_down": [([line(0.5, 0.85, 0.5, 0.15)], 0.4)],
    "swipe_up": [([line(0.5, 0.15, 0.5, 0.85)], 0.4)],
    "swipe_right": [([line(0.15, 0.5, 0.85, 0.5)], 0.4)],
    "swipe_left": [([line(0.85, 0.5, 0.15, 0.5)], 0.4)],
    "circle_clockwise": [([circle(1)], 1.2)],
    "circle_counter_clockwise": [([circle(-1)], 1.2)],
    "swipe_up_two_fingers": [(two(0.15, 0.85), 0.45)],
    "swipe_down_two_fingers": [(two(0.85, 0.15), 0.45)],
}
BETWEEN_TAPS_S = 0.18


# Contacts and frames, without a clock


class Drawn:
    """A pad on which things are drawn in a time of its own; what is felt is kept."""

    def __init__(self, rate_hz: float = 15.0) -> None:
        self.sensor = SimulatedSensor.nominal() if rate_hz == 15.0 else SimulatedSensor(seed=1, rate_hz=rate_hz)
        self.contacts, self.textile = Contacts(self.sensor), LiveTextile(self.sensor, 1)
        self.now, self.frames = 100.0, 0
        self.felt: list[Frame] = []

    def wait(self, seconds: float) -> None:
        """Let time pass; each frame is felt 60 ms after it was touched, as in a pad."""
        end = self.now + seconds
        while (t := 100.0 + (self.frames + 1) / self.sensor.rate_hz) <= end:
            self.now, self.frames = t, self.frames + 1
            presses, touches = self.contacts.presses(t - 0.06, t)
            self.felt.append(Frame(t, self.textile.frame(t - 0.06, presses), touches))
        self.now = end

    def take(self, *samples: Sequence[float]) -> None:
        """Samples at this moment, by a browser whose clock began long ago: number, x, y, pressure, width."""
        sent = self.now + 1e6
        self.contacts.take(sent, [[n, sent, *rest] for n, *rest in samples], self.now)

    def draw(self, ways: list[Way], seconds: float) -> None:
        steps = round(seconds / 0.016)
        for k in range(steps):
            self.take(*([n, *way(k / (steps - 1)), 0.5, 0.06] for n, way in enumerate(ways)))
            self.wait(0.016)
        self.take(*([n, *way(1.0), 0.0, 0.0] for n, way in enumerate(ways)))


@pytest.mark.parametrize("gesture", GESTURES)
def test_each_gesture_that_is_drawn_is_named(gesture: str) -> None:
    import gestured

    drawn = Drawn()
    drawn.wait(2.0)
    for strokes in PERFORMED[gesture]:
        drawn.draw(*strokes)
        drawn.wait(BETWEEN_TAPS_S)
    drawn.wait(1.5)
    recognizer = gestured.open("cnn_lstm", sensor="pad")
    events = [event for frame in drawn.felt for event in recognizer.push(frame.t, frame.values)]
    assert [event.gesture for event in events if isinstance(event, Gesture)] == [gesture]


def strongest(frame: Frame, idle: Frame) -> tuple[int, int]:
    rise = frame.values.astype(float) - idle.values
    return divmod(int(rise.argmax()), rise.shape[1])


def test_a_finger_is_felt_where_it_is_and_as_hard_as_it_presses() -> None:
    drawn = Drawn()
    drawn.wait(0.5)
    idle = drawn.felt[-1]
    rises = []
    for pressure in (0.25, 0.5, 1.0):
        drawn.take([3, 2.5 / 9, 1 - 6.5 / 9, pressure, 0.0])  # the middle of row 6, column 2
        drawn.wait(0.5)
        assert strongest(drawn.felt[-1], idle) == (6, 2)
        (touch,) = drawn.felt[-1].touches
        assert (touch.x, touch.y) == pytest.approx((2.0, 2.0))
        rises.append(float((drawn.felt[-1].values.astype(float) - idle.values).max()))
    assert rises[0] < rises[1] < rises[2]


def test_who_says_nothing_touches_nothing_and_no_more_than_ten_do() -> None:
    drawn = Drawn()
    drawn.take(*([n, 0.5, 0.5, 0.5, 0.0] for n in range(MOST + 5)))
    drawn.wait(0.3)
    assert len(drawn.contacts.presses(drawn.now, drawn.now)[0]) == MOST
    drawn.wait(SILENT_S)
    assert not drawn.contacts.down


def test_a_browser_whose_clock_stood_still_is_followed_again() -> None:
    drawn = Drawn()
    drawn.draw([STILL], 0.1)
    drawn.wait(1.0)
    drawn.contacts.take(drawn.now - 3600.0, [[1, drawn.now - 3600.0, 0.5, 0.5, 0.5, 0.0]], drawn.now)
    idle = drawn.felt[-1]
    drawn.wait(0.2)
    assert strongest(drawn.felt[-1], idle) == (4, 4)


# The server


@contextmanager
def served(
    to: Address | None = None, grid: tuple[int, int] = (9, 9), **more: float
) -> Iterator[tuple[PadServer, Page]]:
    pad = Pad(to or free_address(), "pad", grid, 15.0)
    with PadServer(Address("127.0.0.1", 0), pad, "gesturectl pad", **more).serve() as server:
        yield server, Page(server.page)


def test_a_pad_that_ends_before_it_is_served_does_not_hang():
    """As if Ctrl-C came in between."""
    server = PadServer(Address("127.0.0.1", 0), Pad(free_address(), "pad", (9, 9), 15.0), "gesturectl pad")
    ending = threading.Thread(target=server.__exit__, daemon=True)
    ending.start()
    ending.join(DEADLINE_S)
    assert not ending.is_alive()


def seat(page: Page) -> tuple[Stream, int]:
    stream = page.stream()
    return stream, stream.until("seat")[1]["seat"]


def touch(page: Page, number: int, *samples: object, sent: object = 1.0) -> tuple[int, str]:
    status, _, body = page.ask("/touch", "POST", {"seat": number, "sent": sent, "samples": samples})
    return status, json.loads(body).get("error", "")


FINGER = [1, 1.0, 0.5, 0.5, 0.5, 0.0]


def test_the_token_opens_once_for_contacts_and_nothing_else() -> None:
    with served() as (_, page):
        assert touch(page, 1, FINGER)[0] == 403 and page.ask("/stream")[0] == 403
        stream, number = seat(page.come_in())
        assert touch(page, number, FINGER) == (200, "")
        while max(stream.until("frame")[1]["values"]) < 300:
            pass
        for path in ("/flag", "/recalibrate", "/key", "/", "/stream"):
            assert page.ask(path, "POST", {"sensor": "pad", "key": "r"})[0] == 404
        status, _, body = page.ask("/open", "POST", {}, X_Gestured_Token=page.token)
        assert status == 403 and b"Start gesturectl pad again" in body


def test_what_is_no_message_is_refused_and_the_pad_goes_on() -> None:
    with served() as (_, page):
        stream, number = seat(page.come_in())
        for wrong in ([1], [1, 1.0, 0.5, 0.5, 0.5, "0"], "x", [1e400, 1, 1, 1, 1, 1], [True] * 6, [1 << 60] * 6):
            assert touch(page, number, wrong)[0] == 400
        for sent in ("now", None, 1e400, -1e400, 10**400):
            assert touch(page, number, FINGER, sent=sent)[0] == 400
        assert page.ask("/touch", "POST", {"x": "x" * BODY_BYTES})[0] == 400
        assert touch(page, number, FINGER) == (200, "")
        stream.until("frame")


def test_more_messages_than_a_screen_has_pictures_are_refused() -> None:
    with served() as (_, page):
        _, number = seat(page.come_in())
        begun, answers = time.monotonic(), []
        while len(answers) < 10 * MESSAGES and 429 not in answers and time.monotonic() - begun < 60:
            answers.append(touch(page, number)[0])
            if len(answers) <= MESSAGES:
                assert answers[-1] == 200
        taken = answers.count(200)
        assert taken <= MESSAGES * (time.monotonic() - begun + 1)


def test_one_browser_has_the_pad_and_what_touched_it_before_is_lifted() -> None:
    with served() as (server, page):
        first, number = seat(page.come_in())
        assert touch(page, number, FINGER)[0] == 200 and server.pad.contacts.down
        second, later = seat(page)
        assert "Another tab" in first.until("over")[1]["reason"]
        assert not server.pad.contacts.down
        assert touch(page, number, FINGER)[0] == 409 and touch(page, later, FINGER)[0] == 200
        second.until("frame")


def test_a_pad_that_nobody_touches_ends() -> None:
    with served(idle_s=1.0) as (server, page):
        stream, number = seat(page.come_in())
        assert "ended" in stream.until("over")[1]["reason"]
        assert server.ended.wait(60)
        assert touch(page, number, FINGER)[0] == 403 and page.ask("/open", "POST", {})[0] == 403


def test_the_page_is_told_why_frames_are_not_heard_for_as_long_as_they_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gestured.client.pad.pad.AGAIN_S", 0.05)
    with served() as (_, page):
        stream, _ = seat(page.come_in())
        wrong(stream, "nobody listens on")
        with monkeypatch.context() as patch:
            unreachable = Mock(side_effect=OSError(errno.EHOSTUNREACH, "No route to host"))
            patch.setattr("gestured.client.sensor.sent_after_refusal", unreachable)
            wrong(stream, "cannot send to")
        wrong(stream, "nobody listens on")


def test_a_message_that_was_lost_is_said_and_sent_again(udp: socket.socket, browser: Browser) -> None:
    """Its connection is cut, or cut within the answer, or nothing comes."""
    with served(Address(*udp.getsockname())) as (server, page):
        browser.call("Page.navigate", url=page.whole)
        browser.until("typeof state === 'object' && state.drawn > 0")
        said = browser.run("at('state').textContent")
        browser.run("timeout = AbortSignal.timeout; AbortSignal.timeout = ms => timeout.call(AbortSignal, ms / 20)")
        browser.run("fetching = fetch")
        hand = Hand(browser)
        for lost in (
            "async () => { throw new TypeError('cut') }",
            "async () => new Response('{')",
            "(_, more) => new Promise((_, no) => { more.signal.onabort = () => no(more.signal.reason) })",
        ):
            hand.mouse(STILL, 0.1)
            browser.until("Math.max(...state.frame.values) > 300")
            browser.run(f"fetch = {lost}")
            hand.let_go()
            browser.until("at('state').classList.contains('gone')")
            browser.run("fetch = fetching")
            sent = "!state.waiting.length && !state.flying"  # a message before the finger left may be what went well
            browser.until(f"{sent} && at('state').textContent === {said!r} && !at('state').classList.contains('gone')")
            assert not server.pad.contacts.down


def test_a_browser_of_2022_is_told_what_is_felt_and_tells_what_holds_still(browser: Browser) -> None:
    older = browser.call(
        "Page.addScriptToEvaluateOnNewDocument", source="delete AbortSignal.any; delete Array.prototype.with"
    )
    try:
        with served() as (_, page):
            browser.call("Page.navigate", url=page.whole)
            browser.until("typeof state === 'object' && state.drawn > 0")
            hand = Hand(browser)
            hand.mouse(STILL, 0.1)
            told = browser.run("[...down.values()][0][1]")
            browser.until(f"[...down.values()][0][1] > {told}")
            hand.let_go()
    finally:
        browser.call("Page.removeScriptToEvaluateOnNewDocument", **older)


def test_the_keys_that_a_collection_names_are_pressed_on_the_page_too(browser: Browser) -> None:
    pressed: list[str] = []
    with served() as (server, page):
        server.press = pressed.append
        browser.call("Page.navigate", url=page.whole)
        browser.until("typeof state === 'object' && state.seat?.keys")
        for name, control in (("Enter", 0), ("r", 0), ("r", 2), ("x", 0), ("p", 0)):
            browser.call("Input.dispatchKeyEvent", type="rawKeyDown", key=name, modifiers=control)
        browser.run("document.querySelectorAll('#lead button')[2].focus()")
        browser.call("Input.dispatchKeyEvent", type="keyDown", key="Enter", text="\r")
        while len(pressed) < 4:
            browser.run("1")
    assert sorted(pressed) == ["\n", "d", "p", "r"]


@pytest.mark.parametrize("grid", [(9, 9), (27, 15)])
def test_all_of_a_pad_is_in_the_window(grid: tuple[int, int], browser: Browser) -> None:
    browser.size(1280, 600)
    with served(grid=grid) as (_, page):
        browser.call("Page.navigate", url=page.whole)
        browser.until("typeof state === 'object' && state.drawn > 0")
        browser.until("pad.getBoundingClientRect().bottom <= innerHeight")


def wrong(stream: Stream, words: str) -> None:
    """Wait for a frame that says so; of "", that nothing is wrong."""
    while (said := stream.until("frame")[1]["wrong"]) != words and (not words or words not in said):
        pass


def test_a_daemon_that_hangs_hears_nothing_or_goes_is_said_and_heard_again(
    serve, udp: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gestured.client.pad.server.SILENT_S", 1.5)  # it tells its status each second
    daemon = serve()
    pad = Pad(Address(*udp.getsockname()), "pad", (9, 9), 15.0)
    with PadServer(Address("127.0.0.1", 0), pad, "gesturectl pad").serve(daemon.socket) as server:
        stream, _ = seat(Page(server.page).come_in())
        daemon.signal(signal.SIGSTOP)
        try:
            wrong(stream, "hangs")
        finally:
            daemon.signal(signal.SIGCONT)
        wrong(stream, "takes no frames of pad")  # they went elsewhere, or are of another grid
        Sensor(daemon, "pad").begin()
        wrong(stream, "")
        daemon.stop()
        wrong(stream, "no daemon on")


def test_a_page_that_is_opened_later_is_told_why_there_will_be_no_names(udp: socket.socket, fake: FakeDaemon) -> None:
    """As to who may not read the daemon's events."""
    pad = Pad(Address(*udp.getsockname()), "pad", (9, 9), 15.0)
    with PadServer(Address("127.0.0.1", 0), pad, "gesturectl pad").serve(fake.path) as server:
        fake.accept({"type": "what no daemon says"})
        while fake.client.recv(4096):  # until it is hung up
            pass
        stream, _ = seat(Page(server.page).come_in())
        wrong(stream, "does not speak protocol")


@pytest.mark.parametrize("listen", ["0.0.0.0:0", "[::]:0", "0:0"])
def test_it_never_binds_all_addresses(run, listen: str) -> None:
    status, out, err = run("pad", "--to", free_address(), "--listen", listen)
    assert (status, out) == (1, "") and "expected one address of this machine" in err


@pytest.mark.parametrize("host", ["127.0.0.1", "192.0.2.7"])
def test_a_telephone_is_invited_by_a_picture_of_the_address_and_told_what_it_opens(
    host: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def code(page: str, **_: Any) -> SimpleNamespace:
        return SimpleNamespace(terminal=lambda out, **_: out.write(f"[{page}]\n"))

    pad = SimpleNamespace(to="127.0.0.1:9000", name="armrest")
    monkeypatch.setitem(sys.modules, "segno", SimpleNamespace(make=code))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    invite(cast("PadServer", SimpleNamespace(address=Address(host, 9110), page="http://x/#secret", pad=pad)))
    said = capsys.readouterr().err
    assert ("[http://x/#secret]" in said) == ("--allow does not keep them out" in said) == (host != "127.0.0.1")
    assert ("on this machine" in said) == (host == "127.0.0.1")


# In a real browser, with the shipped model


# The name that the page shows while a contact goes on: a guess, or that there will be no answer.
SHOWN = (
    "['guess', 'unknown'].includes(at('name').className) && at('name').textContent !== '…' && at('name').textContent"
)


class Hand:
    """Fingers on the pad of a page that is open; a person who was not understood tries again."""

    def __init__(self, browser: Browser) -> None:
        self.browser = browser

    def touch(self, kind: str, places: list[tuple[float, float]]) -> None:
        left, top, width, height = self.box()
        finger = {"radiusX": 11, "radiusY": 11, "force": 0.5}
        ways = enumerate((left + x * width, top + (1 - y) * height) for x, y in places)
        points = [{"id": n, "x": x, "y": y} | finger for n, (x, y) in ways]
        self.browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def draw(self, ways: list[Way], seconds: float) -> None:
        begun = time.monotonic()
        self.touch("touchStart", [way(0.0) for way in ways])
        while (share := (time.monotonic() - begun) / seconds) < 1.0:
            self.touch("touchMove", [way(share) for way in ways])
        self.touch("touchEnd", [])

    def mouse(self, way: Way, seconds: float) -> None:
        left, top, width, height = self.box()
        begun, share = time.monotonic(), 0.0
        while share < 1.0:
            x, y = way(share)
            what = {"x": left + x * width, "y": top + (1 - y) * height, "button": "left", "buttons": 1}
            kind = "mouseMoved" if share else "mousePressed"
            self.browser.call("Input.dispatchMouseEvent", type=kind, clickCount=1, **what)
            share = (time.monotonic() - begun) / seconds

    def let_go(self) -> None:
        self.browser.call("Input.dispatchMouseEvent", type="mouseReleased", x=9, y=9, button="left", clickCount=1)

    def box(self) -> tuple[float, float, float, float]:
        return self.browser.run("(b => [b.left, b.top, b.width, b.height])(pad.getBoundingClientRect())")

    def perform(self, gesture: str) -> None:
        for _ in range(4):
            self.browser.run("document.getElementById('said').replaceChildren()")
            for strokes in PERFORMED[gesture]:
                self.draw(*strokes)
                time.sleep(BETWEEN_TAPS_S)  # a person's, between two taps
            said = self.browser.until("document.getElementById('said').lastChild?.textContent")
            if said.startswith(f"{gesture.replace('_', ' ')}, "):
                return
        raise AssertionError(f"{gesture}: {self.browser.run('document.body.innerText')}")


@pytest.mark.e2e
def test_a_telephone_draws_a_swipe_a_double_tap_and_two_fingers_and_a_mouse_a_circle(start, browser: Browser) -> None:
    process = start("pad", "--listen", "127.0.0.1:0")
    browser.size(400, 800)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=10)
    browser.call("Page.navigate", url=process.stdout.readline().decode().strip())
    browser.until("typeof state === 'object' && state.drawn > 30")  # a second in which the idle sensor was learned
    assert browser.run("location.hash") == ""
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")
    hand = Hand(browser)
    for gesture in ("swipe_right", "double_tap", "swipe_up_two_fingers"):
        hand.perform(gesture)
    place = hand.box()
    browser.run("name({ type: 'onset' })")  # the last gesture's name took two lines; what a touch begins with takes one
    assert hand.box() == place, "the pad moved under the finger"
    for _ in range(4):  # a circle that a mouse draws has its name before the button is let go
        hand.mouse(circle(1), 1.2)
        named = browser.until(SHOWN)
        hand.let_go()
        if named == "circle clockwise":
            break
    assert named == "circle clockwise"
    assert browser.complaints() == []
