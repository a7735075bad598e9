"""When the model that ships says what, and how often it is wrong: answers, and what it says before them."""

from gestured.lab.study.said import said
from gestured.model.opening import open_model
from gestured.model.shipped import shipped


def test_what_is_said_before_the_end_is_there_beside_the_answers() -> None:
    rows = {(row["group"], row["kind"]): row for row in said(open_model(shipped()["cnn_lstm"]), 4.0)}
    early, late = rows["swipes", "provisional"], rows["swipes", "final"]
    assert 0 < early["n"] <= late["n"] and early["p50_s"] < late["p50_s"]
    assert all(0 <= row["low"] <= row["wrong"] <= row["high"] <= 1 for row in rows.values())
