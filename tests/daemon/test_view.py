"""The control verb `follow`: sensors as they are felt, all events, and the state of the daemon."""

import asyncio
import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gestured.client.control import Control
from gestured.client.lines import Refused
from gestured.daemon import views
from gestured.daemon.service import Service
from tests.daemon.harness import Daemon, Hand, Sensor
from tests.daemon.parts import Parts, with_service


def test_who_follows_is_shown_each_sensor_as_it_is_felt_and_then_each_frame(shared: Daemon) -> None:
    path = Path(shared.ready["control"])
    sensor = Sensor(shared, "followed").begin()
    with Control(path) as control, Control(path) as other:
        while "followed" not in control.ask("status")["sensors"]:
            pass
        asked = control.ask("follow", sensors=["followed", "later"], raw=True)
        assert asked["sensors"] == ["followed", "later"]
        views = (line for line in control.lines() if line["type"] == "view")
        newest = next(views)["t"]
        for n in range(9):
            frame = sensor.hand.frame(4.0, n)
            sensor.send([frame])
            while (found := next(views))["t"] <= newest:
                pass
            newest = found["t"]
            assert found["sensor"] == "followed" and found["raw"] == frame.ravel().tolist()
            values = np.array(found["values"]).reshape(found["grid"])
            assert np.abs(values - (frame - 20)).max() < 3 and found["bad"] == []
            assert found["phase"] == "CONTACT" and found["activity"] > found["on"] > found["off"] > 0
            assert found["centroid"] == pytest.approx([4.0, n], abs=0.6)
        Sensor(shared, "later").begin()
        while next(views)["sensor"] != "later":
            pass
        for wrong in (["no name!"], [1], [["followed"]], [None], "followed"):
            with pytest.raises(Refused, match="follow.sensors.*: expected"):
                other.ask("follow", sensors=wrong)
        with pytest.raises(Refused, match="follow.raw: expected"):
            other.ask("follow", sensors=[], raw=1)
        other.ask("follow", sensors=[])
        other.socket.sendall(b'{"verb": "tap"}\n')
        refused = next(line for line in other.lines() if "ok" in line)  # a state of its stream may come before
        assert not refused["ok"] and "a tap already, or another stream" in refused["reason"]
    sensor.send(sensor.hand.idle(1.0))


def test_it_is_made_at_most_thirty_times_a_second_once_for_all_and_only_where_somebody_looks(
    model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts, hand = Parts(model), Hand()
    made: list[str] = []
    view = parts.hub.view
    monkeypatch.setattr(parts.hub, "view", lambda name, *when, **how: made.append(name) or view(name, *when, **how))
    due: list[tuple[float, Callable[..., object], tuple[Any, ...]]] = []
    clock: Any = SimpleNamespace(now=100.0, monotonic=lambda: clock.now, time=lambda: 1.7e9 + clock.now)
    loop = SimpleNamespace(
        call_later=lambda wait, act, *what: due.append((clock.now + wait, act, what)) or SimpleNamespace(),
        call_soon=lambda act, *what: due.append((clock.now, act, what)) or SimpleNamespace(),
    )
    monkeypatch.setattr(views, "time", clock)
    monkeypatch.setattr(views, "asyncio", SimpleNamespace(get_running_loop=lambda: loop))
    t = parts.feed("arm", hand.idle(2.0), 90.0)
    assert made == [] and due == []
    followers = [Follower() for _ in range(3)]
    for follower in followers:
        parts.views.follow(follower, ["arm"], raw=False)
    for _ in range(300):  # frames in a second
        t = parts.feed("arm", [hand.frame()], t)
        clock.now += 1 / 300
        while ready := [one for one in due if one[0] <= clock.now]:
            due.remove(ready[0])
            ready[0][1](*ready[0][2])
    assert 20 < len(made) <= 31 and {len(follower.seen) for follower in followers} == {len(made)}


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
    with shared.control() as control:
        control.ask("follow", sensors=[])
        sensor.perform("left")
        client.events("gesture", sensor.name)
        control.finish()
        heard = [line["type"] for line in control.lines() if line.get("sensor") == sensor.name]
    assert heard[:2] == ["onset", "gesture"]


def test_a_daemon_that_ends_asks_for_no_state_any_more(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A view that is due tells of the daemon's sockets, and they may be closed before its time comes."""

    async def main(service: Service) -> list[asyncio.TimerHandle]:
        loop, stop = asyncio.get_running_loop(), asyncio.Event()
        waiting: list[asyncio.TimerHandle] = []

        def call_later(delay: float, act: Any, *args: Any) -> asyncio.TimerHandle:
            waiting.append(asyncio.TimerHandle(loop.time() + delay, act, args, loop))
            return waiting[-1]  # its time does not come by itself

        clock = SimpleNamespace(call_later=call_later, call_soon=loop.call_soon)
        with Control(service.parts.bound.control.path) as control:
            monkeypatch.setattr(views, "asyncio", SimpleNamespace(get_running_loop=lambda: clock))
            await asyncio.to_thread(control.ask, "follow", sensors=[])
            stop.set()
            await service.serve(stop, asyncio.Event())
        return waiting

    waiting = with_service(model, tmp_path, main)
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


async def test_who_does_not_read_is_shown_the_newest_when_he_does(model) -> None:
    parts = Parts(model)
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
    assert len(set(quick.seen)) == 6 and slow.seen == [quick.seen[0], quick.seen[5]]


def test_a_tap_that_goes_without_a_word_leaves_no_traceback(shared: Daemon) -> None:
    """What it had not read makes the kernel say that the connection is broken; `shared` looks at the log in the end."""
    sensor = Sensor(shared, "tapped")
    with shared.control() as control:
        tap = shared.control()
        tap.ask("tap")
        sensor.begin()
        while control.ask("status")["sensors"].get("tapped", {}).get("state") != "ok":
            pass
        tap.close()
        while control.ask("status")["taps"]:
            sensor.perform()
            sensor.send([sensor.hand.frame()])
    assert "the handler is closed" not in shared.stderr()
