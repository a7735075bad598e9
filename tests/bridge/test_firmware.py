"""The Arduino library: built by Arduino's own builder, run on a simulated board, from its matrix to a gesture."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gestured.bridge.slip import OscSlip
from tests.bridge.test_serial import Line
from tests.daemon.harness import Daemon, Hand
from tests.deploy.compilers import HEADERS, HERE

SKETCH = HEADERS / "examples" / "Matrix" / "Matrix.ino"
CORE = Path("/usr/share/arduino/hardware/arduino")  # Debian's arduino-core-avr
BUILDER = Path("/usr/share/arduino-builder")
SIMULATOR = (Path("/usr/include/simavr/sim_avr.h"), Path("/usr/include/libelf.h"))  # libsimavr-dev, libelf-dev


@pytest.fixture
def firmware(tmp_path: Path) -> Callable[..., Path]:
    """Builds the sketch for an Uno, with lines of it changed; no warning of ours."""
    if shutil.which("arduino-builder") is None or not CORE.is_dir():
        pytest.skip("Debian's arduino-builder and arduino-core-avr are not installed")
    for name in ("platform.txt", "platform.keys.rewrite.txt"):
        (tmp_path / "hardware").mkdir(exist_ok=True)
        (tmp_path / "hardware" / name).symlink_to(BUILDER / name)
    (tmp_path / "hardware" / "arduino").symlink_to(CORE)
    libraries = tmp_path / "libraries"
    libraries.mkdir()
    shutil.copytree(HEADERS, libraries / "gestured")
    shutil.copytree(HERE / "WiFi", libraries / "WiFi")

    def build(*changes: tuple[str, str]) -> Path:
        text = SKETCH.read_text()
        for before, after in changes:
            assert before in text
            text = text.replace(before, after)
        sketch, out = tmp_path / "Matrix" / "Matrix.ino", tmp_path / "out"
        sketch.parent.mkdir()
        out.mkdir()
        sketch.write_text(text)
        command = [
            "arduino-builder", "-compile", "-hardware", tmp_path / "hardware", "-tools", "/usr/bin",
            "-libraries", libraries, "-fqbn", "arduino:avr:uno", "-warnings", "all", "-build-path", out,
            "-prefs", "compiler.cpp.extra_flags=-DDECIMAL_DIG=17",  # without it Debian's compiler refuses the core
            sketch,
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=100)
        assert done.returncode == 0, done.stderr
        ours = [line for line in done.stderr.splitlines() if "warning" in line and "/cores/" not in line]
        assert not ours, ours
        return out / "Matrix.ino.elf"

    return build


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The simulated board."""
    if not all(header.exists() for header in SIMULATOR):
        pytest.skip("Debian's libsimavr-dev and libelf-dev are not installed")
    out = tmp_path_factory.mktemp("board") / "board"
    command = ["gcc", "-O2", "-Wall", "-Wextra", "-Werror", "-o", out, HERE / "board.c", "-lsimavr", "-lelf"]
    subprocess.run(command, check=True, timeout=100)
    return out


def kept(folder: Path, frames: list[NDArray[Any]], side: int) -> Path:
    """A file of frames as the simulated board reads it."""
    path = folder / "frames"
    path.write_bytes(b"".join(frame[:side, :side].astype(np.uint16).tobytes() for frame in frames))
    return path


@pytest.mark.parametrize("side", [8, 16])
def test_each_taxel_of_the_matrix_has_its_place_in_the_frame(firmware, board: Path, tmp_path: Path, side: int):
    counts = np.arange(side * side).reshape(side, side) * (1023 // (side * side))
    path = kept(tmp_path, [counts], side)
    elf = firmware(("ROWS = 8, COLUMNS = 8", f"ROWS = {side}, COLUMNS = {side}"))
    reader, readings = OscSlip(side, side), []
    with path.open("rb") as frames, subprocess.Popen(
        [board, elf, str(side), str(side)], stdin=frames, stdout=subprocess.PIPE
    ) as process:  # fmt: skip
        try:
            while len(readings) < 3:
                readings += reader.push(process.stdout.read(64))
        finally:
            process.kill()
    assert [reading.counter for reading in readings] == [0, 1, 2] and reader.passed == 0
    assert all((reading.values == counts).all() for reading in readings)


def test_a_swipe_over_the_matrix_becomes_a_gesture(firmware, board: Path, bridge, serve, tmp_path: Path):
    hand = Hand()
    swipe = [*hand.idle(2.0), *hand.swipe("left"), *hand.idle(2.0)]
    elf = firmware()
    daemon: Daemon = serve("--grid", "8x8", model="cnn_lstm")
    line = Line(tmp_path / "ttyACM0")
    sensor = ("--sensor", "armrest", "--grid", "8x8")
    bridge("serial", line.link, "--protocol", "osc-slip", *sensor, "--to", daemon.address).ready()
    client = daemon.client().subscribe("gesture")
    with kept(tmp_path, swipe, 8).open("rb") as frames, subprocess.Popen(
        [board, elf, "8", "8"], stdin=frames, stdout=line.end
    ) as matrix:  # fmt: skip
        try:
            (event,) = client.events("gesture", "armrest")
        finally:
            matrix.kill()
    line.unplug()
    assert event["gesture"] == "swipe_left"


def test_the_half_of_the_sketch_that_sends_over_wifi_compiles(firmware):
    assert firmware(("#define OVER_WIFI 0", "#define OVER_WIFI 1")).exists()
