"""`python -m deploy.release build OUT` makes wheel and sdist, `sums OUT` their digests; `ready` checks for a release.

Run it in the project's folder. It needs only build and hatchling, in the versions that deploy/locks/build.txt has.
"""

import hashlib
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

BESIDE = {".gitignore", "LICENSE", "NOTICE", "README.md", "pyproject.toml"}  # files of the sdist beside the packages


def version(root: Path) -> str:
    """The version, from the only place where it is written."""
    (found,) = re.findall(r'^__version__ = "(.+)"$', (root / "gestured" / "__init__.py").read_text(), re.MULTILINE)
    return str(found)


def faults(number: str, changelog: str, changed: str, head: str, tagged: str) -> list[str]:
    """Why the commit `head` cannot be released as version `number`; `tagged` is the commit of its tag, or empty."""
    found = []
    heading = (re.findall(r"^## (.+)$", changelog, re.MULTILINE) or ["nothing"])[0]
    if not re.fullmatch(rf"{re.escape(number)} - \d{{4}}-\d\d-\d\d", heading):
        found.append(f'CHANGELOG.md begins with "{heading}", not with "{number} - DATE"')
    if changed:
        found.append(f"not committed: {' '.join(line[3:] for line in changed.splitlines())}")
    if not tagged:
        found.append(f"no tag: git tag --annotate v{number} --message 'gestured {number}'")
    elif tagged != head:
        found.append(f"v{number} is the tag of another commit: raise the version in gestured/__init__.py")
    return found


def git(*arguments: str) -> str:
    """The output of a git command; empty if it fails."""
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=False).stdout.strip("\n")


def run(command: Sequence[str | Path], environment: dict[str, str]) -> None:
    """Run a command silently. If it fails, exit with its output."""
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        sys.exit(f"{done.stdout}{' '.join(map(str, command))} failed")


def build(out: Path, epoch: int) -> list[Path]:
    """Build the sdist from the files in git, and the wheel from the sdist; returns wheel and sdist."""
    environment = {**os.environ, "SOURCE_DATE_EPOCH": str(epoch)}
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        run(["deploy/source.sh", source], environment)
        call: list[str | Path] = [sys.executable, "-m", "build", "--no-isolation", "--outdir", out]
        run([*call, "--sdist", source], environment)
        (sdist,) = out.glob("*.tar.gz")
        with tarfile.open(sdist) as archive:
            archive.extractall(folder, filter="data")
        (unpacked,) = Path(folder).glob("gestured-*")
        run([*call, "--wheel", unpacked], environment)
    (wheel,) = out.glob("*.whl")
    return [wheel, sdist]


def shipped(tracked: Iterable[str]) -> set[str]:
    """The files of the packages among those in git."""
    return {name for name in tracked if name.startswith(("gestured/", "models/"))}


def strange(wheel: Path, sdist: Path, tracked: list[str]) -> list[str]:
    """The files that are missing in wheel or sdist, or do not belong there."""
    ours = shipped(tracked)
    with zipfile.ZipFile(wheel) as archive:
        names = [re.sub("^gestured_models/", "models/", name) for name in archive.namelist()]
    in_wheel = {name for name in names if ".dist-info/" not in name}
    licences = {name.rsplit("/", 1)[1] for name in names if "/licenses/" in name}
    with tarfile.open(sdist) as tar:
        in_sdist = {member.name.split("/", 1)[1] for member in tar.getmembers() if member.isfile()} - {"PKG-INFO"}
    found = [f"{wheel.name}: {name}" for name in sorted(in_wheel ^ ours)]
    found += [f"{wheel.name}: no {name}" for name in sorted({"LICENSE", "NOTICE"} - licences)]
    return found + [f"{sdist.name}: {name}" for name in sorted(in_sdist ^ (ours | BESIDE))]


def sums(files: Iterable[Path]) -> str:
    """The digests of files, as `sha256sum --check` reads them."""
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in sorted(files))


def main(arguments: list[str]) -> int | str:
    """Run the command; returns 0, or what is wrong."""
    match arguments:
        case ["ready"]:
            number = version(Path())
            tagged = git("rev-parse", "--verify", "--quiet", f"v{number}^{{commit}}")
            changelog, changed = Path("CHANGELOG.md").read_text(), git("status", "--porcelain")
            return "\n".join(faults(number, changelog, changed, git("rev-parse", "HEAD"), tagged)) or 0
        case ["build", out]:
            os.umask(0o022)
            epoch = int(os.environ.get("SOURCE_DATE_EPOCH") or git("log", "-1", "--format=%ct") or 0)
            with tempfile.TemporaryDirectory() as once, tempfile.TemporaryDirectory() as again:
                files, others = build(Path(once), epoch), build(Path(again), epoch)
                if differ := [
                    one.name for one, other in zip(files, others, strict=True) if sums([one]) != sums([other])
                ]:
                    return f"built twice, and not equal: {' '.join(differ)}"
                if found := strange(files[0], files[1], git("ls-files").splitlines()):
                    return "the wheel or the sdist lacks files, or has too many:\n" + "\n".join(found)
                Path(out).mkdir(exist_ok=True)
                for path in files:
                    (Path(out) / path.name).write_bytes(path.read_bytes())
            return 0
        case ["sums", out]:
            (Path(out) / "SHA256SUMS").write_text(sums(path for path in Path(out).glob("gestured[-_]*")))
            return 0
    return "usage: python -m deploy.release build OUT | sums OUT | ready"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
