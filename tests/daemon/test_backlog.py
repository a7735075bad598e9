"""What waits: in which order it is served, and who is served when more comes than can be done."""

from hypothesis import given
from hypothesis import strategies as st

from gestured.daemon.backlog import CREDIT_S, FLOOD_S, GROUP, GROUP_BYTES, MOST_BYTES, TOGETHER_S, Backlog, fair

ARM, SEAT, BUSY, STRANGER = ("10.0.0.1", 1), ("10.0.0.1", 2), ("10.0.0.1", 3), ("10.0.0.9", 1)
OWNERS = {ARM, SEAT, BUSY}
FRAME = bytes(400)


def backlog() -> Backlog:
    return Backlog(OWNERS.__contains__)


def test_what_arrived_together_is_served_together_in_order() -> None:
    waiting = backlog()
    arrivals = [0.0, TOGETHER_S / 2, TOGETHER_S, 1.0]
    waiting.add([(b"%d" % n, ARM) for n in range(len(arrivals))], arrivals)
    groups = []
    while waiting:
        groups.append([packet for packet, _ in waiting.group()[0]])
    assert groups == [[b"0", b"1"], [b"2"], [b"3"]]


def test_a_group_is_bounded() -> None:
    waiting = backlog()
    sizes = [GROUP_BYTES + 1, GROUP_BYTES - 1, 1, 1, *[0] * 2 * GROUP]
    waiting.add([(bytes(size), ARM) for size in sizes], [0.0] * len(sizes))
    assert [len(waiting.group()[0]) for _ in range(4)] == [1, 2, GROUP, GROUP]


def serve(waiting: Backlog, now: float, count: int, each_s: float) -> float:
    """Work on so many groups; the time after it."""
    for _ in range(count):
        waiting.group()
        now += each_s
        waiting.worked(each_s, now)
    return now


def test_a_backlog_that_is_worked_off_is_no_flood_however_long_it_takes() -> None:
    waiting = backlog()
    waiting.add([(FRAME, ARM)] * 1000, [90.0 + n / 100 for n in range(1000)])
    now = serve(waiting, 100.0, 500, 0.009)
    now += 5.0  # the daemon was stopped again
    assert not waiting.flooded(now)
    now = serve(waiting, now, 499, 0.009)
    assert not waiting.flooded(now)


def test_what_is_served_slower_than_it_arrives_is_a_flood() -> None:
    waiting = backlog()
    waiting.add([(FRAME, ARM)] * 1000, [n / 100 for n in range(1000)])
    now = serve(waiting, 10.0, 49, 0.021)
    assert waiting.flooded(now)
    waiting.share(0.001, now)
    assert waiting.flooded(now + 0.9 * FLOOD_S) and not waiting.flooded(now + 1.1 * FLOOD_S)


def test_a_machine_that_is_a_little_late_is_not_flooded() -> None:
    waiting, now = backlog(), 0.0
    waiting.add([(FRAME, ARM)] * 3, [now] * 3)
    for _ in range(1000):
        now = serve(waiting, now, 1, 0.01)
        waiting.add([(FRAME, ARM)], [now])
    assert not waiting.flooded(now)


def test_what_fills_the_memory_is_a_flood_at_once() -> None:
    waiting = backlog()
    many = MOST_BYTES // 60_000 + 1
    waiting.add([(bytes(60_000), ARM)] * many, [0.0] * many)
    assert waiting.flooded(0.0)


def flood(
    senders: dict[tuple[str, int], int], turns: int = 100, seconds: float = 0.001, cost: float = 3e-5
) -> dict[tuple[str, int], int]:
    """How many packets of each sender are served, where so many come in each turn and each costs so much."""
    waiting, served, now = backlog(), dict.fromkeys(senders, 0), 0.0
    for _ in range(turns):
        now += 0.002
        packets = [(FRAME, source) for source, count in senders.items() for _ in range(count)]
        waiting.add(packets, [now] * len(packets))
        found, dropped = waiting.share(seconds, now)
        assert (
            sum(len(group.packets) for group in found) + sum(map(len, dropped.values())) == len(packets) and not waiting
        )
        for group in found:
            waiting.took(group, cost * len(group.packets))
            for _, source in group.packets:
                served[source] += 1
    return served


def test_who_needs_little_is_served_whatever_the_others_send() -> None:
    served = flood({ARM: 1, SEAT: 1} | {("10.0.0.9", port): 20 for port in range(58)})
    assert served[ARM] == served[SEAT] == 100
    strangers = sum(count for source, count in served.items() if source not in OWNERS)
    assert strangers * 3e-5 <= 100 * 0.001 + 2 * CREDIT_S  # all ports of a host share one ration


def test_an_owner_that_floods_does_not_starve_another() -> None:
    served = flood({ARM: 1, SEAT: 1000})
    assert served[ARM] == 100 and served[SEAT] * 3e-5 > 0.5 * 100 * 0.001


def test_who_sends_now_and_then_has_saved_up_for_it_where_many_owners_flood() -> None:
    """What a frame costs is more than a turn's share of 78, but less than that of the ten turns between two frames."""
    crowd = [("10.0.0.9", port) for port in range(58)]
    good = [("10.0.0.1", port) for port in range(20)]
    waiting, sent, served = Backlog({*crowd, *good}.__contains__), 0, 0
    for turn in range(3000):
        now = 0.006 * turn
        waiting.add([(bytes(60_000), crowd[turn % len(crowd)])], [now])
        if turn % 10 == 0:
            waiting.add([(FRAME, source) for source in good], [now] * len(good))
            sent += len(good)
        for group in waiting.share(0.001, now)[0]:
            waiting.took(group, 3.75e-7 * sum(len(packet) for packet, _ in group.packets))
            served += sum(source in good for _, source in group.packets)
    assert served == sent


def test_a_stranger_is_heard_beside_owners_that_flood() -> None:
    served = flood({ARM: 50, SEAT: 50, STRANGER: 1}, cost=4e-4)  # which the stranger's credit would not pay
    assert served[STRANGER] == 100


def test_a_source_of_many_sensors_has_saved_up_for_each_of_them() -> None:
    for owned, lost in ({ARM: 1}, True), ({ARM: 300}, False):
        waiting = Backlog(owned.__getitem__)
        waiting.add([(FRAME, ARM)] * 300, [0.0] * 300)
        _, dropped = waiting.share(0.001, 0.0)
        assert bool(dropped) == lost


def test_a_packet_that_costs_more_than_a_turn_has_its_turn_in_the_end() -> None:
    assert 0 < flood({STRANGER: 1}, cost=0.015)[STRANGER] < 100


@given(st.dictionaries(st.text(max_size=3), st.floats(0, 10), min_size=1, max_size=20), st.floats(0, 10))
def test_shares_are_fair(needs: dict[str, float], seconds: float) -> None:
    shares = fair(dict(needs), seconds)
    used = sum(min(shares[key], need) for key, need in needs.items())
    assert used <= seconds + 1e-9
    assert used >= min(seconds, sum(needs.values())) - 1e-9  # nothing is left over while somebody needs it
    for one, need in needs.items():
        if shares[one] < need:  # whoever gets too little gets as much as anybody
            assert all(min(shares[key], needs[key]) <= shares[one] + 1e-9 for key in needs)
