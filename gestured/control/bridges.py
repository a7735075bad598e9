"""What systemd knows of the bridges, for `gesturectl doctor`."""

import subprocess
from collections.abc import Iterator

from gestured.control.findings import Finding

BRIDGES = ("gestured-bridge@*", "gestured-serial@*")  # units of systemd
SYSTEMD_S = 5.0  # for its answer, which takes milliseconds


def bridge_findings() -> Iterator[Finding]:
    """The bridges that systemd runs, by what they last said of themselves."""
    command = ["systemctl", "show", "--property=Id,ActiveState,StatusText", *BRIDGES]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=SYSTEMD_S)
    except (OSError, subprocess.TimeoutExpired):
        return  # no systemd here
    for block in done.stdout.split("\n\n"):
        unit = dict(line.partition("=")[::2] for line in block.splitlines())
        if not unit.get("Id"):
            continue
        said = unit.get("StatusText") or unit.get("ActiveState", "")
        remedy = f"journalctl --unit {unit['Id']} --lines 20 says why; docs/connect.md what it needs"
        if unit.get("ActiveState") != "active":
            yield Finding("bad", f"{unit['Id']} is {unit.get('ActiveState')}", remedy)
        elif said.startswith("connected"):
            yield Finding("ok", f"{unit['Id']} is {said}")
        else:
            yield Finding("warn", f"{unit['Id']} is {said}", remedy)
