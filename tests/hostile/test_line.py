"""The bad network itself: what it does is what it says."""

import socket

import pytest

from tests.hostile.line import Impairment, Line, Proxy

SENT = [(i / 15, b"/arm/pressure %06d" % i) for i in range(4_000)]


def through(impairment: Impairment, seed: int = 1) -> list[list[tuple[float, bytes]]]:
    line = Line(impairment, seed)
    return [line.push(t, packet) for t, packet in SENT]


@pytest.mark.parametrize(("loss", "burst"), [(0.01, 1), (0.2, 1), (0.05, 5)])
def test_losses_are_as_many_and_as_long_as_asked_for(loss: float, burst: float) -> None:
    lost = [not arrivals for arrivals in through(Impairment(loss=loss, burst=burst))]
    begins = sum(b and not a for a, b in zip([False, *lost], lost, strict=False))
    assert sum(lost) / len(lost) == pytest.approx(loss, rel=0.25)
    assert sum(lost) / begins == pytest.approx(max(burst, 1 / (1 - loss)), rel=0.2)


def test_each_other_kind_of_damage_strikes_as_often_as_asked_for() -> None:
    def share(impairment: Impairment) -> float:
        found = through(impairment)
        return sum(arrivals != [sent] for arrivals, sent in zip(found, SENT, strict=True)) / len(SENT)

    for impairment in (Impairment(duplicate=0.1), Impairment(late=0.1), Impairment(corrupt=0.1), Impairment(cut=0.1)):
        assert share(impairment) == pytest.approx(0.1, rel=0.1)
    assert share(Impairment(stall_s=0.8)) == pytest.approx(0.08, rel=0.1)


def test_the_proxy_is_a_line_with_sockets() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inside, socket.socket(type=socket.SOCK_DGRAM) as outside:
        inside.bind(("127.0.0.1", 0))
        inside.settimeout(20)
        with Proxy(inside.getsockname(), Impairment(loss=0.5), seed=3) as proxy:
            twin, expected = Line(Impairment(loss=0.5), 3), []
            for t, packet in SENT[:100]:
                outside.sendto(packet, proxy.address)
                expected += [what for _, what in twin.push(t, packet)]
            assert [inside.recv(99) for _ in expected] == expected
