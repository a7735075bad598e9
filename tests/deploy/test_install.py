"""What `make install` says in the end; tests/systemd/system.py installs for real."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PUT = """/opt/bin/gestured
/opt/bin/gesturectl
/opt/lib/systemd/system/gestured.service
/opt/lib/systemd/system/gestured.socket
/opt/share/man/man8/gestured.8
/opt/share/bash-completion/completions/gestured
/opt/share/zsh/vendor-completions/_gestured
/opt/share/fish/vendor_completions.d/gestured.fish
/opt/share/doc/gestured/operating.md
"""


def said(tmp_path: Path, destination: str) -> str:
    """What is said of an installation below `tmp_path`, or of one that a package is made of."""
    root = tmp_path if destination else Path(f"{tmp_path}/")
    folder = root / "opt" / "lib" / "gestured"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "installed").write_text(PUT)
    done = subprocess.run(
        [ROOT / "deploy/installed.sh", destination, "/opt"], capture_output=True, text=True, check=True
    )
    return done.stdout


def test_make_install_says_what_went_where_and_what_comes_next(tmp_path: Path) -> None:
    text = said(tmp_path, str(tmp_path))
    for where in ("/opt/bin/gestured", "/opt/bin/gesturectl", "/opt/lib/gestured", "/opt/lib/systemd/system",
                  "/opt/share/man", "/opt/share/doc/gestured", "/etc/gestured/gestured.toml"):  # fmt: skip
        assert where in text
    completions = [line.split()[1:] for line in text.splitlines() if line.startswith("  completions")]
    assert completions == [
        ["/opt/share/bash-completion/completions", "/opt/share/fish/vendor_completions.d",
         "/opt/share/zsh/vendor-completions"],
    ]  # fmt: skip
    commands = [line.strip() for line in text.splitlines() if line.startswith("  sudo ")]
    assert len(commands) == 2 and commands[1] == "sudo systemctl enable --now gestured.service"
    operating = (ROOT / "docs" / "operating.md").read_text()
    for part in " && ".join(commands).split(" && "):
        assert part in operating
    recipe = subprocess.run(["make", "-n", "install", "DESTDIR=/x"], cwd=ROOT, capture_output=True, text=True)
    assert 'deploy/installed.sh "/x" "/usr"' in recipe.stdout
