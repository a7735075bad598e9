"""The page of `gesturectl view` in a real browser."""

import json
import re
import signal
import threading
import tomllib
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gestured.core.where import zones_of
from gestured.record.tape_reader import read
from tests.control.browser import Browser
from tests.control.conftest import LONG
from tests.control.pages import Page, viewing
from tests.daemon.harness import Daemon, Frame, Sensor

FRAME = {
    "time": 100.0, "grid": [9, 9], "centroid": None, "values": None, "phase": "IDLE", "noise": 1.0,
    "activity": 1.0, "on": 6.0, "off": 3.0, "bad": [],
}  # fmt: skip
SHOWN = "document.getElementById('state')?.textContent.startsWith('gestured ')"


# What a page writes anew if it is told the same twice, of what screen readers read aloud when it is written.
ANEW = """(kind, what) => {
    kinds[kind](what);
    const seen = new MutationObserver(() => {});
    for (const one of document.querySelectorAll('[role=status]')) seen.observe(one, { childList: true, subtree: true });
    kinds[kind](what);
    return seen.takeRecords().map(record => record.target.id);
}"""


def follow(page: Page, browser: Browser, name: str, real: Daemon) -> Sensor:
    """Open the page, and a sensor that it looks at."""
    sensor = Sensor(real, name).begin()
    browser.size(1400, 900)
    browser.call("Page.navigate", url=page.whole)
    browser.until(f"[...document.getElementById('sensor')?.options ?? []].some(one => one.value === {name!r})")
    browser.run(f"(all => {{ all.value = {name!r}; all.onchange() }})(document.getElementById('sensor'))")
    browser.until("state.frames.length && state.drawn > 0")
    return sensor


@pytest.fixture
def sensor(view: Page, browser: Browser, real: Daemon, arm: str) -> Sensor:
    """A sensor that the page in the browser looks at."""
    return follow(view, browser, arm, real)


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
def test_a_swipe_is_drawn_named_and_flagged(sensor: Sensor, browser: Browser, tmp_path: Path, width: int) -> None:
    browser.size(width, 900)
    browser.colours("dark" if width < 600 else "light")
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
    rows = "[...document.querySelectorAll('#sensors tbody tr')]"
    browser.until(
        f"{rows}.find(row => row.cells[0].textContent === {sensor.name!r})?.cells[6].textContent === '1'"
    )  # this hour
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")  # nothing sticks out
    browser.run("at('note').value = 'a test'; at('flag').click()")
    browser.run("at('flag').dispatchEvent(new MouseEvent('click', { detail: 2 }))")  # the second one of a double click
    said = browser.until("document.getElementById('done').textContent.includes('.mcap') && done.textContent")
    (kept,) = tmp_path.glob("flag-*.mcap")
    assert str(kept) in said
    tape = read(kept)
    assert any(event["type"] == "gesture" for event in tape.events) and tape.scene["note"] == "a test"
    assert browser.complaints() == []


def test_a_provisional_answer_is_shown_as_such_and_then_confirmed_or_revoked(sensor: Sensor, browser: Browser) -> None:
    browser.size(400, 900)
    hand = sensor.hand

    def said(name: str) -> str:
        return browser.run(f"document.getElementById('{name}').textContent")

    show(sensor, browser, hand.swipe("right"))
    browser.until("document.getElementById('name').textContent === 'swipe right'")
    assert browser.run("document.getElementById('name').className") == "guess"
    assert re.fullmatch(r"a guess, \d+ %, \d+ ms after it began", said("name-note"))
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
    assert browser.complaints() == []


def test_the_scale_comes_back_after_an_outlier(sensor: Sensor, browser: Browser) -> None:
    mad = sensor.hand.frame(4.0)
    mad[2, 2] = 2000.0
    show(sensor, browser, [mad, *sensor.hand.idle(0.5)])
    perform(sensor, browser, "left")
    assert browser.run("state.full") == 200


