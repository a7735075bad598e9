"""`make package-test`: what `make dist` and `make deb` have made, as a stranger uses it.

The Debian package is linted, and lives a whole life in a Debian of its own that mmdebstrap makes and systemd boots.
One test of that, because each step stands on the one before.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.systemd.conftest import ROOT
from tests.systemd.container import Container, missing
from tests.systemd.vehicle import Vehicle

TOOLS = ROOT / "build" / "tools" / "bin"
CONFIGURATION = "/etc/gestured/gestured.toml"
OWN = "/var/lib/gestured/own-gestures.json"
BEFORE = "9180e01"  # the first commit with `make deb`, which 0.2.0 had not yet; the next release's tag takes its place

TEACH = """
gesturectl simulate --to 127.0.0.1:9000 --sensor taught --kinds zigzag --seconds 40 --non-gestures 0 >/dev/null &
until gesturectl enrol zigzag --sensor taught --examples 1; do sleep 0.2; done
kill $!
"""

pytestmark = pytest.mark.timeout(1200)


def needed(*programs: str) -> None:
    """Skip where one of these is missing."""
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")


def made(target: str, pattern: str, source: Path = ROOT) -> Path:
    """The newest file that a target of the Makefile puts into dist/."""
    done = subprocess.run(["make", target], cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return max((source / "dist").glob(pattern), key=lambda path: path.stat().st_mtime)


@pytest.fixture(scope="session")
def wheel() -> Path:
    return made("dist", "gestured-*.whl")


@pytest.fixture(scope="session")
def package() -> Path:
    needed("dpkg-buildpackage", "dh")
    return made("deb", "gestured_*.deb")


@pytest.mark.parametrize("program", [["uvx", "--from"], ["pipx", "run", "--spec"]], ids=["uvx", "pipx"])
def test_one_command_shows_the_demo(wheel: Path, program: list[str], tmp_path: Path):
    environment = {**os.environ, "PIPX_HOME": str(tmp_path / "pipx"), "UV_SYSTEM_CERTS": "1"}
    command = [TOOLS / program[0], *program[1:], wheel, "gesturectl", "demo", "--seconds", "20"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert re.search(r"[1-9]\d* right, 0 wrong", done.stdout), done.stdout
    (folder,) = re.findall(r'export PATH="(.*):\$PATH"', done.stdout)  # where the programs of the next steps are
    assert (Path(folder) / "gestured").exists()


def test_lintian_finds_nothing(package: Path):
    needed("lintian")
    done = subprocess.run(
        ["lintian", "--allow-root", "--fail-on", "error,warning", package], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout


def test_no_script_of_the_package_asks_a_network_or_pip(package: Path, tmp_path: Path):
    subprocess.run(["dpkg-deb", "--control", package, tmp_path / "control"], check=True)
    for script in ("preinst", "postinst", "prerm", "postrm"):
        assert not re.search(r"\b(pip|curl|wget|https?:|ensurepip|venv)\b", (tmp_path / "control" / script).read_text())


def test_all_is_roots_and_bound_to_one_python(package: Path):
    listed = subprocess.run(["dpkg-deb", "--contents", package], capture_output=True, text=True, check=True).stdout
    assert {line.split()[1] for line in listed.splitlines()} == {"root/root"}
    extensions = set(re.findall(r"\.cpython-3(\d+)-", listed))
    depends = subprocess.run(["dpkg-deb", "--field", package, "Depends"], capture_output=True, text=True).stdout
    (minor,) = extensions
    assert f"python3.{minor}" in depends.replace(",", "").split()
    for file in ("bin/gestured", "include/gestured_events.h", "include/gestured_frames.h"):
        assert re.search(rf"/usr/{file}$", listed, re.MULTILINE)


@pytest.fixture(scope="session")
def before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an older version made of itself; it bears the number of the newest release, so it is given a smaller one."""
    folder = tmp_path_factory.mktemp("before")
    source, content = folder / "source", folder / "content"
    subprocess.run(["git", "clone", "--quiet", "--shared", "--no-checkout", ROOT, source], check=True)
    if subprocess.run(["git", "-C", source, "checkout", "--quiet", BEFORE], capture_output=True).returncode != 0:
        pytest.skip(f"this clone's history lacks {BEFORE}: git fetch --unshallow")
    subprocess.run(["dpkg-deb", "--raw-extract", made("deb", "gestured_*.deb", source), content], check=True)
    control = content / "DEBIAN" / "control"
    control.write_text(re.sub(r"^Version: .*$", "Version: 0.0.1", control.read_text(), flags=re.MULTILINE))
    package = folder / "before.deb"
    subprocess.run(["dpkg-deb", "-Znone", "--root-owner-group", "--build", content, package], check=True)
    return package


