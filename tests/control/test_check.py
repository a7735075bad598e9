"""gesturectl check."""

import json

import pytest

from gestured.model import file
from gestured.model.shipped import shipped


@pytest.mark.parametrize("content", [None, b"", b"not a model", b"\x08\x08" * 1000])
def test_what_cannot_be_used_is_one_sentence_and_status_3(run, tmp_path, content):
    path = tmp_path / "mine.onnx"
    if content is not None:
        path.write_bytes(content)
    status, out, err = run("check", path)
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert str(path) in err


@pytest.mark.parametrize("name", sorted(shipped()))
def test_shipped_models_can_be_used(run, name):
    if not shipped()[name].exists():
        pytest.skip(f"{shipped()[name]} is not there")
    status, out, _ = run("check", "--json", name)
    report = json.loads(out)
    assert status == 0
    assert (report["name"], report["shipped"], len(report["gestures"])) == (name, True, 10)
    status, out, _ = run("check", name)
    assert status == 0 and out.endswith("usable\n")


def test_a_file_without_a_digest_is_told_so(run, model, tmp_path):
    status, out, _ = run("check", model)
    assert status == 0 and "no digest" in out
    sealed = tmp_path / "mine.onnx"
    sealed.write_bytes(file.sealed(model.read_bytes()))
    status, out, _ = run("check", sealed)
    assert status == 0 and "no digest" not in out