def test_an_answer_is_drawn_where_it_was_and_a_zone_is_pulled_up_with_the_mouse(
    view: Page, real: Daemon, browser: Browser
) -> None:
    sensor = follow(view, browser, "zoned", real)
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
    pulled = tomllib.loads(lines)["sensors"]["zoned"]["zones"]
    assert pulled["volume"]["at"] == pytest.approx([0.6, 0.25, 1.0, 0.9], abs=0.02)
    assert zones_of(pulled | {"left": (0, 0, 0.5, 1)})
    browser.run("navigator.clipboard.writeText = async text => { window.copied = text }")
    browser.run("document.getElementById('copy').click()")
    browser.until("document.getElementById('zone-note').textContent.startsWith('Copied')")
    assert browser.run("window.copied") == lines
    browser.run("at('zone-name').value = 'left'")
    assert pull((0.6, 0.9), (1.0, 0.25), (1.0, 0.25)) == "A zone is named left already."
    assert pull((0.3, 0.9), (0.8, 0.25), (0.8, 0.25)) == "It overlaps left: zones must share no place."
    assert browser.complaints() == []


def test_sliders_follow_a_finger(sensor: Sensor, browser: Browser) -> None:
    """One goes to the finger, the other one begins where it stands."""
    hand = sensor.hand
    at = "['absolute', 'relative'].map(id => Number(document.getElementById(id).value))"
    for begin, end in ((1, 3), (5, 6)):
        before = browser.run(at)[1]
        for column in np.linspace(begin, end, 10):
            show(sensor, browser, [hand.frame(4.0, column)])
        browser.until(f"Math.abs({at}[0] - {end / 8}) < 0.03")
        assert browser.run(at)[1] == pytest.approx(before + (end - begin) / 8, abs=0.06)
        show(sensor, browser, hand.idle(1.0))
    lost = "{ id: 1, touch: 1, phase: 'down', x: 0 }"  # and its `up`, at a broker that was away
    after = "{ id: 2, touch: 0, phase: 'down', x: 1 }"
    script = f"(to => {{ const take = slider(to); take({lost}); take({after}); return to.value }})({{}})"
    assert browser.run(script) == 1
    assert browser.complaints() == []


def test_what_lies_on_a_sensor_is_said(sensor: Sensor, browser: Browser) -> None:
    sensor.send([sensor.hand.frame(4.0 + 2 * (k % 2)) for k in range(90)])  # it moves, so that it is not learned
    browser.until("document.getElementById('name').textContent === 'something lies here'")
    assert "learned" in browser.run("document.getElementById('name-note').textContent")
    sensor.send(sensor.hand.idle(2.0))
    browser.until("document.getElementById('name').textContent === '…'")


def test_the_page_says_what_is_wrong_and_what_to_do(serve, browser: Browser) -> None:
    daemon = serve("--clock", "sensor", "--stale-s", 30)
    with viewing(daemon.ready["control"]) as page:
        browser.call("Page.navigate", url=page.whole)
        findings = "document.getElementById('findings')?.textContent ?? ''"
        browser.until(f"({findings}).includes('no sensor was heard')")
        assert "gesturectl sniff" in browser.run(findings)
        assert browser.run("document.getElementById('flag').disabled")
        assert "--flight-recorder" in browser.run("document.getElementById('done').textContent")
        again = f"kinds.sensors = told => {{ kinds.sensors = sensors; done(({ANEW})('sensors', told)) }}"
        assert browser.run(f"new Promise(done => {{ {again} }})") == []
        assert browser.run(f"({ANEW})('gone', {{ reason: 'it hangs' }})") == []
        sensor = Sensor(daemon, "arm").begin()
        swipe = sensor.hand.swipe("left")
        for _ in range(6):
            sensor.send([40.0 - frame for frame in swipe], sensor.hand.idle(1.0))
        browser.until(f"({findings}).includes('[sensors.arm] invert = true')")
        assert not browser.run("document.body.classList.contains('absent')")
        daemon.stop()
        browser.until("document.body.classList.contains('absent')")  # what is shown is of before


