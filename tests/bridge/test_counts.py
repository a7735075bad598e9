"""A bridge's /metrics, whoever asks."""

import socket

from tests.bridge.conftest import page, wait
from tests.daemon.harness import DEADLINE_S
from tests.sockets import FakeDaemon, free_address


def test_who_asks_for_metrics_too_slowly_is_hung_up_on(bridge, fake: FakeDaemon) -> None:
    """Each connection costs a thread and a descriptor, which a bridge needs to connect again."""
    metrics, nobody = free_address(socket.SOCK_STREAM), free_address(socket.SOCK_STREAM)
    process = bridge("mqtt", "--broker", nobody, "--socket", fake.path, "--metrics", metrics)
    process.until("is not there")
    slow = [socket.create_connection(metrics, DEADLINE_S) for _ in range(3)]
    for one in slow:
        one.sendall(b"GET /me")
    assert "gestured_bridge_connected" in wait(lambda: page(str(metrics)))  # nobody waits for them
    for one in slow:
        assert one.recv(1) == b""
        one.close()
    assert "Traceback" not in process.said()
