"""What is made from the programs' own words is up to date, complete, and understood by those who read it."""

import os
import pty
import re
import select
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from deploy.generate import animation, completion, configuration, dashboard, man, programs
from gestured.daemon.settings import FLAGS, TABLES, Settings

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = {program.name: program for program in programs.all_programs()}
PAGES = man.pages(PROGRAMS.values())


@pytest.mark.parametrize(
    ("kept", "made"),
    [
        ("deploy/gestured.toml", configuration.example),
        ("deploy/grafana/dashboards/gestured.json", dashboard.dashboard),
    ],
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


def explain(path: Path) -> "subprocess.CompletedProcess[str]":
    """What the daemon says of a configuration."""
    command = [sys.executable, "-m", "gestured.daemon", "--config", str(path), "--explain"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)


def test_the_example_sets_nothing_and_each_of_its_keys_is_valid(tmp_path: Path):
    done = explain(ROOT / "deploy" / "gestured.toml")
    assert done.returncode == 0 and "nothing, all defaults" in done.stdout, done.stderr
    everything = tmp_path / "all.toml"
    everything.write_text(re.sub(r"^#(?=[\w\[])", "", configuration.example(), flags=re.MULTILINE))
    done = explain(everything)
    assert done.returncode == 0, done.stderr
    set_by = {line.split(":")[0].strip() for line in done.stdout.split("set by:")[1].splitlines() if line}
    keys = {"per_gesture" if key.startswith("gestures.one_tap.") else key.partition(".")[0] for key in set_by}
    assert keys == set(Settings.model_fields) == {*FLAGS, *TABLES}


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
    program = PROGRAMS.get(name.rpartition(".")[0])
    parts = () if program is None else (program, *program.commands)
    for flag in (flag for part in parts for option in part.options for flag in option.flags):
        assert flag in shown
    for key in configuration.tables()[""] if program is None else ():
        assert key.written in shown


def complete(program: str, *words: str) -> set[str]:
    """What bash offers after these words."""
    script = completion.completion(programs.PARSERS[program](), "bash") + (
        f"\nCOMP_WORDS=({' '.join(repr(word) for word in (program, *words))}); COMP_CWORD={len(words)}\n"
        f'$(complete -p {program} | grep -o "_shtab[a-z_]*"); printf "%s\\n" "${{COMPREPLY[@]}}"\n'
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=20, cwd=ROOT)
    assert done.stderr == ""
    return set(done.stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_flags_choices_and_files():
    assert complete("gesturectl", "lis") == {"listen"}
    for command in PROGRAMS["gesturectl"].commands:
        name = command.name.split()[-1]
        flags = {flag for option in command.options for flag in option.flags if flag.startswith("--")}
        assert complete("gesturectl", name, "--") == flags
    assert "--model" in complete("gestured", "--mo")
    assert "README.md" in complete("gestured", "--config", "READ")
    assert "README.md" in complete("gesturectl", "replay", "READ")
    assert complete("gesturectl", "simulate", "--speed", "fa") == {"fast"}


class Zsh:
    """An interactive zsh in a terminal, with our completions; a context manager."""

    def __init__(self, folder: Path) -> None:
        for name, parser in programs.PARSERS.items():
            (folder / f"_{name}").write_text(completion.completion(parser(), "zsh"))
        self._terminal, inner = pty.openpty()
        environment = {"TERM": "dumb", "PATH": os.environ["PATH"], "HOME": str(folder), "PS1": "", "LANG": "C.UTF-8"}
        self._process = subprocess.Popen(
            ["zsh", "-f", "-i"], stdin=inner, stdout=inner, stderr=inner, cwd=ROOT, env=environment, process_group=0
        )
        os.close(inner)
        self.said = ""
        self.type(
            f"stty -echo; fpath=({folder} $fpath); autoload -Uz compinit; compinit -u -D; echo rea''dy\n", "ready\r"
        )

    def type(self, keys: str, expected: str) -> None:
        """Type something, and wait until it is answered."""
        os.write(self._terminal, keys.encode())
        begin = len(self.said)
        while expected not in self.said[begin:]:
            readable, _, _ = select.select([self._terminal], [], [], 20)
            assert readable, f"{keys!r}: expected {expected!r}, found {self.said[begin:]!r}"
            self.said += os.read(self._terminal, 4096).decode(errors="replace")

    def __enter__(self) -> "Zsh":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._terminal)


@pytest.mark.skipif(shutil.which("zsh") is None, reason="zsh is not installed")
def test_zsh_completes_commands_flags_choices_and_files(tmp_path: Path):
    with Zsh(tmp_path) as zsh:
        for typed, completed in (
            ("gesturectl recal", "ibrate"),
            ("gesturectl listen --rec", "onnect"),
            ("gesturectl listen --socket /usr/lib/os-rel", "ease"),
            ("gesturectl simulate --speed fa", "st"),
            ("gesturectl replay READ", "ME.md"),
            ("gestured --flight", "-recorder"),
            ("gestured --config READ", "ME.md"),
        ):
            zsh.type(f"{typed}\t", typed + completed)
            zsh.type("\x15echo ne''xt\n", "next\r")  # a line is thrown away
    for name in PROGRAMS:
        assert subprocess.run(["zsh", "-n", tmp_path / f"_{name}"], capture_output=True, text=True).stderr == ""


@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
@pytest.mark.parametrize("name", sorted(PROGRAMS))
def test_fish_takes_the_completion(tmp_path: Path, name: str):
    path = tmp_path / f"{name}.fish"
    path.write_text(completion.completion(programs.PARSERS[name](), "fish"))
    ask = f"source {path}; complete --do-complete '{name} --h'"
    done = subprocess.run(["fish", "--no-config", "-c", ask], capture_output=True, text=True, timeout=20)
    assert done.stderr == "" and "--help" in done.stdout