def test_the_sensor_that_was_looked_at_stays_when_the_daemon_starts_again(
    model: Path, tmp_path: Path, browser: Browser
) -> None:
    flags = ("--clock", "sensor", "--stale-s", 30)
    daemon = Daemon.start(tmp_path, model, *flags)
    with viewing(daemon.ready["control"]) as page:
        follow(page, browser, "constructor", daemon)  # as everything in JavaScript has one
        usable = "['recalibrate', 'gate'].every(id => !document.getElementById(id).disabled)"
        browser.until(usable)
        daemon.stop()
        browser.until("document.body.classList.contains('absent')")
        assert not browser.run(usable) and browser.run("document.getElementById('listens').textContent") == ""
        browser.until("document.getElementById('state').textContent.includes('no daemon on')")
        assert "--flight-recorder" in browser.run("document.getElementById('done').textContent")
        daemon = Daemon.start(tmp_path, model, *flags, "--flight-recorder", 1)
        try:
            Sensor(daemon, "another").begin()
            browser.until("document.getElementById('sensor').options.length === 2")
            chosen = browser.run("[document.getElementById('sensor').value, state.sensor]")
            assert chosen == ["constructor", "constructor"]
            shown = browser.run("document.getElementById('sensor').selectedOptions[0].text")
            assert shown == "constructor (not heard so far)"
            assert browser.run("document.getElementById('listens').textContent") == "not heard so far"
            assert not browser.run(usable) and browser.run("document.body.classList.contains('absent')")
            assert (
                browser.run("getComputedStyle(document.getElementById('recalibrate')).opacity") != "1"
            )  # and it shows
            before = browser.run("state.frames.length && state.frames[state.frames.length - 1].t")
            Sensor(daemon, "constructor").begin()
            browser.until(f"({usable}) && document.getElementById('listens').textContent === 'listens'")
            browser.until(f"state.frames[state.frames.length - 1].t !== {before}")
            assert browser.run("document.getElementById('sensor').selectedOptions[0].text") == "constructor"
            assert browser.run("document.getElementById('done').textContent") == ""
            assert not browser.run("document.getElementById('flag').disabled")
        finally:
            daemon.stop()
    assert not [said for said in browser.complaints() if "Exception" in said]


def test_a_program_that_hangs_is_said_and_seen_again_by_itself(start, real: Daemon, browser: Browser) -> None:
    process = start("view", "--control", real.ready["control"], "--listen", "127.0.0.1:0")
    browser.call("Page.navigate", url=process.stdout.readline().decode().strip())
    said = "document.getElementById('state')?.textContent"
    browser.until(f"{said}?.startsWith('gestured ')")
    # Its patience is SILENT_MS, which no program can change: here it is two seconds, from the next stream on.
    browser.run("later = setTimeout; setTimeout = (act, ms) => later(act, Math.min(ms, 2000)); open('')")
    for meanwhile in ("1", "open('')"):  # while it streams, and while it is asked
        process.send_signal(signal.SIGSTOP)
        try:
            browser.run(meanwhile)
            browser.until(f"{said}.includes('does not answer')")
        finally:
            process.send_signal(signal.SIGCONT)
        browser.until(f"{said}.startsWith('gestured ')")


def test_a_further_tab_says_what_it_waits_for(view: Page, browser: Browser) -> None:
    """A browser makes six connections to one server: the last one is for what its tabs ask for."""
    view.come_in()
    tabs = [view.stream() for _ in range(5)]
    browser.call("Page.navigate", url=f"http://{view.address}/")
    said = "document.getElementById('state')?.textContent"
    browser.until(f"{said}?.startsWith('This address has been used')")
    browser.run(f"sessionStorage.setItem('secret', {view.secret!r})")  # as of a tab that is duplicated
    browser.call("Page.reload")
    browser.until(f"{said}?.includes('close one')")
    tabs.pop().close()
    browser.until(f"{said}.startsWith('gestured ')")
    for tab in tabs:
        tab.close()


