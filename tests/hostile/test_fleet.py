"""Several instances on one machine: where one is killed, the others lose nothing, and its sensors come back."""

import pytest

from experiments.fleet import trial
from tests.daemon import tiny_model


@pytest.mark.hostile
def test_where_one_instance_is_killed_the_others_lose_no_frame(tmp_path):
    pytest.importorskip("onnx", reason="the tests' own model is made with the onnx package")
    found = trial(tiny_model.make(tmp_path / "tiny.onnx"), instances=4, sensors=80, rate=15.0, seconds=4.0)
    assert (found["others_lost"], found["sensors_back"]) == (0, 20)
