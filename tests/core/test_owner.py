"""Who may feed a sensor."""

from hypothesis import given
from hypothesis import strategies as st

from gestured.core.owner import Owner

STALE_S = 1.0
HOST = "10.0.0.1"
FIRST, OTHER = (HOST, 1), (HOST, 2)


def test_a_program_that_opens_a_port_for_each_packet_is_one_sender() -> None:
    owner = Owner((HOST, 0))
    assert all(owner.admits((HOST, port), 0.01 * port, STALE_S) for port in range(300))


def test_a_port_of_the_same_host_cannot_take_a_name_whose_sender_goes_on() -> None:
    owner = Owner(FIRST)
    assert owner.admits(FIRST, 0.0, STALE_S)
    said = [owner.admits(OTHER, 0.01 * n, STALE_S) for n in range(1, 5)]
    assert said == [True, False, False, False]  # its first packet might be the next of the same program
    assert owner.admits(FIRST, 0.067, STALE_S)
    assert not owner.admits(OTHER, 0.068, STALE_S) and not owner.admits((HOST, 3), 0.069, STALE_S)


@given(st.lists(st.tuples(st.sampled_from([(HOST, port) for port in range(2, 6)]), st.floats(0.0, 0.06)), max_size=40))
def test_whoever_sends_steadily_is_never_refused(others: list[tuple[tuple[str, int], float]]) -> None:
    """The first sender, every 67 ms, with anything in between from ports of its own host."""
    owner = Owner(FIRST)
    told = 0
    for n, (source, later) in enumerate(others):
        assert owner.admits(FIRST, n / 15, STALE_S)
        told += owner.admits(source, n / 15 + later, STALE_S)
    assert told <= 1
