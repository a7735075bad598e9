"""A bridge's /metrics, whoever asks."""

import json
import socket
from contextlib import suppress

import pytest

from gestured.bridge import counts
from gestured.core.address import Address
from tests.bridge.conftest import page, wait
from tests.daemon.harness import DEADLINE_S


def test_who_asks_for_metrics_too_slowly_is_hung_up_on(monkeypatch: pytest.MonkeyPatch, capfd) -> None:
    """Each connection costs a thread and a descriptor, which a bridge needs to connect again."""
    monkeypatch.setattr(counts, "ASK_S", 0.2)
    bridge = counts.Counts("mqtt")
    bridge.connected("broker", False, "the broker is not there")
    bridge.serve(Address("127.0.0.1", 0))
    bridge.ready()
    metrics = json.loads(capfd.readouterr().out)["metrics"]
    slow = [socket.create_connection(Address.parse(metrics), DEADLINE_S) for _ in range(3)]
    for one in slow:
        one.sendall(b"GET /me")

    def answered() -> str:
        with suppress(OSError):  # on a busy machine we are as slow as they
            return page(metrics)
        return ""

    assert "gestured_bridge_connected" in wait(answered)  # nobody waits for them
    for one in slow:
        assert one.recv(1) == b""
        one.close()
    assert "Traceback" not in capfd.readouterr().err
