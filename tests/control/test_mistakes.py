"""Common mistakes explain themselves: what gesturectl says of each. docs/troubleshooting.md has them, too."""

import json
import socket
import time
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gestured.control.findings import RECENT_S, examine_status
from tests import encoding
from tests.daemon.harness import DEADLINE_S, Daemon, Hand, Sensor, counted, floats
from tests.sockets import free_address
from tests.swipes import swipes


def test_simulate_to_where_nobody_listens_ends_at_once(run) -> None:
    free = free_address()
    status, out, err = run("simulate", "--to", free)  # without end, if it did not
    assert (status, out) == (1, "")
    assert f"nobody listens on {free}" in err and "start gestured, or name its address with --to" in err


def test_either_socket_finds_the_daemon(run, daemon: Daemon) -> None:
    events, control = daemon.ready["socket"], daemon.ready["control"]
    for command in (["status", "--json"], ["doctor", "--json"], ["emit", "swipe_left", "--json"]):
        for flag, path in (("--socket", events), ("--control", control)):
            out = run(*command, flag, path)[1]
            assert json.loads(out.splitlines()[0]), (command, flag)
            assert "no daemon" not in out
    client = daemon.client()
    for flag, path in (("--socket", events), ("--control", control)):
        status, out, err = run("listen", flag, path, "--types", "status", "--count", 1, "--json")
        assert status == 0, err
        assert [json.loads(line)["type"] for line in out.splitlines()] == ["hello", "status"]
    client.close()


def test_the_variables_that_the_daemon_takes_find_it(run, daemon: Daemon, tmp_path: Path) -> None:
    events, control = daemon.ready["socket"], daemon.ready["control"]
    file = tmp_path / "gestured.toml"
    file.write_text(f'socket = "{events}"\n', "utf-8-sig")
    for given in ({"GESTURED_SOCKET": events}, {"GESTURED_CONTROL": control}, {"GESTURED_CONFIG": str(file)}):
        status, out, err = run("status", "--json", env=given)
        assert status == 0 and json.loads(out)["addresses"]["socket"] == events, (given, err)
        status, _, err = run("listen", "--types", "status", "--count", 1, env=given)
        assert status == 0, (given, err)


def awaited(daemon: Daemon, name: str, *states: str) -> dict[str, Any]:
    """A sensor's part of the status, once its state is one of these."""
    end = time.monotonic() + DEADLINE_S
    while True:
        found: dict[str, Any] = daemon.ask("status")["sensors"].get(name, {})
        if found.get("state") in states:
            return found
        assert time.monotonic() < end, found


def of(sensor: str, doctor: str) -> list[dict[str, str]]:
    """The doctor's findings about a sensor."""
    findings = [json.loads(line) for line in doctor.splitlines()]
    return [finding for finding in findings if finding["what"].startswith(f"sensor {sensor}:")]


def test_counts_that_fall_when_touched(ctl, daemon: Daemon) -> None:
    def falling(address: str, frame, count: int) -> bytes:
        return floats(address, 300 - frame, count)

    Sensor(daemon, "falls", falling).begin().perform("left", "right", "up", "down")
    awaited(daemon, "falls", "inverted")
    assert " inverted " in ctl("status")[1]
    status, out, _ = ctl("doctor", "--json")
    (found,) = of("falls", out)
    assert status == 1 and "counts fall" in found["what"] and "[sensors.falls] invert = true" in found["remedy"]


def test_a_sensor_that_sends_only_while_it_is_touched(run, serve) -> None:
    daemon = serve("--clock", "sensor", "--stale-s", 0.2)  # its rate is not that of the burst which the test sends
    sensor, hand = Sensor(daemon, "arm", counted), Hand()
    end = time.monotonic() + DEADLINE_S
    for n in count():  # a busy machine may ask only once the sensor is silent again
        sensor.count = 100 * n  # it counts on while it says nothing
        sensor.send(hand.swipe("left"))
        if daemon.ask("status")["sensors"].get("arm", {}).get("state") == "intermittent":
            break
        while daemon.ask("status")["sensors"].get("arm", {}).get("heard_s_ago", 0.0) < 0.5:
            assert time.monotonic() < end
    status, out, _ = run("doctor", "--control", daemon.ready["control"], "--json")
    (found,) = of("arm", out)
    assert status == 1 and "falls silent between touches" in found["what"] and "idle frames" in found["remedy"]


@pytest.mark.parametrize(("rate", "level"), [(3.0, "warn"), (15.0, "ok"), (960.0, "ok"), (1500.0, "warn")])
def test_a_rate_outside_the_range_is_told_with_the_range(ctl, daemon: Daemon, rate: float, level: str) -> None:
    name = f"at_{rate:.0f}_hz"
    sensor, hand = Sensor(daemon, name), Hand()
    for n in range(round(max(2 * rate, 30))):
        packet = encoding.bundle([floats(f"/{name}/pressure", hand.frame(), n)], 1.7e9 + n / rate)
        sensor.sock.send(packet)
    awaited(daemon, name, "ok")
    while abs(daemon.ask("status")["sensors"][name]["rate_hz"] / rate - 1) > 0.1:
        pass
    found = of(name, ctl("doctor", "--json")[1])
    words = [f for f in found if "5 to 1000 Hz" in f["what"]]
    assert [f["level"] for f in words] == ([level] if level == "warn" else [])
    (line,) = [line for line in ctl("status")[1].splitlines() if name in line]
    assert ("5 to 1000 Hz" in line) == (level == "warn")


