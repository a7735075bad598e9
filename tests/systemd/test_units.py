"""The units: how exposed they are, that systemd understands them, and where the two services differ."""

import re
import shlex
import shutil
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

import pytest

UNITS = Path(__file__).resolve().parents[2] / "systemd"
FILES = sorted([*UNITS.glob("*.service"), *UNITS.glob("*.socket")])
NETWORK = {
    "Description", "Wants", "After", "Conflicts", "Sockets", "Also",
    "PrivateNetwork", "RestrictAddressFamilies", "IPAddressAllow", "ExecStopPost",
}  # fmt: skip

analyze = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


def keys(unit: str) -> dict[str, list[str]]:
    """Every value of every key of a unit file."""
    found: dict[str, list[str]] = {}
    for key, value in re.findall(r"^(\w+)=(.*)$", (UNITS / unit).read_text(), re.MULTILINE):
        found.setdefault(key, []).append(value)
    return found


def exposure(folder: Path, unit: str) -> float:
    """What `systemd-analyze security` says of a unit in a folder, with its drop-ins."""
    command = ["systemd-analyze", "security", "--offline=yes", "--no-pager", unit]
    done = subprocess.run(
        command, env={"SYSTEMD_UNIT_PATH": f"{folder}:", "PATH": "/usr/bin:/bin"}, capture_output=True, text=True
    )
    match = re.search(r"Overall exposure level for \S+: (\d+\.\d)", done.stdout)
    assert match, done.stdout + done.stderr
    return float(match[1])


@analyze
@pytest.mark.parametrize(
    ("unit", "dropin", "most"),
    [
        ("gestured.service", None, 0.3),
        ("gestured.service", "osc-output.conf", 1.0),
        ("gestured-standalone.service", None, 1.0),
        ("gestured@.service", None, 1.0),
        ("gestured-bridge@.service", None, 1.0),
        ("gestured-serial@.service", None, 1.1),
    ],
)
def test_exposure(tmp_path: Path, unit: str, dropin: str | None, most: float):
    for path in FILES:
        shutil.copy(path, tmp_path)
    if dropin:
        (tmp_path / f"{unit}.d").mkdir()
        shutil.copy(UNITS / dropin, tmp_path / f"{unit}.d")
    assert exposure(tmp_path, unit) <= most


@analyze
def test_systemd_finds_nothing_wrong(tmp_path: Path):
    units = [tmp_path / path.name for path in FILES]
    for path in units:  # the program is not installed here
        path.write_text(
            (UNITS / path.name)
            .read_text()
            .replace("/usr/bin/gesturectl", sys.executable)
            .replace("/usr/bin/gestured-bridge", sys.executable)
            .replace("/usr/bin/gestured", sys.executable)
        )
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", *units], capture_output=True, text=True, timeout=60)
    assert (done.returncode, [line for line in done.stderr.splitlines() if str(tmp_path) in line]) == (0, [])


def test_the_services_differ_in_the_network_alone():
    activated, standalone = keys("gestured.service"), keys("gestured-standalone.service")
    assert {key for key in activated | standalone if activated.get(key) != standalone.get(key)} <= NETWORK


@pytest.mark.parametrize("unit", ["gestured-standalone.service", "gestured@.service"])
def test_an_address_that_comes_late_exhausts_no_starts(tmp_path: Path, unit: str):
    """The daemon ends with status 4 until the address is there, in a fraction of a second."""
    found = keys(unit)
    program, option, script = shlex.split(found["ExecStopPost"][0].replace("$$", "$"))
    (tmp_path / "sleep").write_text('#!/bin/sh\necho "$1"\n')
    (tmp_path / "sleep").chmod(0o755)

    def slept(status: str) -> float:
        env = {"EXIT_STATUS": status, "PATH": f"{tmp_path}:/usr/bin:/bin"}
        said = subprocess.run([program, option, script], env=env, check=True, capture_output=True, text=True).stdout
        return float(said or 0)

    assert slept("4") * int(found["StartLimitBurst"][0]) >= int(found["StartLimitIntervalSec"][0])
    assert slept("4") < float(found["TimeoutStopSec"][0].removesuffix("s"))
    assert [slept(status) for status in ("0", "1", "KILL")] == [0.0] * 3  # a crash is over at once


def test_an_instance_differs_from_the_standalone_service_in_its_name_alone():
    one, many = keys("gestured-standalone.service"), keys("gestured@.service")
    different = {key for key in one | many if one.get(key) != many.get(key)}
    assert different == {
        "Description", "Conflicts", "ExecStart", "ExecStartPre", "Environment", "ReadWritePaths", "StateDirectory",
    }  # fmt: skip
    for key in different - {"Description", "Conflicts"}:
        assert [value.replace("-%i", "").replace("%i", "gestured") for value in many[key]] == one[key]


@pytest.mark.parametrize("unit", ["gestured.service", "gestured-standalone.service", "gestured@.service"])
def test_a_reload_asks_the_daemon_whose_sockets_the_configuration_names(tmp_path: Path, unit: str):
    """There is none, so the command says where it looked."""
    found = keys(unit)
    (tmp_path / "left.toml").write_text(f'socket = "{tmp_path}/other.sock"\n')
    (tmp_path / "gestured.toml").symlink_to("left.toml")
    given = " ".join(found["Environment"]).replace("%i", "left").replace("/etc/gestured", str(tmp_path)).split()
    reload = found["ExecReload"][0].replace("/usr/bin/gesturectl", f"{sys.executable} -m gestured.control").split()
    environment = {"PYTHONPATH": str(UNITS.parent)} | dict(pair.split("=", 1) for pair in given)
    done = subprocess.run(reload, env=environment, capture_output=True, text=True, timeout=60)
    assert f"no daemon on {tmp_path}/other.ctl" in done.stderr


def test_each_socket_belongs_to_the_service_that_lists_it():
    sockets = sorted(path.name for path in UNITS.glob("*.socket"))
    service = keys("gestured.service")
    listed = service["Sockets"][0].split()
    assert sorted(listed) == sorted(service["Also"][0].split())
    assert sorted([*listed, "gestured-gates.socket"]) == sockets  # off unless it is enabled
    for socket in sockets:
        assert keys(socket)["Service"] == ["gestured.service"]
        assert f"gestured-{keys(socket)['FileDescriptorName'][0]}.socket" == socket


@pytest.mark.parametrize("section", ["Stop it", "Remove"])
def test_what_stops_the_daemon_stops_each_socket_that_would_start_it_again(section: str):
    """Also gestured-gates.socket, which may be enabled."""
    page = (UNITS.parent / "docs" / "operating.md").read_text()
    command = re.search(rf"^## {section}\n.*?^(sudo systemctl [^\n]*)", page, re.DOTALL | re.MULTILINE)
    sockets = [path.name for path in UNITS.glob("*.socket")]
    assert [name for name in sockets if not any(fnmatch(name, unit) for unit in shlex.split(command[1]))] == []
