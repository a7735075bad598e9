"""What may be released, and what a release holds; `make package-test` uses what was made."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import gestured
from deploy.release import BESIDE, faults, shipped, strange, sums, version

ROOT = Path(__file__).resolve().parents[2]
TRACKED = [
    *("gestured/__init__.py", "gestured/control/view/page/page.js", "tests/test_fields.py", *BESIDE),
    *("models/__init__.py", "models/lstm.onnx", "models/lstm.md", "models/manifest.json"),
]
READY = {
    "number": "1.2.0",
    "changelog": "# Changelog\n\n## 1.2.0 - 2026-12-24\n",
    "changed": "",
    "head": "a1",
    "tagged": "a1",
}


def test_the_version_stands_in_one_place():
    assert version(ROOT) == gestured.__version__
    assert 'dynamic = ["version"]' in (ROOT / "pyproject.toml").read_text()


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({}, []),
        ({"number": "1.3.0"}, ['CHANGELOG.md begins with "1.2.0 - 2026-12-24", not with "1.3.0 - DATE"']),
        ({"changelog": "## Unreleased\n## 1.2.0 - 2026-12-24\n"}, ['CHANGELOG.md begins with "Unreleased"']),
        ({"changelog": ""}, ['CHANGELOG.md begins with "nothing"']),
        ({"changed": " M README.md\n?? models/mine.onnx"}, ["not committed: README.md models/mine.onnx"]),
        ({"tagged": ""}, ["no tag: git tag --annotate v1.2.0"]),
        ({"tagged": "b2"}, ["v1.2.0 is the tag of another commit"]),
    ],
)  # fmt: skip
def test_what_keeps_a_commit_from_being_a_release(fault: dict[str, str], said: list[str]):
    found = faults(**(READY | fault))
    assert len(found) == len(said) and all(one.startswith(words) for one, words in zip(found, said, strict=True))


@pytest.mark.parametrize("what", ["", "wheel", "sdist"])
@pytest.mark.parametrize("change", ["less", "more"])
def test_what_is_missing_or_too_much_is_named(tmp_path: Path, what: str, change: str):
    ours = sorted(shipped(TRACKED))
    assert len(ours) == 6 and "models/lstm.onnx" in ours
    inside = {kind: [*ours] for kind in ("wheel", "sdist")}
    if what:
        inside[what] = ours[1:] if change == "less" else [*ours, "gestured/secret.key"]
    sdist = tmp_path / "gestured-1.2.0.tar.gz"
    with tarfile.open(sdist, "w:gz") as tar:
        for name in ["PKG-INFO", *BESIDE, *inside["sdist"]]:
            tar.addfile(tarfile.TarInfo(f"gestured-1.2.0/{name}"))
    wheel = tmp_path / "gestured-1.2.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        information = [
            f"gestured-1.2.0.dist-info/{name}" for name in ("METADATA", "licenses/LICENSE", "licenses/NOTICE")
        ]
        for name in [*inside["wheel"], *information]:
            archive.writestr(re.sub("^models/", "gestured_models/", name), name)
    found = strange(wheel, sdist, TRACKED)
    named = ours[0] if change == "less" else "gestured/secret.key"
    assert found == ([f"{(wheel if what == 'wheel' else sdist).name}: {named}"] if what else [])


def test_the_digests_are_what_sha256sum_checks(tmp_path: Path):
    if shutil.which("sha256sum") is None:
        pytest.skip("sha256sum is not installed")
    (tmp_path / "gestured-1.2.0.whl").write_bytes(b"wheel")
    (tmp_path / "SHA256SUMS").write_text(sums(tmp_path.glob("gestured*")))
    check = ["sha256sum", "--check", "--strict", "SHA256SUMS"]
    assert subprocess.run(check, cwd=tmp_path, capture_output=True, text=True).stdout == "gestured-1.2.0.whl: OK\n"


def test_every_pinned_package_has_hashes_and_none_that_is_needed_lacks():
    for name in ("build", "runtime"):
        text = (ROOT / "deploy" / "locks" / f"{name}.txt").read_text()
        pins = re.split(r"^(?=\S+==)", text, flags=re.MULTILINE)[1:]
        assert pins and all("--hash=sha256:" in pin for pin in pins)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [project["optional-dependencies"][name] for name in ("mqtt", "zenoh", "serial")]
    asked = sum(extras, project["dependencies"])
    for name in {re.split("[>=]", line)[0] for line in asked}:
        assert any(pin.startswith(f"{name}==") for pin in pins), name


def test_a_folder_that_is_no_clone_is_told_in_a_sentence(tmp_path: Path):
    """As what is unpacked from an archive."""
    shutil.copytree(ROOT / "deploy", tmp_path / "deploy")
    environment = {"PATH": os.environ["PATH"], "GIT_CEILING_DIRECTORIES": str(tmp_path.parent)}
    command = [sys.executable, "-m", "deploy.release", "build", "dist"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and done.stderr.startswith("packages are built in a clone")


@pytest.mark.parametrize(
    ("system", "named"),
    [("ID=debian\nVERSION_ID=12\n", "debian12"), ("ID=debian\nVERSION_CODENAME=forky\n", "debianforky")],
)
def test_a_debian_package_is_named_for_its_system_also_for_debian_testing(tmp_path: Path, system: str, named: str):
    """Testing has no VERSION_ID. With stand-ins for pip, debhelper and dpkg-buildpackage."""
    folder, programs = tmp_path / "clone", tmp_path / "venv" / "bin"
    shutil.copytree(ROOT / "deploy", folder / "deploy")
    (folder / "gestured").mkdir()
    for name in ("CHANGELOG.md", "gestured/__init__.py"):
        shutil.copy(ROOT / name, folder / name)
    (tmp_path / "os-release").write_text(system)
    script = folder / "deploy" / "deb.sh"
    script.write_text(script.read_text().replace("/etc/os-release", str(tmp_path / "os-release")))
    programs.mkdir(parents=True)
    package = "echo >../gestured_$(sed -n '1s/.*(\\(.*\\)).*/\\1/p' debian/changelog)_amd64.deb"
    does = {"python": f'exec {sys.executable} "$@"', "pip": "", "dh": "", "dpkg-buildpackage": package}
    for name, text in does.items():
        (programs / name).write_text(f"#!/bin/sh\n{text}\n")
        (programs / name).chmod(0o755)
    environment = {"PATH": f"{programs}:{os.environ['PATH']}"}
    command = 'git init --quiet && git add . && deploy/deb.sh "$1" dist amd64'
    done = subprocess.run(
        ["sh", "-c", command, "sh", programs.parent],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.stdout == f"dist/gestured_{gestured.__version__}~{named}_amd64.deb\n", done.stderr


def test_make_install_refuses_over_a_debian_package(tmp_path: Path):
    programs = tmp_path / "programs"
    programs.mkdir()
    (programs / "dpkg-query").write_text("#!/bin/sh\nprintf installed\n")
    (programs / "dpkg-query").chmod(0o755)
    (tmp_path / "venv" / "bin").mkdir(parents=True)
    (tmp_path / "venv" / "bin" / "python").symlink_to(sys.executable)
    done = subprocess.run(
        [ROOT / "deploy" / "install.sh", tmp_path / "venv", "", tmp_path / "prefix"],
        cwd=ROOT, env={**os.environ, "PATH": f"{programs}:{os.environ['PATH']}"}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 1 and "apt remove gestured" in done.stderr and not (tmp_path / "prefix").exists()


@pytest.mark.parametrize(
    "metadata", ["License-Expression: MIT", "License: BSD", "Classifier: License :: OSI Approved :: MIT License", ""]
)
@pytest.mark.parametrize("text", ["LICENSE", None])
def test_a_package_says_the_licences_of_what_it_brings(tmp_path: Path, metadata: str, text: str | None):
    information = tmp_path / "lib" / "other-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text(f"Metadata-Version: 2.4\nName: other\nVersion: 1.0\n{metadata}\n")
    (information / "RECORD").write_text(
        "other-1.0.dist-info/METADATA,,\n" + (f"other-1.0.dist-info/{text},,\n" if text else "")
    )
    command = [sys.executable, ROOT / "deploy" / "licences.py", tmp_path / "lib", "/usr/lib/gestured"]
    done = subprocess.run(command, capture_output=True, text=True)
    if metadata and text:
        assert "/usr/lib/gestured/other-1.0.dist-info/LICENSE" in done.stdout and "CapFingerId" in done.stdout
    else:
        assert (
            done.returncode == 1
            and done.stderr == "other comes without its licence: deploy/licences.txt has to say it\n"
        )
