"""The bridges' own socket of a real daemon: each closes and opens gates in its own name, and can do nothing else."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from gestured.client.control import Control
from gestured.client.lines import Refused
from gestured.core.hub import Hub
from gestured.core.scene import Scene, Setup
from gestured.daemon import gatekeeper
from gestured.daemon.gatekeeper import Gatekeeper
from tests.core.test_hub import GESTURES, Sure
from tests.daemon.harness import Daemon, Sensor, running


@pytest.fixture(scope="module")
def lasting(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    folder = tmp_path_factory.mktemp("gates")
    config = folder / "gestured.toml"
    config.write_text(f'[sensors.armrest]\n[gates]\nstart = ["seat"]\nsocket = "{folder}/gates.sock"\n')
    with running(folder, model, "--config", config, "--stale-s", 30) as daemon:
        yield daemon


@pytest.fixture
def daemon(lasting: Daemon) -> Iterator[Daemon]:
    """A daemon whose gate "seat" alone is closed."""
    yield lasting
    for gate in lasting.ask("status")["gates"]:
        lasting.ask("allow", gate=gate)
    lasting.ask("inhibit", gate="seat")


@pytest.fixture
def bridge(daemon: Daemon) -> Iterator[Control]:
    with Control(Path(daemon.ready["gates"])) as control:
        yield control


def test_a_bridge_closes_its_own_gate_and_it_stays_closed_when_the_bridge_is_gone(daemon: Daemon) -> None:
    client = daemon.client().subscribe("gesture", "gate")
    assert client.hello["gates"] == {"armrest": {"armed": None, "closed": ["seat"], "until": None}}
    sensor = Sensor(daemon, "armrest").begin()
    assert client.line()["closed"] == ["seat"]
    with Control(Path(daemon.ready["gates"])) as bridge:
        bridge.ask("inhibit", bridge="car", gate="car-door", seconds=0.01)
        assert client.line()["closed"] == ["car-door", "seat"]
        bridge.ask("inhibit", bridge="car", gate="car-door", seconds=0.01)  # nothing has changed, and nothing is told
        bridge.ask("inhibit", bridge="seat", gate="seat", seconds=60)
        assert bridge.ask("allow", bridge="seat", gate="seat")["sensors"] == {"armrest": ["car-door"]}
        assert client.line()["closed"] == ["car-door"]
    sensor.perform("left", "up")
    while not (late := daemon.ask("status")["overdue"]):
        pass
    assert list(late) == ["car-door"] and daemon.ask("status")["sensors"]["armrest"]["closed"] == ["car-door"]
    daemon.ask("allow", gate="car-door")
    assert daemon.ask("status")["overdue"] == {}
    sensor.perform("down")
    told = [client.line(), client.line()]
    assert told[0]["closed"] == [] and told[1]["gesture"] == "swipe_down", "nothing was said in between"
    assert "a bridge has changed what is closed" in daemon.stderr()


async def test_who_closes_a_gate_of_one_sensor_looks_at_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bus may close that of a thousand sensors, one by one."""
    hub = Hub(Scene(GESTURES, (9, 9), {"arm": Setup(), "seat": Setup()}), Sure())
    monkeypatch.setattr(hub, "readings", None)
    keeper = Gatekeeper(hub, SimpleNamespace(take=list))  # type: ignore[arg-type]
    reply = await keeper.keep_closed(None, "car", "car", 30.0, "arm")  # type: ignore[arg-type]
    assert reply == {"gate": "car", "sensors": {"arm": ["car"]}} and hub.gates.of("seat") == {}


async def test_only_what_is_closed_still_is_overdue_since_its_first_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    hub = Hub(Scene(GESTURES, (9, 9), {"arm": Setup(), "seat": Setup()}), Sure())
    keeper = Gatekeeper(hub, SimpleNamespace(take=list))  # type: ignore[arg-type]
    monkeypatch.setattr(gatekeeper, "time", SimpleNamespace(monotonic=lambda: 100.0))
    for sensor, seconds in (("arm", 1.0), ("seat", 20.0)):
        await keeper.keep_closed(None, "car", "car", seconds, sensor)  # type: ignore[arg-type]
    assert keeper.overdue(150.0) == {"car": 49.0}
    await keeper.inhibit(None, "car", None, 10.0)  # type: ignore[arg-type]  # an operator: for ten seconds
    hub.tick(111.0)
    assert hub.gates.named == set() and keeper.overdue(150.0) == {}


def test_bridges_cannot_use_up_the_gates_of_an_operator(daemon: Daemon, bridge: Control) -> None:
    for k in range(8):
        bridge.ask("inhibit", bridge="car", gate=f"car-{k}", seconds=60)
    with pytest.raises(Refused, match="bridges have closed 8 gates already, the most that they can; allow one first"):
        bridge.ask("inhibit", bridge="car", gate="car-8", seconds=60)
    bridge.ask("inhibit", bridge="car", gate="car-7", seconds=60)
    assert "door" in daemon.ask("inhibit", gate="door")["sensors"]["armrest"]
    bridge.ask("allow", bridge="car", gate="car-0")
    bridge.ask("inhibit", bridge="car", gate="car-8", seconds=60)


async def test_what_has_opened_by_itself_is_no_gate_that_a_bridge_keeps_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    hub = Hub(Scene(GESTURES, (9, 9), {"arm": Setup()}), Sure())
    keeper = Gatekeeper(hub, SimpleNamespace(take=list))  # type: ignore[arg-type]
    monkeypatch.setattr(gatekeeper, "time", SimpleNamespace(monotonic=lambda: 100.0))
    for k in range(2 * gatekeeper.BRIDGES_GATES):
        await keeper.keep_closed(None, "car", f"car-{k}", 30.0, "arm")  # type: ignore[arg-type]
        await keeper.inhibit(None, f"car-{k}", None, 1.0)  # type: ignore[arg-type]  # an operator
        hub.tick(102.0)


def test_it_knows_inhibit_and_allow_alone_and_refuses_what_is_not_its_own(bridge: Control) -> None:
    for verb in ("status", "reload", "recalibrate", "emit", "enrol", "forget", "tap"):
        with pytest.raises(Refused, match=f'unknown "{verb}", expected one of inhibit, allow$'):
            bridge.ask(verb)

    for request, words in (
        ({"gate": "seat"}, "gate 'seat' is not car's own, expected car, or car- and more"),
        ({"gate": "cargo"}, "gate 'cargo' is not car's own"),
        ({"gate": "car", "sensor": "elbow"}, "no sensor 'elbow', expected one of armrest"),
        ({"gate": "car", "seconds": None}, "inhibit.seconds: expected a number, found null"),
    ):
        with pytest.raises(Refused) as refused:
            bridge.ask("inhibit", **{"bridge": "car", "seconds": 60} | request)
        assert words in str(refused.value)
