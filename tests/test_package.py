"""What is installed: the wheel's contents, its programs, and that it runs without the extras."""

import ast
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

import gestured
from tests.programs import PARSERS, subcommands

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
EXTRAS = ("torch", "sklearn", "onnx", "pytest", "hypothesis", "hatchling", "paho", "zenoh", "serial")
ALL_BUT_LAB = """
import importlib, pkgutil, gestured
found = pkgutil.walk_packages(gestured.__path__, "gestured.")
names = [module.name for module in found if not module.name.endswith("__main__")]
for name in names:
    if not name.startswith("gestured.lab"):
        importlib.import_module(name)
"""


def python_without(
    absent: tuple[str, ...], code: str, path: Path, tmp_path: Path
) -> "subprocess.CompletedProcess[str]":
    """Runs code with gestured from `path`, as if the packages named in `absent` were not installed."""
    blocked = f"import sys\nfor name in {absent!r}: sys.modules[name] = None\nsys.path.insert(0, {str(path)!r})\n"
    command = [sys.executable, "-c", blocked + code]
    return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)


@pytest.fixture(scope="session")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder named gestured with all of the project that is installed."""
    if importlib.util.find_spec("hatchling") is None:
        pytest.skip("hatchling is not installed: no wheel can be built")
    source = tmp_path_factory.mktemp("source") / "gestured"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE", "NOTICE"):
        shutil.copy(ROOT / name, source / name)
    for name in ("gestured", "models"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "gestured_models", source / "gestured_models", follow_symlinks=False)
    return source


def unpack(kind: str, clone: Path, out: Path, folder: Path) -> None:
    """Build a "wheel" or an "editable" one of the clone, and install what is in it into a folder."""
    build = f"import hatchling.build as backend; backend.build_{kind}({str(out)!r})"
    done = subprocess.run([sys.executable, "-c", build], cwd=clone, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    (wheel,) = out.glob("gestured-*-py3-none-any.whl")
    zipfile.ZipFile(wheel).extractall(folder)


@pytest.fixture(scope="session")
def installed(clone: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the contents of the wheel, built from what is in the project."""
    out = tmp_path_factory.mktemp("wheel")
    unpack("wheel", clone, out, out / "installed")
    return out / "installed"


@dataclass(frozen=True)
class Environment:
    """A virtual environment with gestured; what it needs is where this interpreter has it."""

    python: Path
    package: Path  # where its gestured is
    beside: Path  # the folder that holds the clone

    def run(self, *arguments: object) -> "subprocess.CompletedProcess[str]":
        """Runs its interpreter beside the clone."""
        command = [self.python, *map(str, arguments)]
        clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        return subprocess.run(command, cwd=self.beside, env=clean, capture_output=True, text=True, timeout=60)


