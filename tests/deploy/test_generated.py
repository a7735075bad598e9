"""What is made from the programs' own words is up to date, complete, and understood by those who read it."""

import argparse
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

from deploy.generate import animation, completion, configuration, dashboard, man, programs
from gestured.daemon.explain import explain
from gestured.daemon.settings import FLAGS, TABLES, Settings
from tests.daemon.parts import settings_of

ROOT = Path(__file__).resolve().parents[2]
PAGES = man.pages()
OURS = {"gestures.one_tap": "per_gesture", "gates.start": "gate"}  # keys in the file -> keys of the settings


@pytest.mark.parametrize(
    ("kept", "made"),
    [("deploy/gestured.toml", configuration.example), ("deploy/grafana/dashboards/gestured.json", dashboard.dashboard)],
)
def test_what_is_kept_is_what_is_made(kept: str, made):
    what = made.__module__.rsplit(".", 1)[-1]
    hint = f"python -m deploy.generate {what} > {kept}"
    assert (ROOT / kept).read_text() == made(), f"make it anew: {hint}"


def test_the_animation_in_the_readme_is_made_from_its_recording():
    kept = ROOT / "docs" / "demo.svg"
    hint = "python -m deploy.generate animation docs/demo.mcap > docs/demo.svg"
    assert kept.read_text() == animation.animation(ROOT / "docs" / "demo.mcap"), f"make it anew: {hint}"
    assert kept.stat().st_size < 200_000 and "docs/demo.svg" in (ROOT / "README.md").read_text()
    picture = ElementTree.parse(kept).getroot()
    spoken = picture.attrib["aria-label"]
    assert "circle_clockwise, swipe_left" in spoken
    assert len(picture.findall(".//{*}animate")) > 40 and not picture.findall(".//{*}script")


def test_the_example_sets_nothing_and_each_of_its_keys_is_valid(tmp_path: Path):
    def told(path: Path) -> str:
        return explain(*settings_of("--config", path))

    assert "nothing, all defaults" in told(ROOT / "deploy" / "gestured.toml")
    everything = tmp_path / "all.toml"
    everything.write_text(re.sub(r"^#(?=[\w\[])", "", configuration.example(), flags=re.MULTILINE))
    set_by = {line.split(":")[0].strip() for line in told(everything).split("set by:")[1].splitlines() if line}
    ours = {theirs: next((OURS[part] for part in OURS if theirs.startswith(part)), None) for theirs in set_by}
    keys = {name or key.partition(".")[0] for key, name in ours.items()}
    assert keys == set(Settings.model_fields) == {*FLAGS, *TABLES}


def flags(parser: argparse.ArgumentParser) -> set[str]:
    """The long flags of a program or a subcommand."""
    return {flag for each in programs.arguments(parser) for flag in each.option_strings if flag.startswith("--")}


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed")
@pytest.mark.parametrize("name", sorted(PAGES))
def test_man_pages_are_readable(tmp_path: Path, name: str):
    path = tmp_path / name
    path.write_text(PAGES[name])
    command = ["man", "--warnings", "--encoding=utf-8", "--local-file", str(path)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, env={"MANWIDTH": "100", "LANG": "C.UTF-8"}
    )
    assert (done.returncode, done.stderr) == (0, "")
    shown = " ".join(done.stdout.replace("\u2010", "-").split())
    if name == "gestured.toml.5":
        assert [key for keys in configuration.tables().values() for key in keys if key.written not in shown] == []
    else:
        program = programs.PARSERS[name[:-2]]()
        for part in (program, *programs.commands(program)):
            assert flags(part) <= set(shown.replace(",", " ").split())
            assert " ".join((part.epilog or "").split()) in shown


@cache
def bash(program: str) -> str:
    """The script that completes a program."""
    return completion.completion(programs.PARSERS[program](), "bash")


def complete(program: str, *words: str) -> set[str]:
    """What bash offers after these words."""
    script = bash(program) + (
        f"\nCOMP_WORDS=({' '.join(repr(word) for word in (program, *words))}); COMP_CWORD={len(words)}\n"
        f'$(complete -p {program} | grep -o "_shtab[a-z_]*"); printf "%s\\n" "${{COMPREPLY[@]}}"\n'
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=20, cwd=ROOT)
    assert done.stderr == ""
    return set(done.stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_flags_choices_and_files():
    assert complete("gesturectl", "lis") == {"listen"}
    for command in programs.commands(programs.PARSERS["gesturectl"]()):
        assert complete("gesturectl", command.prog.split()[-1], "--") == flags(command)
    assert "--model" in complete("gestured", "--mo")
    for words in (
        ("gestured", "--config"), ("gesturectl", "replay"), ("gesturectl", "demo", "--model"),
        ("gesturectl", "export", "tape.mcap"), ("gestured-bridge", "serial"),
    ):  # fmt: skip
        assert "README.md" in complete(*words, "READ"), words
    assert complete("gesturectl", "simulate", "--speed", "fa") == {"fast"}
