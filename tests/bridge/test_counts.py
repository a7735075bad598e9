"""A bridge's /metrics, whoever asks."""

import socket

import pytest

from gestured.bridge import counts
from tests.bridge.conftest import page
from tests.daemon.harness import DEADLINE_S
from tests.sockets import free_address


def test_who_asks_for_metrics_too_slowly_is_hung_up_on(monkeypatch: pytest.MonkeyPatch, capfd) -> None:
    """Each connection costs a thread and a descriptor, which a bridge needs to connect again."""
    monkeypatch.setattr(counts, "ASK_S", 0.2)
    metrics = free_address(socket.SOCK_STREAM)
    bridge = counts.Counts("mqtt")
    bridge.connected("broker", False, "the broker is not there")
    bridge.serve(metrics)
    slow = [socket.create_connection(metrics, DEADLINE_S) for _ in range(3)]
    for one in slow:
        one.sendall(b"GET /me")
    assert "gestured_bridge_connected" in page(str(metrics))  # nobody waits for them
    for one in slow:
        assert one.recv(1) == b""
        one.close()
    assert "Traceback" not in capfd.readouterr().err
