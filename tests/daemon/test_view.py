"""The control verb `view`: one sensor as it is felt now."""

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gestured.client.control import Control
from gestured.client.lines import Refused
from gestured.daemon import operations, views
from gestured.daemon.asked import open_all
from gestured.daemon.bound import bind_all
from gestured.daemon.metrics import Metrics
from gestured.daemon.service import Service
from tests.daemon.harness import Daemon, Hand, Sensor
from tests.daemon.parts import SNAPSHOT, Parts, settings_of


def test_a_sensor_is_shown_as_it_is_felt(shared: Daemon) -> None:
    sensor = Sensor(shared, "seen").begin()
    frame = sensor.hand.frame(6.0, 2.0)
    with Control(Path(shared.ready["control"])) as control:
        sensor.send([frame, frame])
        while (found := control.ask("view", sensor="seen", raw=True))["phase"] != "CONTACT":
            pass
        again = control.ask("view", sensor="seen")
        with pytest.raises(Refused, match="no sensor 'nobody', expected one of .*seen"):
            control.ask("view", sensor="nobody")
        with pytest.raises(Refused, match="view.raw: expected true or false"):
            control.ask("view", sensor="seen", raw=1)
    assert found["raw"] == frame.ravel().tolist() and again["raw"] is None and found["grid"] == [9, 9]
    values = np.array(found["values"]).reshape(9, 9)
    assert np.abs(values - (frame - 20)).max() < 3 and values.argmax() == 6 * 9 + 2
    assert found["activity"] > found["on"] > found["off"] > 0 and found["bad"] == []
    assert found["centroid"] == pytest.approx([6.0, 2.0], abs=0.2)
    sensor.perform()
    shared.client().close()


def test_it_is_made_at_most_thirty_times_a_second_and_only_when_somebody_asks(model, monkeypatch) -> None:
    parts = Parts(model)
    made: list[str] = []
    view = parts.hub.view

    def counted(sensor: str, now: float, *, raw: bool):
        made.append(sensor)
        return view(sensor, now, raw=raw)

    monkeypatch.setattr(parts.hub, "view", counted)
    clock: Any = SimpleNamespace(now=100.0, monotonic=lambda: clock.now, time=lambda: 1.7e9 + clock.now)
    monkeypatch.setattr(views, "time", clock)
    verbs = operations.Operations(
        parts.hub, parts.desk, None, parts.taps, None, parts.views, lambda: SNAPSHOT, dict, None
    ).verbs()
    parts.feed("arm", Hand().idle(2.0), 90.0)
    assert made == []
    for _ in range(300):  # three viewers, a second
        asyncio.run(verbs["view"].run(None, sensor="arm"))
        clock.now += 1 / 300
    assert 20 < len(made) <= 31


def test_who_follows_is_shown_each_sensor_as_it_is_and_then_each_frame(shared: Daemon) -> None:
    path = Path(shared.ready["control"])
    sensor = Sensor(shared, "followed").begin()
    with Control(path) as control, Control(path) as other:
        while "followed" not in control.ask("status")["sensors"]:
            pass
        assert control.ask("follow", sensors=["followed", "later"])["sensors"] == ["followed", "later"]
        views = (line for line in control.lines() if line["type"] == "view")
        newest = next(views)["t"]
        for n in range(9):
            sensor.send([sensor.hand.frame(4.0, n)])
            while (found := next(views))["t"] <= newest:
                pass
            newest = found["t"]
            assert (found["sensor"], found["raw"]) == ("followed", None)
            assert np.array(found["values"]).reshape(9, 9)[4].argmax() == n
        Sensor(shared, "later").begin()
        while next(views)["sensor"] != "later":
            pass
        for wrong in (["no name!"], [1], [["followed"]], [None], "followed"):
            with pytest.raises(Refused, match="follow.sensors: expected a list of sensors' names"):
                other.ask("follow", sensors=wrong)
        other.ask("follow", sensors=[])
        with pytest.raises(Refused, match="a tap already, or another stream"):
            other.ask("tap")
    sensor.send(sensor.hand.idle(1.0))


