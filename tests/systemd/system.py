"""`make system-test`: installed into an empty root, enabled under a booted systemd, used and then treated badly.

The first test is one, because each step stands on the one before; it prints what it measured.
"""

import re
import shutil
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from tests.daemon import tiny_model
from tests.documents.blocks import blocks
from tests.hostile import bad_models
from tests.systemd.conftest import ROOT, report
from tests.systemd.container import Container, missing, wait
from tests.systemd.vehicle import Vehicle, steady

METRICS = "http://127.0.0.1:9108/metrics"
CONFIGURATION = "/etc/gestured/gestured.toml"
CONNECT = "import socket; socket.socket(socket.AF_UNIX).connect('/run/gestured/events.sock')"
SOCKETS = ("gestured-osc.socket", "gestured-events.socket", "gestured-metrics.socket")
RELOADS = (  # a configuration, and why it is refused
    ('model = "lstm"\nmodle = 1\n', "did you mean model?"),
    ('model = "/nowhere.onnx"\n', "/nowhere.onnx"),
    ('model = "lstm"\n', ""),
)

pytestmark = [
    pytest.mark.skipif(missing() is not None, reason=f"no container here: {missing()}"),
    pytest.mark.timeout(600),
]


def harmed(vehicle: Vehicle, number: str) -> float:
    """Send the daemon a signal while frames come; seconds until a new start of it answers. No frame is lost."""
    before = vehicle.instance()
    sensor = vehicle.sensor(number)
    begin = time.monotonic()
    vehicle.box.run("systemctl", "kill", f"--signal={number}", "gestured.service")
    sender = steady(sensor, 50)
    # Who connects now waits in the kernel until the next start of the daemon.
    assert vehicle.instance() != before
    seconds = time.monotonic() - begin
    sender.join()
    wait(
        f"all {sensor.count} frames that were sent meanwhile",
        lambda: vehicle.frames(number) == sensor.count,
        lambda: f"but {vehicle.frames(number)}; the service said: {vehicle.log()[-2000:]}",
    )
    return seconds


def test_installed_enabled_used_killed_hung_reloaded_and_stopped(box: Container):
    vehicle = Vehicle(box)
    begin = time.monotonic()
    box.run("systemctl", "enable", "--now", "gestured.service")
    report("enable --now, until ready", time.monotonic() - begin)

    with closing(vehicle.client()) as client, vehicle.swiped("armrest"):
        client.events("gesture", "armrest")

    killed = [harmed(vehicle, "SIGKILL") for _ in range(3)]
    report("kill -9, until it answers again, best of 3", min(killed))
    report("kill -9, until it answers again, worst of 3", max(killed))
    report("a hang, until it answers again", harmed(vehicle, "SIGSTOP"))
    assert "Watchdog timeout" in vehicle.log()
    assert "most recent call first" in vehicle.log()  # on which line it hung

    # A bad reload changes nothing, a good one the model; neither loses a frame or a subscriber.
    instance, sensor = vehicle.instance(), vehicle.sensor("reload")
    with closing(vehicle.client().subscribe("status")) as client:
        sender = steady(sensor)
        for text, refusal in RELOADS:
            box.path(CONFIGURATION).write_text(text)
            begin = time.monotonic()
            done = box.run("systemctl", "reload", "gestured", check=False)
            report(f"reload, {'refused' if refusal else 'done'}", time.monotonic() - begin)
            assert (done.returncode != 0) == (refusal != "") and refusal in vehicle.log()
        sender.join()
        client.until(lambda line: line["model"] == "lstm")
    assert vehicle.instance() == instance
    wait("every frame sent during the reloads", lambda: vehicle.frames("reload") == sensor.count)

    begin = time.monotonic()
    box.run("systemctl", "stop", "gestured.service", *SOCKETS)
    report("SIGTERM, until it has ended", time.monotonic() - begin)
    assert box.run("systemctl", "show", "-P", "Result", "gestured").stdout.strip() == "success"


