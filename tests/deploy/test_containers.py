"""Image and composition. No container engine runs where these tests do: they are linted, and have not been run."""

import re
import shlex
from pathlib import Path

import pytest

from gestured.control.cli import parser as gesturectl_parser
from gestured.daemon.cli import parser as gestured_parser

ROOT = Path(__file__).resolve().parents[2]
DOCKERFILE = ROOT / "deploy" / "Dockerfile"
TEXT = re.sub(r"^#.*\n", "", DOCKERFILE.read_text(), flags=re.MULTILINE).replace("\\\n", " ")
INSTRUCTIONS = [(line.split()[0], line.partition(" ")[2].strip()) for line in TEXT.splitlines() if line.strip()]
FINAL = INSTRUCTIONS[max(i for i, (word, _) in enumerate(INSTRUCTIONS) if word == "FROM") :]


def test_the_final_image_is_not_root_and_holds_no_build_tools():
    users = [rest for word, rest in FINAL if word == "USER"]
    assert users and int(users[-1].split(":")[0]) > 0
    assert [word for word, _ in FINAL].index("USER") > max(i for i, (word, _) in enumerate(FINAL) if word == "RUN")
    assert not any("pip" in rest or "apt" in rest for word, rest in FINAL if word == "RUN")
    assert ("ENTRYPOINT", '["gestured"]') in FINAL


def test_it_says_whether_it_is_healthy():
    (check,) = [rest for word, rest in FINAL if word == "HEALTHCHECK"]
    (code,) = re.findall(r'"(import [^"]*)"', check)
    compile(code, "HEALTHCHECK", "exec")
    (environment,) = [rest for word, rest in FINAL if word == "ENV"]
    (address,) = re.findall(r"GESTURED_METRICS=(\S+)", environment)
    assert f"http://{address}/healthz" in code


def test_all_that_is_copied_is_there_and_not_ignored():
    kept = [line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")]
    for word, rest in INSTRUCTIONS:
        assert word != "ADD"
        if word == "COPY" and not rest.startswith("--from"):
            for name in rest.split()[:-1]:
                assert (ROOT / name).exists() and name in kept


def test_the_command_in_its_head_is_valid():
    (line,) = re.findall(r"docker run (.*)", DOCKERFILE.read_text())
    words = shlex.split(line)
    gestured_parser().parse_args(words[words.index("gestured") + 1 :])


def test_every_service_is_closed_in_and_every_mount_is_there():
    yaml = pytest.importorskip("yaml")
    found = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())
    parsers = {"gestured": gestured_parser(), "gesturectl": gesturectl_parser()}
    for name, service in found["services"].items():
        assert service["read_only"] and service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert name == "gestured" or service["network_mode"] == "service:gestured", name
        assert all(port.startswith("127.0.0.1:") for port in service.get("ports", ())), name
        for volume in service.get("volumes", ()):
            source = volume.split(":")[0]
            there = (ROOT / "deploy" / source).exists() if source.startswith(".") else source in found["volumes"]
            assert there, f"{name}: {volume}"
        if service["image"] == "gestured":
            program = service.get("entrypoint", ["gestured"])[0]
            parsers[program].parse_args(service.get("command", []))
        else:
            assert re.search(r":v?\d+\.\d+\.\d+$", service["image"]), name