def test_rows_and_columns_that_are_exchanged(run, serve, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text('[sensors.wrong]\ngrid = "6x12"\n[sensors.right]\ngrid = "12x6"\n')
    daemon = serve("--clock", "sensor", "--config", config)
    for name in ("wrong", "right"):
        sensor = Sensor(daemon, name)
        for frame in swipes(12, 6):
            sensor.sock.send(sensor.packet(frame))
        while daemon.ask("status")["sensors"].get(name, {}).get("exchanged") is not (name == "wrong"):
            pass
    out = run("doctor", "--control", daemon.ready["control"], "--json")[1]
    (remedy,) = [found["remedy"] for found in of("wrong", out) if "rows and columns" in found["what"]]
    assert '[sensors.wrong] grid = "12x6"' in remedy and "gestured --config" in remedy
    assert not any("rows and columns" in found["what"] for found in of("right", out))


def test_a_sensor_that_hears_little_says_why(ctl, daemon: Daemon) -> None:
    sensor = Sensor(daemon, "noisy").begin()
    client = daemon.client().subscribe("status")  # once a second: by then its usual noise is known
    client.until(lambda line: line["sensors"].get("noisy") == "ok")
    rubbish = np.random.default_rng(0).integers(0, 2**16, (120, 9, 9)).astype(float)
    sensor.send([*rubbish])
    end = time.monotonic() + DEADLINE_S
    while "noise" not in (reason := awaited(daemon, "noisy", "ok", "degraded")["reason"]):
        assert time.monotonic() < end, reason
    assert reason in ctl("status")[1]
    (found,) = of("noisy", ctl("doctor", "--json")[1])
    assert found["level"] == "warn" and reason in found["what"] and found["remedy"]
    sensor.send(sensor.hand.idle(3.0))
    assert awaited(daemon, "noisy", "ok")["reason"] == ""


def test_a_sensors_clock_that_does_not_come_is_missed(run, serve) -> None:
    daemon = serve("--clock", "sensor")
    sensor, hand = Sensor(daemon, "untimed"), Hand()
    for n in range(30):
        sensor.sock.send(floats("/untimed/pressure", hand.frame(), n))  # no bundle, so no time tag
    while not daemon.ask("status")["input"]["implausible"]:
        pass
    found = [json.loads(line) for line in run("doctor", "--control", daemon.ready["control"], "--json")[1].splitlines()]
    (missed,) = [one for one in found if "time tags" in one["what"]]
    assert missed["level"] == "warn" and 'clock = "arrival"' in missed["remedy"]


@pytest.mark.parametrize("kind", ["dropped", "lost frames", "kernel drops", "time tags", "lines", "osc"])
def test_what_still_happens_is_a_finding_and_what_is_over_is_none(daemon: Daemon, kind: str) -> None:
    name, many = kind.replace(" ", "_"), 777_777
    Sensor(daemon, name, counted).begin()
    awaited(daemon, name, "ok")
    for seconds, level, words in ((1.0, "warn", "1 s ago"), (RECENT_S + 7200.0, "ok", "2 h 1 min ago")):
        status = daemon.ask("status")
        last = status["last_s_ago"]
        if kind == "dropped":
            status["input"]["dropped"], last["dropped"] = {"not_osc": many}, {"not_osc": seconds}
        elif kind == "lost frames":
            status["sensors"][name] |= {"lost": many, "lost_s_ago": seconds}
        elif kind == "kernel drops":
            status["input"]["kernel_drops"], last["kernel_drops"] = many, seconds
        elif kind == "time tags":
            status["input"]["implausible"], last["implausible"] = many, {"all": seconds}
        elif kind == "lines":
            status["output"]["lines_lost"], last["lines_lost"] = many, {"all": seconds}
        else:
            status["output"]["osc"], last["osc"] = {"failed": many}, {"failed": seconds}
        (found,) = [f for f in examine_status(status) if f"{many} " in f.what and words in f.what]
        assert found.level == level and bool(found.remedy) == (level == "warn")


def test_where_no_network_leads_to_a_destination_its_drop_in_is_named(daemon: Daemon) -> None:
    status = daemon.ask("status")
    for result, words in (("refused", "listen"), ("unreachable", "osc-output.conf"), ("unresolved", "osc-output.conf")):
        status["output"]["osc"], status["last_s_ago"]["osc"] = {result: 3}, {result: 1.0}
        (found,) = [found for found in examine_status(status) if f"3 {result}" in found.what]
        assert words in found.remedy


def test_for_how_many_hours_a_sensor_has_been_silent_is_told(daemon: Daemon) -> None:
    Sensor(daemon, "still").begin()
    awaited(daemon, "still", "ok")
    status = daemon.ask("status")
    status["sensors"]["still"] |= {"state": "stale", "heard_s_ago": 93784.0}
    assert "sensor still: was heard 26 h 3 min ago" in [found.what for found in examine_status(status)]


def test_a_port_that_is_taken_is_named_with_what_shows_by_whom(run, udp: socket.socket) -> None:
    port = udp.getsockname()[1]
    status, _, err = run("sniff", "--listen", f"127.0.0.1:{port}")
    assert status == 1 and f"127.0.0.1:{port}: Address already in use: sudo ss -ulpn 'sport = :{port}'" in err