def test_who_follows_hears_the_state_and_every_event_once(shared: Daemon) -> None:
    path = Path(shared.ready["control"])
    sensors = [Sensor(shared, name).begin() for name in ("looked", "elsewhere")]
    with Control(path) as control, Control(path) as other:
        control.ask("follow", sensors=["looked"])
        lines = control.lines()
        state = next(line for line in lines if line["type"] == "state")
        asked = other.ask("status")
        assert state.keys() - {"type"} == asked.keys() - {"ok"}
        assert (state["instance"], state["version"]) == (asked["instance"], asked["version"])
        for sensor in sensors:
            sensor.perform("left")
        other.ask("emit", gesture="swipe_up", sensor="made_up")
        events: list[dict[str, Any]] = []
        while [event["type"] for event in events].count("release") < 3:
            events += [line for line in [next(lines)] if line["type"] not in ("state", "view")]
    told = {name: [event for event in events if event["sensor"] == name] for name in ("looked", "elsewhere", "made_up")}
    for name in ("looked", "elsewhere"):
        assert [event["type"] for event in told[name]] == ["onset", "gesture", "release"]
        assert not any("test" in event for event in told[name])
    assert all(event["test"] is True for event in told["made_up"])


def test_who_ends_following_has_heard_all_that_was_published(shared: Daemon) -> None:
    sensor = Sensor(shared, "followed_to_the_end").begin()
    client = shared.client().subscribe("gesture", sensors=[sensor.name])
    with Control(Path(shared.ready["control"])) as control:
        control.ask("follow", sensors=[])
        sensor.perform("left")
        client.events("gesture", sensor.name)
        control.finish()
        heard = [line["type"] for line in control.lines() if line.get("sensor") == sensor.name]
    assert heard[:2] == ["onset", "gesture"]


def test_a_daemon_that_ends_asks_for_no_state_any_more(model, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A view that is due tells of the daemon's sockets, and they may be closed before its time comes."""
    settings = settings_of("--model", model, "--listen", "127.0.0.1:0", "--socket", tmp_path / "events.sock")[0]

    async def main() -> list[asyncio.TimerHandle]:
        loop, stop = asyncio.get_running_loop(), asyncio.Event()
        waiting: list[asyncio.TimerHandle] = []

        def call_later(delay: float, act: Any, *args: Any) -> asyncio.TimerHandle:
            waiting.append(asyncio.TimerHandle(loop.time() + delay, act, args, loop))
            return waiting[-1]  # its time does not come by itself

        clock = SimpleNamespace(call_later=call_later, call_soon=loop.call_soon)
        bound, metrics = bind_all(settings), Metrics()
        service = Service(open_all(settings, metrics), metrics, bound, lambda: settings)
        await service.start()
        with Control(bound.control.path) as control:
            monkeypatch.setattr(views, "asyncio", SimpleNamespace(get_running_loop=lambda: clock))
            await asyncio.to_thread(control.ask, "follow", sensors=[])
            stop.set()
            await service.serve(stop, asyncio.Event())
        bound.close()
        return waiting

    waiting = asyncio.run(main())
    assert waiting and all(handle.cancelled() for handle in waiting)


class Follower:
    """A connection whose other end reads, or does not."""

    def __init__(self) -> None:
        self.streams, self.closed, self.unread = False, False, 0
        self.seen: list[float] = []  # s, on the stream's clock

    def send(self, text: bytes, *, lines: int = 1) -> bool:
        """Take a line."""
        line = json.loads(text)
        if line["type"] == "view":
            self.seen.append(line["t"])
        return True


def test_who_does_not_read_is_shown_the_newest_when_he_does(model) -> None:
    parts = Parts(model)

    async def main() -> tuple[Follower, Follower]:
        quick, slow = Follower(), Follower()
        t = parts.feed("arm", Hand().idle(2.0), 90.0)
        for follower in (quick, slow):
            parts.views.follow(follower, ["arm"], raw=False)
        for n in range(6):
            slow.unread = views.UNREAD_BYTES + 1 if 0 < n < 5 else 0
            while len(quick.seen) == n:
                await asyncio.sleep(0)
            t = parts.feed("arm", [Hand().frame()], t)
        quick.closed = slow.closed = True
        return quick, slow

    quick, slow = asyncio.run(main())
    assert len(set(quick.seen)) == 6 and slow.seen == [quick.seen[0], quick.seen[5]]


def test_a_tap_that_goes_without_a_word_leaves_no_traceback(shared: Daemon) -> None:
    """What it had not read makes the kernel say that the connection is broken; `shared` looks at the log in the end."""
    sensor = Sensor(shared, "tapped")
    with Control(Path(shared.ready["control"])) as control:
        tap = Control(Path(shared.ready["control"]))
        tap.ask("tap")
        sensor.begin()
        while control.ask("status")["sensors"].get("tapped", {}).get("state") != "ok":
            pass
        tap.close()
        while control.ask("status")["taps"]:
            sensor.perform()
            sensor.send([sensor.hand.frame()])
    assert "the handler is closed" not in shared.stderr()