def test_what_the_documents_say_is_so(box: Container):
    """Every example that is marked so, in the order in which a reader meets it."""
    box.path(CONFIGURATION).write_text("")
    box.run("systemctl", "start", "gestured.service")
    for block in blocks("run", "container"):
        begin = time.monotonic()
        box.follow(block.text)
        if " mask " in block.text:
            assert box.run("curl", "--silent", METRICS, check=False).returncode != 0
        report(str(block), time.monotonic() - begin)
    assert box.run("systemctl", "is-active", "gestured.service", *SOCKETS).stdout.split() == ["active"] * 4


def as_user(box: Container, *command: str, groups: str) -> "subprocess.CompletedProcess[str]":
    """Run a command inside as somebody who is nobody."""
    group = ("--clear-groups",) if not groups else (f"--groups={groups}",)
    return box.run("setpriv", "--reuid=4000", "--regid=4000", *group, *command, check=False)


def test_installed_documents_find_each_other(box: Container, installed: Path):
    folder = installed.parent / "usr" / "share" / "doc" / "gestured"  # the container has taken usr out of the root
    links = {
        (page.name, target)
        for page in folder.glob("*.md")
        for target in re.findall(r"\]\(([^)#\s]+)", page.read_text())
        if "://" not in target
    }
    assert len(links) > 100 and [(page, target) for page, target in links if not (folder / target).exists()] == []


def test_members_of_the_group_may_and_others_may_not(box: Container):
    member, events = (box.run("getent", "group", name).stdout.split(":")[2] for name in ("gestured", "gestured-events"))
    for command in ("status", "reload", "doctor"):
        stranger = as_user(box, "gesturectl", command, groups="")
        said = stranger.stdout + stranger.stderr
        assert stranger.returncode == 1 and "Permission denied" in said and "usermod" in said
    for command in ("status", "reload"):
        found = as_user(box, "gesturectl", command, groups=f"{member},{events}")
        assert found.returncode == 0, found.stdout + found.stderr
        reader = as_user(box, "gesturectl", command, groups=events)
        assert reader.returncode == 1 and "only root, the daemon's user and its group may" in reader.stderr
    for groups, may in (("", False), (member, False), (events, True)):
        assert (as_user(box, "python3", "-c", CONNECT, groups=groups).returncode == 0) == may


def test_a_foreign_model_is_opened_apart_inside_the_units_sandbox(box: Container, tmp_path: Path):
    """The unit's filter and limits leave room for the process that tries it, also where that has to be ended."""
    vehicle = Vehicle(box)
    good = tiny_model.make(tmp_path / "tiny.onnx")
    models = {"tiny": good, "endless": bad_models.endless(good, tmp_path / "endless.onnx")}
    models["verbose"] = bad_models.verbose(good, tmp_path / "verbose.onnx")
    for name, path in models.items():
        shutil.copy(path, box.path(f"/etc/gestured/{name}.onnx"))
    box.path(CONFIGURATION).write_text("")
    box.run("systemctl", "restart", "gestured.service")
    instance = vehicle.instance()

    for name, why in (("endless", "could not be opened within"), ("verbose", "")):
        begin = time.monotonic()
        box.path(CONFIGURATION).write_text(f'model = "/etc/gestured/{name}.onnx"\n')
        done = box.run("gesturectl", "reload", check=False)
        assert done.returncode == 1 and f"{name}.onnx" in done.stderr and why in done.stderr
        report(f"a model that is refused: {name}", time.monotonic() - begin)
    box.path(CONFIGURATION).write_text('model = "/etc/gestured/tiny.onnx"\n')
    box.run("systemctl", "reload", "gestured")
    assert vehicle.instance() == instance
    box.run("systemctl", "restart", "gestured")
    with closing(vehicle.client()) as client:
        assert client.hello["model"] == "tiny"
    box.path(CONFIGURATION).write_text("")
    box.run("systemctl", "restart", "gestured.service")