def test_an_address_that_is_opened_in_the_tab_of_the_last_one_opens_the_page(view: Page, browser: Browser) -> None:
    """A browser loads nothing by itself if only the fragment changes."""
    browser.call("Page.navigate", url=f"http://{view.address}/#of-a-program-that-has-ended")
    browser.until("document.getElementById('state')?.textContent.startsWith('This address has been used')")
    browser.call("Page.navigate", url=view.whole)
    browser.until(SHOWN)


def test_who_skips_to_the_answer_may_load_the_page_again(view: Page, browser: Browser) -> None:
    """The link changes the address's fragment, in which the token was."""
    browser.call("Page.navigate", url=view.whole)
    browser.until(SHOWN)
    browser.run("document.querySelector('.skip').click(); window.before = true")
    browser.until("location.hash === '#what'")
    assert browser.run("window.before")
    browser.call("Page.reload")
    browser.until(f"!window.before && {SHOWN}")


@pytest.mark.parametrize("then", [{"grid": [4, 4]}, {"time": 50.0}], ids=["another grid", "a clock set back"])
def test_frames_of_another_grid_or_of_the_future_are_not_of_the_same_picture(
    view: Page, browser: Browser, then: dict[str, object]
) -> None:
    browser.call("Page.navigate", url=view.whole)
    browser.until("typeof frame === 'function' && state.stream !== null")
    frames = [FRAME, FRAME | {"time": 101.0}, FRAME | {"time": 102.0} | then]
    kept = browser.run(f"state.frames = []; {json.dumps(frames)}.map(f => frame(f) ?? state.frames.length)")
    assert kept == [1, 2, 1]
    browser.run("new Promise(requestAnimationFrame)")
    assert browser.complaints() == []


def test_an_idle_matrix_is_seen_and_the_legend_is_of_what_is_drawn(view: Page, browser: Browser) -> None:
    browser.colours("light")
    browser.call("Page.navigate", url=view.whole)
    browser.until("typeof frame === 'function' && state.stream !== null")
    shown = FRAME | {"values": [0] * 81, "raw": [300] * 81, "raw_grid": [9, 9]}
    legend = "document.getElementById('legend').textContent"
    browser.run(f"state.stream.abort(); state.frames = []; frame({json.dumps(shown)})")
    browser.until(f"{legend} === '020 counts'")
    drawn = "[...at('matrix').getContext('2d').getImageData(0, 9, at('matrix').width, 1).data]"
    lines = f"{drawn}.filter((_, n, all) => n % 4 === 0 && all[n + 3] === 255 && all[n] < 235)"
    assert len(browser.run(lines)) >= 9  # darker than the taxels, which are as light as the page
    browser.run("at('raw').checked = true; plan()")
    browser.until(f"{legend} === '300320 counts'")
    fractions = FRAME | {"values": [0.3127, *[0.0] * 80], "noise": 0.003, "centroid": [0, 0]}
    browser.run(f"at('raw').checked = false; state.frames = []; frame({json.dumps(fractions)})")
    browser.until(f"{legend} === '00.5 counts'")
    assert "strongest 0.31 counts" in browser.run("document.getElementById('matrix').getAttribute('aria-label')")


def test_of_many_sensors_the_table_is_scrolled_and_the_chosen_one_is_shown_after_a_reload(
    view: Page, real: Daemon, browser: Browser, arm: str
) -> None:
    Sensor(real, f"{arm}-first").begin()
    follow(view, browser, arm, real)
    more = "told => sensors({ ...told, sensors: { ...told.sensors, ...[...Array(40)].map(() => told.sensors[arm]) } })"
    browser.run(f"arm = {arm!r}; kinds.sensors = {more}")
    browser.until("document.querySelectorAll('#sensors tbody tr').length > 40")
    assert browser.run("document.querySelector('.scroll').clientHeight") < 400
    browser.size(1280, 900)
    assert browser.run("(e => e.scrollWidth === e.clientWidth)(document.querySelector('.scroll'))")  # all columns
    browser.call("Page.reload")
    browser.until(f"typeof state === 'object' && state.sensor === {arm!r} && state.drawn > 0")
    assert browser.run("document.getElementById('sensor').value") == arm
    assert browser.complaints() == []


