"""What several tests stand on."""

import hashlib
import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from gestured.model import model as models
from gestured.model.model import LADDER
from tests.small_model import build

# No test asserts a time, and on a loaded machine Hypothesis' own limits would be one.
settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of shipped models with a manifest, in place of the package's own."""
    directory = tmp_path / "shelf"
    directory.mkdir()
    for name in LADDER:
        build(directory / f"{name}.onnx", takes="features" if name == "touch_pattern_rf" else "frames")
    files = {p.name: {"sha256": hashlib.sha256(p.read_bytes()).hexdigest()} for p in directory.iterdir()}
    (directory / "manifest.json").write_text(json.dumps({"models": files}))
    monkeypatch.setattr(models, "_shipped_directory", lambda: directory)
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.chdir(empty)
    return directory
