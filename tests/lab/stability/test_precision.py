"""What fewer digits cost: the tables say what was asked for, and that of a shipped network little changes."""

from types import SimpleNamespace
from typing import Any

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from gestured.lab.nets import CnnLstm
from gestured.lab.stability import precision
from tests.lab.made import gestures

WINDOWS = [gestures()["swipe_up"], gestures()["circle_clockwise"]]


def test_what_no_sensor_shows_costs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(precision, "NET_CLASSES", {"lstm": None})
    rows: dict[str, Any] = {str(row[1]): row for row in precision.precision_table(WINDOWS, quick=True).rows}
    (extreme,) = [row for what, row in rows.items() if what.startswith("float64")]
    assert extreme[2] > 5 and extreme[3] < 1e-4 and extreme[4] == 0
    halves, tenths = rows["counts of 2 steps at the peak"], rows["counts of 10 steps at the peak"]
    assert rows["float16 windows, as in training"][3] < tenths[3] < halves[3]
    assert sum(what.startswith("denormals") for what in rows) == 1


def test_the_states_norm_is_told_at_each_length(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    net = CnnLstm(9, 9, 12).eval()
    monkeypatch.setattr(precision, "loaded", lambda name, data: SimpleNamespace(net=net))
    monkeypatch.setattr(precision, "STATE_FRAMES", (3, 40))
    rows: list[Any] = precision.state_table(WINDOWS).rows
    assert [row[1] for row in rows] == [3, 40, 3, 40]
    frames = torch.from_numpy(WINDOWS[0][None, :3])
    with torch.no_grad():
        _, (said, kept) = net.lstm(net.features(frames))
    assert rows[0][2:] == (pytest.approx(float(kept.norm()), rel=1e-4), pytest.approx(float(said.norm()), rel=1e-4))