def test_a_picture_is_frozen_for_as_long_as_one_pauses(view: Page, browser: Browser) -> None:
    """However many frames come meanwhile; they are kept for a while before and after it, in a bounded number."""
    browser.call("Page.navigate", url=view.whole)
    browser.until("typeof frame === 'function' && state.stream !== null")
    came = f"(...times) => times.forEach(time => frame({{ ...{json.dumps(FRAME)}, time }}))"
    browser.run(f"state.stream.abort(); state.frames = []; came = {came}")
    browser.run("came(100, 101); pause(true); came(102, 140, 160)")
    assert browser.run("state.frames[shown()].time") == 101
    assert browser.run("state.frames.map(f => f.time)") == [100, 101, 102]
    browser.run("new Promise(requestAnimationFrame).then(() => plan()).then(() => new Promise(requestAnimationFrame))")
    assert browser.run("document.getElementById('ago').textContent") == "59.00 s ago"
    browser.run("at('pause').click(); came(161)")
    assert browser.run("state.frames.map(f => f.time)") == [161]
    browser.run("pause(true); open('another'); came(300)")  # nothing is left of what was frozen
    assert not browser.run("state.paused")
    assert browser.complaints() == []


def test_recalibrate_asks_before(sensor: Sensor, browser: Browser) -> None:
    for answer in ("false", "true"):
        assert browser.run("document.getElementById('done').textContent") == ""
        browser.run(f"window.confirm = question => {{ window.asked = question; return {answer} }}")
        browser.run("document.getElementById('recalibrate').click()")
        assert f"Learn the idle sensor {sensor.name} anew?" in browser.run("window.asked")
    browser.until("document.getElementById('done').textContent.includes('learning')")


def test_pause_step_back_and_keys(sensor: Sensor, browser: Browser) -> None:
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
    for focus, name, code in (("when", " ", "Space"), ("pause", "ArrowLeft", "ArrowLeft")):  # after a click on it
        browser.run(f"pause(true); document.getElementById('{focus}').focus()")
        before = browser.run("[state.paused, state.moment].join()")
        key(name, code)
        assert browser.run("[state.paused, state.moment].join()") != before
    browser.run("pause(true); document.querySelector('.scroll').focus()")
    before = browser.run("[state.paused, state.moment].join()")
    key("ArrowLeft", "ArrowLeft")  # scrolls the table
    browser.run("document.getElementById('note').focus()")
    key("c", "KeyC")
    assert browser.run("[state.paused, state.moment].join()") == before
    assert browser.run("document.getElementById('note').value") == "c"
    browser.run("document.getElementById('note').blur()")
    key("m", "KeyM")
    sensor.send([sensor.hand.frame()])
    browser.until("document.getElementById('raw').checked && state.frames.some(f => f.raw)")
    assert browser.complaints() == []


def test_a_picture_that_stands_still_follows_the_colours_of_the_page(sensor: Sensor, browser: Browser) -> None:
    browser.colours("light")
    browser.run("colours(); pause(true)")
    drawn = "[...at('matrix').getContext('2d').getImageData(2, 2, 1, 1).data].slice(0, 3)"
    browser.until(f"!state.dirty && {drawn}.every(part => part > 200)")
    browser.colours("dark")
    browser.until(f"{drawn}.every(part => part < 100)")


