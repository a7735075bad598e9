"""What a wait for a second tap costs and saves, as gestured-lab prints it."""

import json

from gestured.lab import taps
from gestured.lab.cli import main


def test_a_shorter_wait_answers_sooner_and_reads_more_double_taps_as_two(monkeypatch, capsys):
    monkeypatch.setattr(taps, "WAITS_S", (0.2, 0.5))
    monkeypatch.setattr(taps, "SESSION_S", 40.0)
    assert main(["taps", "--people", "2", "--json"]) == 0
    short, long = json.loads(capsys.readouterr().out)
    assert short["tap_answered_after_s"] < long["tap_answered_after_s"] - 0.2
    assert short["double_taps_read_as_taps"] > long["double_taps_read_as_taps"]
    assert short["double_taps_right"] < long["double_taps_right"]
    assert min(short["taps"], short["double_taps"]) >= 10 and long["taps_right"] >= short["taps_right"] - 0.1
    assert main(["taps", "--people", "1"]) == 0
    origin, head, rule, *rows = capsys.readouterr().out.splitlines()
    assert "gestured-lab taps" in origin and "`tap_gap_s`" in head and head.count("|") == rule.count("|")
    assert [row[:6] for row in rows] == ["| 0.20", "| 0.50"]
