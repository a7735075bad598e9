"""What the documents say is so: flags are described, and the README's examples run."""

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from gestured.daemon.explain import explain
from gestured.daemon.settings import Settings
from gestured.model.shipped import shipped
from tests.documents.blocks import ROOT, blocks, documents
from tests.programs import PARSERS, subcommands

DOCUMENTS = "".join(path.read_text() for path in documents())


def flags(parser: argparse.ArgumentParser) -> set[str]:
    found = {option for action in parser._actions for option in action.option_strings if option.startswith("--")}
    return found - {"--help"}


def row(start: str) -> str:
    """The line of a table in the documents that begins with this cell."""
    (line,) = [line for line in DOCUMENTS.splitlines() if line.startswith(f"| `{start}`")]
    return line


def test_the_daemons_flags_are_those_that_the_table_lists():
    section = (ROOT / "docs" / "commands.md").read_text().partition("\n## gestured\n")[2].partition("\n## ")[0]
    rows = "".join(line for line in section.splitlines() if line.startswith("|"))
    assert set(re.findall(r"`(--[a-z0-9-]+)`", rows)) == flags(PARSERS["gestured"])


EACH = [(tool, command) for tool in PARSERS for command in sorted(subcommands(tool))]


@pytest.mark.parametrize(("tool", "command"), EACH, ids=[" ".join(pair) for pair in EACH])
def test_each_subcommand_has_its_row_and_flags(tool: str, command: str):
    described = row(f"{tool} {command}")
    own = flags(subcommands(tool)[command])
    named = set(re.findall(r"`(--[a-z0-9-]+)`", described))
    assert named <= own
    # The page says once, beside its tables, which commands take these.
    of_a_daemon = described in DOCUMENTS.partition("| command of a daemon |")[2].partition("\n\n")[0]
    common = {"--json"} if tool != "gestured-bridge" else {"--metrics"}
    if of_a_daemon:
        common |= {"--control", "--socket"}
    if (tool, command) in (("gestured-bridge", "mqtt"), ("gestured-bridge", "zenoh")):
        common |= {"--socket", "--types", "--sensors", "--gestures"}
    assert common <= own
    own -= common
    (other,) = re.findall(r"flags of `([a-z]+)`", described) or [None]
    if other is not None:
        own -= flags(subcommands(tool)[other])
    assert own <= named


def test_no_row_describes_a_subcommand_that_is_gone():
    rows = re.findall(r"^\| `(gesturectl|gestured-bridge|gestured-lab) ([a-z-]+)`", DOCUMENTS, re.MULTILINE)
    assert sorted(rows) == sorted(EACH)


@pytest.mark.e2e
def test_the_first_steps_in_the_readme_lead_to_a_gesture(tmp_path: Path):
    """The daemon, the simulated sensor and the listener as the README starts them, but for the addresses.

    The socket's path stands once in the README, in a line that each terminal begins with.
    """
    if not shipped()["cnn_lstm"].exists():
        pytest.skip(f"{shipped()['cnn_lstm']} is not there")
    typed = "".join(block.text for block in blocks(document="README.md") if block.language == "sh")
    daemon_line, simulate_line, listen_line, *_ = [x for x in typed.splitlines() if x.startswith("gesture")]
    (exported,) = re.findall(r"^export (\w+)=(?:\S+)$", typed, re.MULTILINE)
    environment = os.environ | {exported: str(tmp_path / "events.sock")}
    running = []

    def begin(line: str, *more: str) -> "subprocess.Popen[str]":
        program, *arguments = shlex.split(line)
        module = {"gestured": "gestured.daemon", "gesturectl": "gestured.control"}[program]
        command = [sys.executable, "-m", module, *arguments, *more]
        process = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        running.append(process)
        return process

    try:
        ready = json.loads(begin(daemon_line, "--listen", "127.0.0.1:0").stdout.readline())
        begin(simulate_line.replace("127.0.0.1:9000", ready["listen"]), "--kinds", "swipe_up,one_tap")
        assert "armrest" in begin(listen_line).stdout.readline()
    finally:
        for process in running:
            process.terminate()
            process.communicate(timeout=30)


def test_the_readme_quotes_the_tables():
    page, figures, performance, everyday = (
        (ROOT / name).read_text()
        for name in ("README.md", "docs/figures.md", "docs/performance.md", "docs/everyday.md")
    )
    screen = page.partition("\n## ")[0]

    def cells(text: str, begins: str) -> list[str]:
        line = next(line for line in text.splitlines() if line.startswith(f"| {begins}"))
        return [cell.partition(" (")[0] for cell in line.strip("| ").split(" | ")]  # no intervals

    quoted = re.findall(r"^\| ((?:simulated|another generator|real), .+?) \|", page, re.MULTILINE)
    assert len(quoted) == 5
    for field in quoted:
        _, count, _, right, wrong, lost, _, rejected = cells(figures, f"`cnn_lstm.onnx`, {field} ")
        assert cells(page, f"{field} ")[1:] == [count, right, wrong, lost, rejected]
    _, count, _, right, wrong, *_ = cells(figures, "`cnn_lstm.onnx`, real, taps and swipes")
    assert f"Of {count} that were cut out one by one,\n  {right} were named correctly and {wrong} wrongly (" in screen
    hours, contacts, false, interval, *_, missed, _ = map(str.strip, cells(everyday, "all ")[1:])
    assert f"{false} false gestures an hour on a simulated day at {100 * float(missed):.1f} % missed" in screen
    assert f"interval {interval}" in screen and f"{hours} people" in screen and f"{contacts} contacts" in screen
    for begins in ("answer decided to event received (p50)", "start to ready"):
        assert cells(performance, begins)[1] in page, begins
    assert f"{float(cells(performance, 'resident memory, one sensor')[1].split()[0]):.0f} MiB" in page
    (felt,) = [line for line in explain(Settings(), {}).splitlines() if "is answered" in line]
    assert all(f"{seconds} after" in screen for seconds in re.findall(r"(\S+ s) after", felt))
