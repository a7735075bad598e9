"""Rations: who is held back, when, and until when."""

import pytest

from gestured.daemon.rations import BURST_BYTES, FLOOD_S, RATE_BYTES, Datagram, Rations

FLOOD, QUIET = ("10.0.0.1", 1), ("10.0.0.2", 2)
PACKET = bytes(1000)
MUCH: list[Datagram] = [(PACKET, FLOOD)] * 255 + [(PACKET, QUIET)]


@pytest.fixture
def flooded() -> Rations:
    """After a second in which every read left something behind."""
    rations = Rations()
    for n in range(10):
        assert rations.share(MUCH, True, n * FLOOD_S / 10) == MUCH  # a backlog is no flood yet
    rations.share(MUCH, True, FLOOD_S)
    return rations


def of(source: tuple[str, int], packets: list[Datagram]) -> int:
    return sum(sender == source for _, sender in packets)


def test_a_flood_is_held_to_its_ration_and_the_other_loses_nothing(flooded: Rations) -> None:
    served = {FLOOD: 0, QUIET: 0}
    for n in range(100):
        now = FLOOD_S + 0.1 + n / 100
        found = flooded.share(MUCH, n % 2 == 0, now)
        for source in served:
            served[source] += of(source, found)
    assert served[QUIET] == 100
    assert 0.9 * RATE_BYTES <= 1000 * served[FLOOD] <= RATE_BYTES + BURST_BYTES + 100 * 1000


def test_it_ends_when_the_flood_has_ended(flooded: Rations) -> None:
    assert len(flooded.share(MUCH, False, FLOOD_S + 0.2)) < len(MUCH)
    little = [(PACKET, FLOOD)]
    for n in range(15):
        assert flooded.share(little, False, FLOOD_S + 0.3 + n / 10) == little
    assert flooded.share(MUCH, True, 3 * FLOOD_S) == MUCH


def test_a_backlog_that_is_worked_off_is_no_flood() -> None:
    rations = Rations()
    for n in range(100):
        assert rations.share(MUCH, n % 9 != 8, n / 10) == MUCH


def test_who_is_alone_is_never_held_back() -> None:
    alone = [(PACKET, FLOOD)] * 256
    rations = Rations()
    assert all(rations.share(alone, True, n / 10) == alone for n in range(100))


def test_more_sources_than_are_told_apart_share_a_ration() -> None:
    rations = Rations()
    crowd: list[Datagram] = [(PACKET, ("10.0.0.1", port)) for port in range(3000)]
    for n in range(11):
        rations.share(crowd, True, n * FLOOD_S / 10)
    assert len(rations.share(crowd, True, FLOOD_S + 0.2)) <= 1024 + BURST_BYTES / 1000 + 1
    assert len(rations._left) <= 1025 and len(rations._heard) <= 4096
