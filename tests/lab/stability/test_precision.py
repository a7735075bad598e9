"""What fewer digits cost: the tables say what was asked for, and that of a shipped network little changes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from gestured.lab.nets import CnnLstm
from gestured.lab.stability import precision
from gestured.lab.study.onnx_form import Graph, quantised
from gestured.model.model import Model
from gestured.model.shipped import shipped
from tests.lab.made import gestures

WINDOWS = [gestures()["swipe_up"], gestures()["circle_clockwise"]]


def test_the_fewer_steps_a_window_has_the_more_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(precision, "RECURRENT", ("lstm",))
    rows: dict[str, Any] = {str(row[1]): row for row in precision.precision_table(WINDOWS).rows}
    assert rows["float16 windows, as in training"][3] < rows["windows of 10 steps"][3] < rows["windows of 2 steps"][3]
    assert sum(what.startswith("int8 weights") for what in rows) == 1


def test_a_model_of_int8_fails_its_self_test() -> None:
    smaller = quantised(Graph(shipped()["lstm"].read_bytes()))
    assert smaller is not None
    with pytest.raises(ValueError, match="self-test"):
        Model(smaller.data, "int8")


def test_the_states_norm_is_told_at_each_length(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    net = CnnLstm(9, 9, 12).eval()
    monkeypatch.setattr(precision, "base_of", lambda name: SimpleNamespace(judged=SimpleNamespace(net=net)))
    monkeypatch.setattr(precision, "STATE_FRAMES", (3, 40))
    rows: list[Any] = precision.state_table(WINDOWS).rows
    assert [row[1] for row in rows] == [3, 40, 3, 40]
    kept: list[float] = []
    state, frames = None, torch.from_numpy(np.concatenate(WINDOWS * 2)[None, :40])
    with torch.no_grad():
        for k in range(40):
            _, state = net.lstm(net.features(frames[:, k : k + 1]), state)
            kept.append(float(state[1].norm()))
    assert [row[2] for row in rows[:2]] == pytest.approx([kept[2], kept[39]], rel=1e-4)
    assert [row[3] for row in rows[:2]] == pytest.approx([max(kept[:3]), max(kept)], rel=1e-4)
