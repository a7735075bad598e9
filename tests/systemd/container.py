"""A booted systemd in a container: a whole system, or this machine's /usr below what `make install` has made."""

import ctypes
import os
import shutil
import signal
import subprocess
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

CLONE_NEWNET = 0x40000000
DEADLINE_S = 60.0
NETWORK = "192.168.7.2"  # the container's address that is not its loopback's; whoever sends to it sends from it


def missing() -> str | None:
    """Why no container can be booted here, or None."""
    if os.geteuid() != 0:
        return "only root can boot a container"
    for program in ("systemd-nspawn", "nsenter", "mount", "systemctl", "ip"):
        if shutil.which(program) is None:
            return f"{program} is not installed (apt install systemd-container util-linux iproute2)"
    if not Path("/usr/lib/systemd/systemd").exists():
        return "systemd itself is not installed"
    return None


def wait(what: str, condition: Callable[[], Any], found_instead: Callable[[], object] = str) -> Any:
    """Ask until the answer is true; there is no message to wait for from a systemd that boots."""
    end = time.monotonic() + DEADLINE_S
    while not (found := condition()):
        assert time.monotonic() < end, f"{what}: not within {DEADLINE_S:.0f} s {found_instead()}"
        time.sleep(0.02)
    return found


class Container:
    """A folder that `make install DESTDIR=` has filled, or a `whole` system, becomes the root. A context manager."""

    def __init__(self, root: Path, whole: bool = False) -> None:
        self.root = root
        self._whole = whole
        self._usr = root.with_name("usr")
        self._log = root.with_name("console.txt")

    def _borrow(self) -> None:
        """Take this machine's programs and libraries, where there are only the installed ones."""
        (self.root / "usr").rename(self._usr)
        for name in ("usr", "dev", "proc", "sys", "run", "tmp", "var"):
            (self.root / name).mkdir(exist_ok=True)
        for name in ("bin", "sbin", "lib", "lib64"):
            (self.root / name).symlink_to(f"usr/{name}")
        shutil.copy("/usr/lib/os-release", self.root / "etc")
        lower = f"lowerdir={self._usr}:/usr"
        subprocess.run(["mount", "-t", "overlay", "overlay", "-o", lower, self.root / "usr"], check=True)

    def __enter__(self) -> "Container":
        if not self._whole:
            self._borrow()
        (self.root / "etc" / "machine-id").write_text(uuid.uuid4().hex + "\n")  # no first boot: nothing is preset
        command = [
            "systemd-nspawn", "--boot", f"--directory={self.root}", f"--machine=gestured-{os.getpid()}",
            "--register=no", "--keep-unit", "--private-network", "--console=pipe",
            "--system-call-filter=bpf",  # without it systemd inside cannot keep what IPAddressDeny= promises
            "systemd.unit=multi-user.target",
        ]  # fmt: skip
        try:
            with self._log.open("wb") as log:
                self._nspawn = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
            self.leader = wait("the container's first process", self._leader)
            wait("the end of the boot", lambda: self._state() in ("running", "degraded"))
            self.run("ip", "address", "add", f"{NETWORK}/32", "dev", "lo")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._nspawn.send_signal(signal.SIGTERM)  # an orderly shutdown
        try:
            self._nspawn.wait(DEADLINE_S)
        except subprocess.TimeoutExpired:
            self._nspawn.kill()
            self._nspawn.wait()
        if not self._whole:
            subprocess.run(["umount", self.root / "usr"], check=True)

    def _leader(self) -> int | None:
        assert self._nspawn.poll() is None, self._log.read_text()
        children = Path(f"/proc/{self._nspawn.pid}/task/{self._nspawn.pid}/children").read_text().split()
        for pid in children:
            if Path(f"/proc/{pid}/comm").read_text().strip() == "systemd":
                return int(pid)
        return None

    def _state(self) -> str:
        return self.run("systemctl", "is-system-running", check=False).stdout.strip()

    def run(self, *command: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
        """Run a command inside, as root."""
        enter = ["nsenter", f"--target={self.leader}", "--mount", "--uts", "--ipc", "--net", "--pid", "--root", "--wd"]
        done = subprocess.run([*enter, *command], capture_output=True, text=True, timeout=DEADLINE_S, env=ENVIRONMENT)
        if check and done.returncode != 0:
            said = subprocess.run([*enter, "journalctl", "-n", "30"], capture_output=True, text=True, env=ENVIRONMENT)
            raise AssertionError(f"{' '.join(command)}: {done.stdout}{done.stderr}\n{said.stdout}")
        return done

    def follow(self, text: str) -> str:
        """Do as an example in the documents says; what it printed."""
        return self.run("bash", "-euo", "pipefail", "-c", text.replace("sudo ", "")).stdout

    def path(self, path: str) -> Path:
        """A path inside, as seen from outside."""
        return Path(f"/proc/{self.leader}/root{path}")

    def call(self, function: Callable[[], Any]) -> Any:
        """Call a function in the container's network: sockets that it makes stay there."""
        found: list[Any] = []

        def enter() -> None:
            with open(f"/proc/{self.leader}/ns/net") as network:
                if ctypes.CDLL(None, use_errno=True).setns(network.fileno(), CLONE_NEWNET) != 0:
                    raise OSError(ctypes.get_errno(), "setns")
            found.append(function())

        thread = threading.Thread(target=enter)  # it stays in that network until it ends
        thread.start()
        thread.join()
        return found[0]


ENVIRONMENT = {"PATH": "/usr/bin:/usr/sbin", "LANG": "C.UTF-8", "PAGER": "cat", "SYSTEMD_COLORS": "0"}
