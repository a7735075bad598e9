"""The consumers of docs/connect.md, but for the addresses; what gesturectl doctor says of bridges."""

import os
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from gestured.control.cli import main
from tests.bridge import zenoh_site
from tests.bridge.conftest import emit
from tests.bridge.test_mqtt import begin
from tests.bridge.test_serial import Out
from tests.daemon.harness import Daemon
from tests.documents.blocks import blocks


def consumer(phrase: str) -> str:
    """The example with a phrase in it."""
    (found,) = [block.text for block in blocks(document="docs/connect.md") if phrase in block.text]
    return found


def heard(code: str, *daemons: Daemon) -> set[str]:
    """What a consumer prints first of each daemon, while somebody swipes again and again."""
    lines: set[str] = set()
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        os.set_blocking(process.stdout.fileno(), False)
        try:
            while len(lines) < len(daemons):
                assert process.poll() is None
                for daemon in daemons:
                    emit(daemon, "swipe_left")
                lines |= set(iter(process.stdout.readline, ""))
        finally:
            process.kill()
    return lines


def test_one_subscriber_hears_several_daemons(model: Path, tmp_path: Path):
    daemons = {}
    try:
        for name in ("gestured-left", "gestured-right"):
            (tmp_path / name).mkdir()
            daemons[name] = Daemon.start(tmp_path / name, model)
        sockets = ", ".join(f'"{tmp_path}/{name}/events.sock"' for name in daemons)
        code = f"""
import gestured
with gestured.Subscriber({sockets}) as events:
    for event in events:
        if event["type"] == "gesture":
            print(events.path.parent.name, event["sensor"], event["gesture"], flush=True)
"""
        found = heard(code, *daemons.values())
        assert found == {f"{name} armrest swipe_left\n" for name in daemons}
    finally:
        for daemon in daemons.values():
            daemon.stop()


def test_the_mqtt_consumer(bridge, broker, daemon: Daemon):
    at = broker()
    begin(bridge, at, daemon).ready()
    code = consumer("paho.mqtt").replace("192.168.7.2", "127.0.0.1").replace("1883", str(at.port))
    assert heard(code, daemon) == {"armrest swipe_left\n"}


def test_the_zenoh_consumer(bridge, site, daemon: Daemon):
    zenoh_site.begin(bridge, site, daemon).ready()
    code = consumer("declare_subscriber").replace("tcp/192.168.7.2:7447", site.endpoint)
    assert heard(code, daemon) == {"armrest swipe_left\n"}


def test_the_zenoh_sender(bridge, site, fake, udp):
    to = f"127.0.0.1:{udp.getsockname()[1]}"
    process = zenoh_site.begin(bridge, site, fake, "--frames", "--to", to)
    fake.accept()
    process.ready()
    code = consumer("declare_publisher").replace("tcp/192.168.7.2:7447", site.endpoint).replace("car7", "car")
    with subprocess.Popen([sys.executable, "-c", code]) as sender:
        out = Out(udp)
        first, second = out.next(), out.next()
        sender.kill()
    assert (first.values == 20.0).all() and second.counter == first.counter + 1


SYSTEMCTL = """#!/bin/sh
cat <<'END'
Id=gestured-bridge@house.service
ActiveState=active
StatusText=connected: daemon is there; broker broker.example:8883 is there

Id=gestured-bridge@car.service
ActiveState=active
StatusText=waiting: broker 192.168.7.2:1883 is not there: Connection refused; trying again

Id=gestured-serial@glove.service
ActiveState=failed
StatusText=
END
"""


def test_doctor_says_how_bridges_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    program = tmp_path / "systemctl"
    program.write_text(SYSTEMCTL)
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    main(["doctor", "--control", str(tmp_path / "none.ctl")])
    said = capsys.readouterr().out
    assert "ok      gestured-bridge@house.service is connected: daemon is there" in said
    assert "warn    gestured-bridge@car.service is waiting: broker 192.168.7.2:1883 is not there" in said
    assert "bad     gestured-serial@glove.service is failed\n        -> journalctl --unit gestured-serial@glove" in said


@pytest.mark.parametrize("there", [True, False])
def test_systemd_is_told_how_a_bridge_is(bridge, broker, daemon: Daemon, tmp_path: Path, there: bool):
    path = daemon.socket if there else tmp_path / "none.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(30)
        begin(bridge, broker(), SimpleNamespace(socket=path), env={"NOTIFY_SOCKET": str(tmp_path / "notify")})
        words = ""
        while "daemon" not in words or "broker" not in words:
            words = systemd.recv(4096).decode()
            assert words.startswith("READY=1\nSTATUS=")
        assert words.partition("STATUS=")[2].startswith("connected: " if there else "waiting: ")
        assert there or f"no daemon answers on {path}; waiting for it" in words
