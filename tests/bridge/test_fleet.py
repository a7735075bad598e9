"""The example of docs/fleet.md: one subscriber, several daemons."""

import os
import subprocess
import sys
from pathlib import Path

from tests.bridge.conftest import emit
from tests.control.conftest import ROOT
from tests.daemon.harness import Daemon
from tests.documents.blocks import blocks


def test_one_subscriber_hears_several_daemons(model: Path, tmp_path: Path):
    (code,) = [block.text for block in blocks(document="docs/fleet.md") if "gestured.Subscriber" in block.text]
    daemons = {}
    try:
        for name in ("gestured-left", "gestured-right"):
            (tmp_path / name).mkdir()
            daemons[name] = Daemon.start(tmp_path / name, model)
        command = [sys.executable, "-c", code.replace("/run/", f"{tmp_path}/")]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
            os.set_blocking(process.stdout.fileno(), False)
            heard: set[str] = set()
            while len(heard) < 2:
                assert process.poll() is None
                for daemon in daemons.values():
                    emit(daemon, "swipe_left")
                heard |= {line.strip() for line in iter(process.stdout.readline, "")}
            process.kill()
        assert heard == {f"{name} armrest swipe_left" for name in daemons}
    finally:
        for daemon in daemons.values():
            daemon.stop()
