"""Gates of a real daemon: `gesturectl inhibit` and `allow`, and what everybody is told of them."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gestured.client.lines import Refused
from gestured.core.listening import MOST_GATES
from tests.daemon.harness import Daemon, Sensor

Ctl = Callable[..., tuple[int, str, str]]
DOCUMENT = (Path(__file__).resolve().parents[2] / "docs" / "arming.md").read_text()


@pytest.fixture(autouse=True)
def _open(daemon: Daemon) -> Any:
    """No test leaves a gate closed."""
    yield
    status = daemon.ask("status")
    for gate in {*status["gates"], *(gate for sensor in status["sensors"].values() for gate in sensor["closed"])}:
        daemon.ask("allow", gate=gate)


def closed(daemon: Daemon) -> dict[str, list[str]]:
    return {name: sensor["closed"] for name, sensor in daemon.ask("status")["sensors"].items() if sensor["closed"]}


def test_a_gate_is_closed_and_opened_while_the_daemon_runs(ctl: Ctl, daemon: Daemon) -> None:
    client = daemon.client().subscribe("gesture", "unknown", "gate", sensors=["armrest"])
    armrest = Sensor(daemon, "armrest").begin().perform("left")
    assert client.line()["gesture"] == "swipe_left"
    (block,) = re.findall(r"test_gates.py.*\n```sh\n((?:gesturectl .*\n)*)```", DOCUMENT)
    for line, expected in zip(block.splitlines(), (["door"], ["cleaning", "door"], ["cleaning"]), strict=True):
        status, out, err = ctl(*line.partition("#")[0].split()[1:])
        told = client.line()
        assert status == 0 and f"armrest ({', '.join(expected)})" in out, err
        assert (told["type"], told["armed"], told["closed"]) == ("gate", None, expected)
    assert told["until"] - told["since"] == pytest.approx(600, abs=5)
    greeted = daemon.client().hello["gates"]["armrest"]
    assert greeted == {"armed": None, "closed": ["cleaning"], "until": pytest.approx(told["until"], abs=1e-3)}
    armrest.perform("up")
    unknown = client.line()
    assert (unknown["type"], unknown["reason"], unknown["gates"]) == ("unknown", "inhibited", ["cleaning"])
    assert "silent, gates closed: cleaning" in ctl("status")[1] and "1 while silent" in ctl("status")[1]
    assert "gesturectl allow armrest --gate cleaning" in ctl("doctor")[1]
    assert ctl("reload")[0] == 0 and closed(daemon)["armrest"] == ["cleaning"]
    assert "no gate closed: armrest" in ctl("allow", "armrest", "--gate", "cleaning")[1]
    armrest.perform("down")
    assert [client.line()["closed"], client.line()["gesture"]] == [[], "swipe_down"]


@pytest.mark.parametrize(
    ("sensor", "gate", "words"),
    [
        ("elbow", "door", "no sensor 'elbow', expected one of "),
        (None, "a/b", "inhibit.gate: expected a gate's name, 1 to 64 of A-Z a-z 0-9 _ -"),
        ("a/b", "door", "inhibit.sensor: expected a sensor's name"),
    ],
)
def test_what_cannot_be_is_one_sentence(daemon: Daemon, sensor: str | None, gate: str, words: str) -> None:
    with pytest.raises(Refused, match=words):
        daemon.ask("inhibit", gate=gate, sensor=sensor)
    assert "door" not in daemon.ask("status")["gates"]


def test_there_are_so_many_gates_at_most(daemon: Daemon) -> None:
    for n in range(MOST_GATES):
        daemon.ask("inhibit", gate=f"gate{n}")
    daemon.ask("inhibit", gate="gate0", seconds=60)  # it is closed already
    with pytest.raises(Refused, match="16 gates are closed already"):
        daemon.ask("inhibit", gate="one-more")
    assert len(daemon.ask("status")["gates"]) == MOST_GATES


def test_who_is_silent_is_enrolled_nothing(ctl: Ctl, daemon: Daemon) -> None:
    Sensor(daemon, "leg").begin()
    while "leg" not in daemon.ask("status")["sensors"]:
        pass
    ctl("inhibit", "leg", "--gate", "door")
    status, _, err = ctl("enrol", "knock", "--sensor", "leg")
    assert status == 1 and "leg is silent, since gates are closed: door; allow them first" in err