@pytest.fixture(scope="session", params=["wheel", "editable"])
def environment(request: pytest.FixtureRequest, clone: Path, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    """Installed as a user does (`pip install`), and as a developer does (`pip install --editable`)."""
    folder = tmp_path_factory.mktemp(request.param)
    venv.create(folder / "venv", with_pip=False)
    python = folder / "venv" / "bin" / "python"
    ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(subprocess.run([python, "-c", ask], capture_output=True, text=True, check=True).stdout.strip())
    (packages / "others.pth").write_text(sysconfig.get_path("purelib"))
    unpack(request.param, clone, folder, packages)
    return Environment(python, (packages if request.param == "wheel" else clone) / "gestured", clone.parent)


def test_the_wheel_holds_models_types_and_licences_and_nothing_else(installed: Path):
    for path in (ROOT / "models").iterdir():
        if path.suffix in (".onnx", ".md") or path.name == "manifest.json":
            assert (installed / "gestured_models" / path.name).read_bytes() == path.read_bytes()
    assert (installed / "gestured" / "py.typed").exists()
    (information,) = installed.glob("*.dist-info")
    assert "Apache License" in (information / "licenses" / "LICENSE").read_text()
    assert "CapFingerId" in (information / "licenses" / "NOTICE").read_text()
    assert {path.name for path in installed.iterdir()} == {"gestured", "gestured_models", information.name}


def test_no_message_names_a_document_since_a_wheel_brings_none():
    files = [path for path in (ROOT / "gestured").rglob("*.py") if "lab" not in path.parts]
    nodes = [node for path in files for node in ast.walk(ast.parse(path.read_text()))]
    docstrings = {node.value for node in nodes if isinstance(node, ast.Expr)}
    texts = [node.value for node in nodes if isinstance(node, ast.Constant) and node not in docstrings]
    assert texts and [text for text in texts if isinstance(text, str) and ".md" in text] == []


def test_the_page_on_installing_names_each_extra_but_those_for_changing_the_code():
    extras, page = PROJECT["project"]["optional-dependencies"], (ROOT / "docs/install.md").read_text()
    assert [extra for extra in extras if f"`[{extra}]`" not in page] == ["dev", "fuzz"]


def test_everything_but_the_lab_imports_without_the_extras(installed: Path, tmp_path: Path):
    done = python_without(EXTRAS, ALL_BUT_LAB, installed, tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("program", sorted(PROJECT["project"]["scripts"]))
def test_each_program_prints_help_without_the_extras(installed: Path, tmp_path: Path, program: str):
    module, function = PROJECT["project"]["scripts"][program].split(":")
    code = f"sys.argv = [{program!r}, '--help']\nfrom {module} import {function}\nsys.exit({function}())"
    done = python_without(EXTRAS, code, installed, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"usage: {program}")
    assert "example" in done.stdout


@pytest.mark.parametrize("command", sorted(subcommands("gesturectl")))
def test_each_subcommand_shows_an_example_that_is_valid(command: str):
    help_text = subcommands("gesturectl")[command].format_help()
    examples = [line.strip() for line in help_text.splitlines() if line.strip().startswith("gesturectl ")]
    assert examples
    for example in examples:
        program, *arguments = shlex.split(example)
        assert arguments[0] == command
        PARSERS["gesturectl"].parse_args(arguments)


BESIDE = """
import gestured, gestured.model.shipped
from gestured.core import sensor
print(gestured.__file__, gestured.open.__name__)
print(gestured.model.shipped.shipped()["cnn_lstm"].is_file())
"""


def test_a_script_beside_a_clone_finds_what_is_installed(environment: Environment):
    """The clone's folder is named as the package is, and stands first in the path."""
    script = environment.beside / "script.py"
    script.write_text(BESIDE)
    for arguments in ([script], ["-c", BESIDE]):
        done = environment.run(*arguments)
        assert done.stdout == f"{environment.package / '__init__.py'} open\nTrue\n", done.stderr
    for module, program in (("control", "gesturectl"), ("daemon", "gestured")):
        done = environment.run("-m", f"gestured.{module}", "--version")
        assert done.stdout == f"{program} {gestured.__version__}\n"


USE = """
import gestured

recognizer = gestured.open("cnn_lstm", sensor="armrest", grid=(9, 9))
for event in recognizer.push(0.0, [[0.0] * 9] * 9, touches=[gestured.Touch(1, 4.0, 4.0)]):
    if isinstance(event, gestured.Gesture):
        reveal_type(event.gesture)
with gestured.Subscriber("/run/gestured/events.sock", types=["gesture"]) as events:
    for line in events:
        print(line["gesture"])
gestured.Recogniser  # type: ignore[attr-defined]  # an ignored error that is none is one
"""


@pytest.mark.parametrize("environment", ["wheel"], indirect=True)
def test_a_type_checker_sees_the_front_door(environment: Environment):
    pytest.importorskip("mypy")
    (environment.beside / "use.py").write_text(USE)
    command = ["-m", "mypy", "--strict", "--cache-dir", os.devnull, "--python-executable", environment.python, "use.py"]
    done = subprocess.run(
        [sys.executable, *map(str, command)], cwd=environment.beside, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stdout
    assert 'use.py:7: note: Revealed type is "str"' in done.stdout.replace("builtins.", "")


@pytest.mark.parametrize(
    ("extra", "flags"),
    [
        ("mqtt", ["mqtt", "--broker", "localhost"]),
        ("zenoh", ["zenoh"]),
        ("serial", ["serial", "/dev/ttyUSB0", "--protocol", "csv", "--sensor", "armrest"]),
    ],
    ids=["mqtt", "zenoh", "serial"],
)
def test_without_its_extra_a_bridge_says_what_to_install(installed: Path, tmp_path: Path, extra: str, flags: list[str]):
    code = f"sys.argv = ['gestured-bridge', *{flags!r}]\nfrom gestured.bridge.cli import main\nsys.exit(main())"
    done = python_without(EXTRAS, code, installed, tmp_path)
    assert done.returncode == 1
    assert f"pip install 'gestured[{extra}]'" in done.stderr and done.stderr.count("\n") == 1