def test_a_flood_is_muted_inside_the_units_sandbox_and_the_watchdog_is_fed(box: Container):
    vehicle = Vehicle(box)
    instance = vehicle.instance()
    flood = f"{sys.executable} -m tests.hostile.flood 127.0.0.1:9000 full --rate 600 --ports 58 --seconds 10"
    network = ["nsenter", f"--net=/proc/{box.leader}/ns/net", f"--wd={ROOT}"]
    subprocess.run([*network, *flood.split()], check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
    assert vehicle.instance() == instance
    said = vehicle.log()
    assert "senders of a flood are not heard" in said and "cannot be muted" not in said


def bound(port: int) -> socket.socket:
    """A UDP socket that waits for the daemon's OSC."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.settimeout(20)
    sock.bind(("127.0.0.1", port))
    return sock


def test_with_its_drop_in_the_service_sends_osc(box: Container):
    (block,) = [block for block in blocks("run", "container") if "osc-output.conf" in block.text]
    with box.call(lambda: bound(9001)) as receiver:
        box.path(CONFIGURATION).write_text('publish = ["osc://127.0.0.1:9001"]\n')
        box.follow(block.text)
        box.run("gesturectl", "emit", "swipe_left")
        wait("the event over OSC", lambda: b"swipe_left" in receiver.recv(65536))


def test_a_configuration_that_is_refused_at_the_start_is_not_tried_for_ever(box: Container):
    box.path(CONFIGURATION).write_text("modle = 1\n")
    assert box.run("systemctl", "restart", "gestured.service", check=False).returncode != 0
    show = box.run("systemctl", "show", "-P", "ExecMainStatus", "-P", "ActiveState", "gestured").stdout.split()
    assert sorted(show) == ["2", "failed"]
    box.path(CONFIGURATION).write_text("")
    box.run("systemctl", "reset-failed", "gestured*")
    box.run("systemctl", "start", "gestured.service")
    box.run("gesturectl", "status")


def test_an_address_that_comes_late_is_waited_for(box: Container):
    box.path(CONFIGURATION).write_text('listen = "192.168.8.2:9000"\n')
    box.run("systemctl", "start", "gestured-standalone", check=False)  # it stops the service that is activated
    try:
        tried = ("systemctl", "show", "-P", "NRestarts", "gestured-standalone")
        wait("another start", lambda: int(box.run(*tried).stdout) >= 2)
        box.run("ip", "address", "add", "192.168.8.2/32", "dev", "lo")
        wait("the daemon", lambda: box.run("gesturectl", "status", check=False).returncode == 0)
    finally:
        box.run("systemctl", "stop", "gestured-standalone", check=False)
        box.run("ip", "address", "delete", "192.168.8.2/32", "dev", "lo", check=False)
        box.path(CONFIGURATION).write_text("")
        box.run("systemctl", "start", "gestured.service")


def test_uninstall_leaves_settings_and_nothing_else(box: Container, installed: Path):
    box.path("/etc/gestured/left.toml").write_text('listen = "127.0.0.1:9001"\n')
    box.run("systemctl", "enable", "--now", "gestured.service", "gestured@left.service")
    (block,) = blocks("run", "tests/systemd/system.py::test_uninstall_leaves_settings_and_nothing_else")
    box.follow(block.text.splitlines()[0])
    assert box.run("systemctl", "list-units", "--no-legend", "--state=active", "gestured*").stdout == ""
    assert list(box.path("/etc/systemd/system").glob("*.wants/gestured*")) == []
    root = installed.parent  # the container has taken usr out of the root
    assert (root / "usr" / "bin" / "gestured").exists()
    subprocess.run(["make", "uninstall", f"DESTDIR={root}"], cwd=ROOT, check=True, capture_output=True)
    assert [path for path in (root / "usr").rglob("*") if not path.is_dir()] == []
    assert (installed / "etc" / "gestured" / "gestured.toml").exists()