@pytest.fixture(scope="session")
def box(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Container]:
    """A Debian like this machine's, booted, with what the package says that it needs: apt has no network inside."""
    if (reason := missing()) is not None:
        pytest.skip(f"no container here: {reason}")
    needed("mmdebstrap")
    system = dict(re.findall(r'^(\w+)="?(.*?)"?$', Path("/etc/os-release").read_text(), re.MULTILINE))
    root = tmp_path_factory.mktemp("debian") / "root"
    depends = subprocess.run(["dpkg-deb", "--field", package, "Depends"], capture_output=True, text=True, check=True)
    (python,) = re.findall(r"python3\.\d+", depends.stdout)
    include = f"systemd,systemd-sysv,dbus,iproute2,man-db,libstdc++6,{python}"
    done = subprocess.run(
        ["mmdebstrap", "--variant=apt", f"--include={include}", system["VERSION_CODENAME"], root],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with Container(root, whole=True) as container:
        yield container


def put(box: Container, package: Path) -> str:
    """A package into the container; the path there."""
    shutil.copy(package, box.path("/root") / package.name)
    return f"/root/{package.name}"


def apt(box: Container, *arguments: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    """What an operator types; he keeps his own file where the package has another one, which is the default answer."""
    return box.run("apt-get", "--yes", "--quiet", "--option=Dpkg::Options::=--force-confold", *arguments, check=check)


def listening(box: Container) -> set[str]:
    """The addresses that sockets of the network are bound to."""
    said = box.run("ss", "--listening", "--udp", "--tcp", "--numeric", "--no-header").stdout
    return {line.split()[4].rsplit(":", 1)[0] for line in said.splitlines()}


def recognised(vehicle: Vehicle, sensor: str) -> None:
    with closing(vehicle.client()) as client, vehicle.swiped(sensor):
        client.events("gesture", sensor)


def taught(box: Container) -> None:
    """Somebody teaches the daemon a zigzag."""
    box.run("sh", "-euc", TEACH)


def test_a_package_from_installation_to_purge(box: Container, before: Path, package: Path):
    vehicle = Vehicle(box)

    # Over a `make install` it refuses, and says what to do.
    mark = box.path("/usr/lib/gestured/installed")
    mark.parent.mkdir()
    mark.touch()
    refused = apt(box, "install", put(box, before), check=False)
    assert refused.returncode != 0 and "make uninstall" in refused.stdout + refused.stderr
    assert not box.path("/usr/bin/gestured").exists()
    mark.unlink()
    mark.parent.rmdir()

    # Installed it runs, and hears nobody but this machine.
    apt(box, "install", put(box, before))
    recognised(vehicle, "first")
    assert listening(box) == {"127.0.0.1"}
    for name in ("gestured.service", "gestured-osc.socket"):
        assert box.run("systemctl", "is-enabled", name).stdout.strip() == "enabled"
    assert box.run("systemctl", "is-enabled", "gestured-standalone.service", check=False).stdout.strip() == "disabled"
    assert len(box.run("man", "--where", "gestured", "gesturectl", "gestured.toml").stdout.split()) == 3

    # An upgrade keeps what an operator wrote and what a user taught, and restarts what ran: an instance, too.
    box.path(CONFIGURATION).write_text('# an operator\'s\nmodel = "lstm"\n')
    box.path("/etc/gestured/left.toml").write_text('listen = "127.0.0.1:9001"\n')
    box.run("systemctl", "start", "gestured@left.service")
    taught(box)
    left, instance = Vehicle(box, "gestured@left", 9001), vehicle.instance()
    instance_left = left.instance()
    held = [box.run("systemctl", "show", "-P", "ActiveEnterTimestampMonotonic", "gestured-osc.socket").stdout]
    apt(box, "install", put(box, package))
    assert vehicle.instance() != instance and left.instance() != instance_left
    held.append(box.run("systemctl", "show", "-P", "ActiveEnterTimestampMonotonic", "gestured-osc.socket").stdout)
    assert held[0] == held[1]  # what came meanwhile waited in it
    assert box.run("stat", "--format=%G", vehicle.events).stdout == "gestured-events\n"  # the older one's had another
    assert vehicle.status()["model"]["active"] == "lstm" and "an operator's" in box.path(CONFIGURATION).read_text()
    assert "zigzag" in box.run("gesturectl", "gestures").stdout
    recognised(vehicle, "second")

    # Removed, nothing of it runs or listens, and settings and own gestures stay.
    apt(box, "remove", "gestured")
    assert box.run("systemctl", "list-units", "--no-legend", "--state=active", "gestured*").stdout == ""
    assert listening(box) == set()
    assert not box.path("/usr/lib/gestured").exists() and not box.path("/usr/bin/gestured").exists()
    assert "an operator's" in box.path(CONFIGURATION).read_text() and box.path(OWN).exists()

    # Purged, they go, by these paths alone: what a link leads to stays.
    kept = box.path("/root/kept")
    kept.mkdir()
    (kept / "file").touch()
    (box.path("/var/lib/gestured") / "link").symlink_to("/root/kept")
    apt(box, "purge", "gestured")
    assert not box.path(CONFIGURATION).exists() and not os.path.lexists(box.path("/var/lib/gestured"))
    assert box.path("/etc/gestured/left.toml").exists()  # an operator's own
    assert (kept / "file").exists()
