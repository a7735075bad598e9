"""A shipped model as the daemon runs it, and windows of fewer digits: no answer is another one than in float64."""

from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto

from gestured.lab.stability import decisions
from gestured.lab.stability.decisions import by_reference, decisions_table, widened
from gestured.model.shipped import LADDER, shipped
from tests.lab.made import gestures

WINDOWS = list(gestures().values())


def test_no_answer_of_a_shipped_model_is_another_one() -> None:
    """On extreme windows, too; and but for windows of fewer digits every score is right, not only finite."""
    rows: list[Any] = decisions_table(LADDER, WINDOWS, quick=True).rows
    assert {row[0] for row in rows} == set(LADDER) and len({row[1] for row in rows}) == 2
    assert [row for row in rows if row[3]] == []
    assert max(row[4] for row in rows if not row[2].startswith("float16")) < 1e-5


def test_the_table_sees_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def turned(data: bytes) -> decisions.Run:
        def run(values: np.ndarray) -> list[np.ndarray]:
            scores, unknown = by_reference(data)(values)
            return [scores[:, ::-1], unknown]

        return run

    monkeypatch.setattr(decisions, "by_reference", turned)
    rows: list[Any] = decisions_table(["lstm"], WINDOWS, quick=True).rows
    assert min(row[4] for row in rows) > 1e-3 and max(row[3] for row in rows) > 0


def test_a_widened_graph_holds_no_float32() -> None:
    graph = widened(shipped()["lstm"].read_bytes()).graph
    tensors = [
        *graph.initializer,
        *(a.t for n in graph.node for a in n.attribute if a.type == onnx.AttributeProto.TENSOR),
    ]
    assert {tensor.data_type for tensor in tensors} >= {TensorProto.DOUBLE}
    assert TensorProto.FLOAT not in {tensor.data_type for tensor in tensors}