def test_a_switch_silences_a_sensor_after_a_question(sensor: Sensor, real: Daemon, browser: Browser) -> None:

    def says(word: str, hears: bool) -> None:
        browser.until(f"document.getElementById('listens').textContent === {word!r}")
        assert browser.run("document.getElementById('gate').getAttribute('aria-checked')") == str(hears).lower()

    says("listens", True)
    for answer, word in ((False, "listens"), (True, "silent, gates closed: view")):
        browser.run(f"window.confirm = question => {{ window.asked = question; return {str(answer).lower()} }}")
        browser.run("document.getElementById('gate').click()")
        assert browser.run("window.asked") == (
            f'Silence {sensor.name}? No program hears a gesture of it until its gate "view" is opened.'
        )
        says(word, not answer)
    perform(sensor, browser, "left")
    browser.until("document.getElementById('name-note').textContent.startsWith('inhibited view,')")
    real.ask("inhibit", sensor=sensor.name, gate="door")
    says("silent, gates closed: door, view", False)
    browser.run("document.getElementById('gate').click()")
    says("silent, gates closed: door", True)
    browser.until(f"document.getElementById('done').textContent === 'silent: {sensor.name} (door)'")
    assert browser.complaints() == []


def test_everything_has_a_name_for_who_does_not_see_it(sensor: Sensor, browser: Browser) -> None:
    perform(sensor, browser, "left")
    asked = {"button", "checkbox", "combobox", "slider", "textbox", "image", "region"}
    seen = set()
    for node in browser.call("Accessibility.getFullAXTree")["nodes"]:
        role = node.get("role", {}).get("value", "").lower()
        if role in asked | {"table", "meter", "group", "link"} and not node.get("ignored"):
            assert node.get("name", {}).get("value"), node
            seen.add(role)
    assert asked <= seen
    assert browser.run("document.querySelectorAll('[aria-live=polite]').length") == 1


def test_a_page_on_another_port_of_this_machine_gets_nothing(sensor: Sensor, view: Page, browser: Browser) -> None:
    """A neighbour serves it, and the owner's browser is led there after it has looked."""
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
            fetch('http://{view.address}/stream', {{credentials}}).then(r => r.text(), () => 'refused'),
            fetch('http://{view.address}/recalibrate', {{credentials, method: 'POST', body: '{{}}',
              headers: {{'X-Gestured-Token': 'x'}}}}).then(r => r.text(), () => 'refused')]))"""
        assert browser.run(tried) == ["refused"] * 4
        neighbour.shutdown()
    assert heard and not any(secret in what or "Cookie" in what for what in heard)
    browser.call("Page.navigate", url=f"http://{view.address}/")
    browser.until("document.getElementById('sensor')?.options.length")  # the tab has kept its secret


def test_the_longest_names_stick_out_of_no_telephone(view: Page, real: Daemon, browser: Browser) -> None:
    gate, zone = "g" * 64, "z" * 64
    sensor = follow(view, browser, LONG, real)
    browser.size(400, 900)
    real.ask("inhibit", sensor=LONG, gate=gate)
    perform(sensor, browser, "left")
    browser.until(f"document.getElementById('name-note').textContent.includes('{gate}')")
    browser.until(f"document.getElementById('listens').textContent.includes('{gate}')")
    browser.run(f"at('zone-name').value = '{zone}'; over.pulled = [0, 0, 0.5, 0.5]; tellZone()")
    wide = "e => e.getBoundingClientRect().right > 400 && !e.closest('.scroll')"
    assert browser.run(f"[...document.querySelectorAll('body *')].filter({wide}).map(e => e.id)") == []
    assert browser.run("document.documentElement.scrollWidth") <= 400
    event = "document.querySelector('#events tbody td:nth-child(3)').getBoundingClientRect().left"
    assert browser.run(event) < 400  # the table need not be moved to see what it was


def test_a_name_is_never_markup(fake_control, browser: Browser) -> None:
    evil = "<img src=x onerror=document.title='owned'>"
    with viewing(fake_control(evil)) as page:
        browser.call("Page.navigate", url=page.whole)
        browser.until("document.querySelectorAll('#sensors tbody tr').length === 1")
        assert browser.run("document.querySelector('#sensors td').textContent") == evil
        assert browser.run("document.querySelectorAll('img').length") == 0
        assert browser.run("document.title") != "owned"
