"""A shipped model as the daemon runs it, and windows of fewer digits: no answer is another one than in float64."""

from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto

from gestured.lab.stability import decisions
from gestured.lab.stability.decisions import by_reference, decisions_table, widened
from gestured.model.shipped import LADDER, shipped


def test_no_answer_of_a_shipped_model_is_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """On extreme windows, too, here a sixth of them; and of gestures and those every score is right, not only finite.

    Of a non-gesture one may differ: a taxel at the very threshold of contact is in contact by one bit.
    """
    extreme, performed = decisions.extreme_windows, decisions.performed_windows
    monkeypatch.setattr(decisions, "extreme_windows", lambda quick: extreme(quick)[::6])
    monkeypatch.setattr(decisions, "performed_windows", lambda _, kinds: performed(10, kinds))
    rows: list[Any] = decisions_table(LADDER, quick=True).rows
    assert {row[0] for row in rows} == set(LADDER) and len({row[1] for row in rows}) == 3
    assert [row for row in rows if row[3]] == []
    as_the_daemon = {row[1].partition(" ")[2]: row[4] for row in rows if row[2] == "as the daemon" and row[0] == "lstm"}
    assert as_the_daemon["windows of gestures"] < 1e-5 and as_the_daemon["extreme ones"] < 1e-5
    assert max(row[4] for row in rows) < 0.2


def test_the_table_sees_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def turned(data: bytes) -> decisions.Run:
        def run(values: np.ndarray) -> list[np.ndarray]:
            scores, unknown = by_reference(data)(values)
            return [scores[:, ::-1], unknown]

        return run

    few, extreme = decisions.performed_windows, decisions.extreme_windows
    monkeypatch.setattr(decisions, "performed_windows", lambda count, kinds: few(4, kinds))
    monkeypatch.setattr(decisions, "extreme_windows", lambda quick: extreme(quick)[:4])
    monkeypatch.setattr(decisions, "by_reference", turned)
    rows: list[Any] = decisions_table(["lstm"], quick=True).rows
    assert min(row[4] for row in rows) > 1e-3 and max(row[3] for row in rows) > 0


def test_a_widened_graph_holds_no_float32() -> None:
    graph = widened(shipped()["lstm"].read_bytes()).graph
    tensors = [
        *graph.initializer,
        *(a.t for n in graph.node for a in n.attribute if a.type == onnx.AttributeProto.TENSOR),
    ]
    assert {tensor.data_type for tensor in tensors} >= {TensorProto.DOUBLE}
    assert TensorProto.FLOAT not in {tensor.data_type for tensor in tensors}
