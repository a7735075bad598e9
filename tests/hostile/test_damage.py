"""Whatever is wrong with the way or the sensor: nobody makes no gesture, each onset ends, what comes after counts."""

from typing import Any

import pytest

from experiments import damage
from gestured.model.shipped import shipped
from gestured.simulator import Take
from tests.hostile.faults import FAULTS, Fault
from tests.hostile.grammar import violations

pytestmark = pytest.mark.skipif(not shipped()["cnn_lstm"].exists(), reason="models/cnn_lstm.onnx is not here")
SECONDS = 40.0
HEALED_S = 16.0  # the fault ends
# From here on everything is as if it had never been: what is held for 5 s is given up, 1 s more is learned.
AGAIN_S = 26.0


@pytest.fixture(scope="module")
def bench() -> damage.Bench:
    return damage.Bench("cnn_lstm")


@pytest.fixture(scope="module")
def somebody() -> Take:
    return damage.take(damage.FIRST, SECONDS)


@pytest.fixture(scope="module")
def nobody() -> Take:
    return damage.take(damage.FIRST, SECONDS, touched=False)


@pytest.mark.parametrize("name", FAULTS)
def test_nobody_makes_no_gesture(bench: damage.Bench, nobody: Take, name: str) -> None:
    damaged = damage.damage(FAULTS[name], nobody, 1)
    lines = bench.events(damaged.arrivals, damaged.stalls)
    assert [line for line in lines if line["type"] == "gesture"] == []
    assert violations(lines) == []


def gestures(lines: list[dict[str, Any]], after: float) -> list[tuple[str, float]]:
    return [(line["gesture"], line["onset"]) for line in lines if line["type"] == "gesture" and line["onset"] > after]


@pytest.fixture(scope="module")
def good(somebody: Take) -> list[tuple[float, bytes]]:
    """What arrives without a fault."""
    return damage.damage(Fault(), somebody, 1).arrivals


@pytest.fixture(scope="module")
def expected(bench: damage.Bench, good: list[tuple[float, bytes]]) -> list[str]:
    """What is said late in a session without a fault."""
    found = gestures(bench.events(good), AGAIN_S)
    assert len(found) >= 4
    return [label for label, _ in found]


@pytest.mark.parametrize("name", FAULTS)
def test_what_comes_after_the_fault_counts(
    bench: damage.Bench, somebody: Take, good: list[tuple[float, bytes]], expected: list[str], name: str
) -> None:
    damaged = damage.damage(FAULTS[name], somebody, 1)
    bad = [arrival for arrival in damaged.arrivals if arrival[0] < HEALED_S]
    stalls = [stall for stall in damaged.stalls if stall[1] < HEALED_S]
    healed = bench.events(bad + [arrival for arrival in good if arrival[0] >= HEALED_S], stalls)
    assert [label for label, _ in gestures(healed, AGAIN_S)] == expected
    assert violations(healed) == []


def test_a_stall_of_the_daemon_changes_no_event(
    bench: damage.Bench, somebody: Take, good: list[tuple[float, bytes]]
) -> None:
    """Whenever it stands still: what the kernel's buffer held counts as if it had been read at once."""
    healthy = bench.events(good)
    for seed in range(3):
        damaged = damage.damage(FAULTS["the daemon stalls for 1 s"], somebody, seed)
        assert len(damaged.struck) > 40
        assert bench.events(damaged.arrivals, damaged.stalls) == healthy
