"""Image and composition. No container engine runs where these tests do: they are read, and have not been run."""

import re
import shlex
from pathlib import Path

import pytest

from gestured.control.cli import parser as gesturectl_parser
from gestured.daemon.cli import parser as gestured_parser

ROOT = Path(__file__).resolve().parents[2]
DOCKERFILE = (ROOT / "deploy" / "Dockerfile").read_text()


def test_the_image_is_made_of_what_is_there_and_runs_as_nobody_special():
    final = DOCKERFILE.rpartition("\nFROM ")[2]
    assert re.search(r"^USER [1-9]\d*:", final, re.MULTILINE) and not re.search(r"\b(pip|apt)\b", final)
    kept = [line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")]
    for names in re.findall(r"^COPY (?!--from)(.*) \S+$", DOCKERFILE, re.MULTILINE):
        assert [name for name in names.split() if name not in kept or not (ROOT / name).exists()] == []


def test_the_programs_in_the_image_are_called_as_they_can_be():
    (line,) = re.findall(r"docker run (.*)", DOCKERFILE)
    words = shlex.split(line)
    gestured_parser().parse_args(words[words.index("gestured") + 1 :])
    (address,) = re.findall(r"GESTURED_METRICS=(\S+)", DOCKERFILE)
    (code,) = re.findall(r'CMD \["python", "-c", "(.*)"\]', DOCKERFILE)
    compile(code, "HEALTHCHECK", "exec")
    assert f"http://{address}/healthz" in code


def test_sockets_and_own_gestures_have_folders_that_the_daemon_may_write_to_and_that_are_volumes():
    yaml = pytest.importorskip("yaml")
    daemon = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())["services"]["gestured"]
    mounted = [volume.split(":")[1] for volume in daemon["volumes"]]
    for variable in ("RUNTIME_DIRECTORY", "STATE_DIRECTORY"):
        (folder,) = re.findall(rf"{variable}=(\S+)", DOCKERFILE)
        assert folder in mounted
        assert re.search(rf"install --directory --owner=gestured [^&\n]*{folder}\b", DOCKERFILE)


def test_every_service_is_closed_in_and_every_mount_is_there():
    yaml = pytest.importorskip("yaml")
    found = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())
    parsers = {"gestured": gestured_parser(), "gesturectl": gesturectl_parser()}
    for name, service in found["services"].items():
        assert service["read_only"] and service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert name == "gestured" or service["network_mode"] == "service:gestured", name
        assert all(port.startswith("127.0.0.1:") for port in service.get("ports", ())), name
        for source in (volume.split(":")[0] for volume in service.get("volumes", ())):
            assert source in found["volumes"] or (ROOT / "deploy" / source).exists(), f"{name}: {source}"
        if service["image"] == "gestured":
            parsers[service.get("entrypoint", ["gestured"])[0]].parse_args(service.get("command", []))
        else:
            assert re.search(r":v?\d+\.\d+\.\d+$", service["image"]), name
