"""Prometheus and Grafana: alerts fire when they should, and every query asks for what a real daemon says."""

import json
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from gestured.daemon.metrics import Counter, Metrics
from gestured.model.shipped import shipped
from tests.daemon.harness import Daemon, Sensor

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
RULES = DEPLOY / "prometheus" / "gestured.rules.yml"
WORDS = {
    "sum", "rate", "by", "unless", "time", "increase", "changes", "histogram_quantile",
    "__rate_interval", "job", "h", "m", "s",
}  # fmt: skip

promtool = pytest.mark.skipif(shutil.which("promtool") is None, reason="promtool is not installed (apt: prometheus)")


@promtool
@pytest.mark.parametrize(
    "command",
    [
        ("check", "config", "prometheus.yml"),
        ("check", "rules", "gestured.rules.yml"),
        ("test", "rules", "gestured.rules.test.yml"),
    ],
    ids=" ".join,
)
def test_promtool_agrees(command: tuple[str, ...]):
    done = subprocess.run(["promtool", *command], cwd=RULES.parent, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr


def test_each_alert_is_tested_where_it_fires_and_where_it_does_not():
    yaml = pytest.importorskip("yaml")
    alerts = {rule["alert"] for group in yaml.safe_load(RULES.read_text())["groups"] for rule in group["rules"]}
    tests = yaml.safe_load((RULES.parent / "gestured.rules.test.yml").read_text())["tests"]
    fires = {case["alertname"]: set() for test in tests for case in test["alert_rule_test"]}
    for case in (case for test in tests for case in test["alert_rule_test"]):
        fires[case["alertname"]].add(bool(case["exp_alerts"]))
    assert fires == dict.fromkeys(alerts, {True, False})


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that has seen a gesture, rubbish, and a reload that it refused."""
    if not shipped()["cnn_lstm"].exists():
        pytest.skip(f"{shipped()['cnn_lstm']} is not there")
    folder = tmp_path_factory.mktemp("metrics")
    (folder / "gestured.toml").write_text("")
    flags = ("--metrics", "127.0.0.1:0", "--clock", "sensor", "--config", folder / "gestured.toml")
    daemon = Daemon.start(folder, "cnn_lstm", *flags)
    try:
        with_answer = daemon.client().subscribe("gesture", "unknown")
        sensor = Sensor(daemon, "armrest").begin().perform("left")
        with_answer.line()
        sensor.sock.send(b"rubbish")
        (folder / "gestured.toml").write_text("modle = 1")
        daemon.signal(signal.SIGHUP)
        while daemon.metric("gestured_reloads_total", result="refused") == 0:
            pass
        yield daemon
        with_answer.close()
    finally:
        daemon.stop()


@pytest.fixture(scope="module")
def said(daemon: Daemon) -> str:
    """Its /metrics."""
    return daemon.get("/metrics")[1]


def known(text: str) -> dict[str, set[str]]:
    """Name of a sample -> labels it may have: those that were seen, and those that its counter declares."""
    found: dict[str, set[str]] = {"up": {"job", "instance"}}
    for name, kind in re.findall(r"^# TYPE (\w+) (\w+)$", text, re.MULTILINE):
        endings = ("_bucket", "_sum", "_count") if kind == "histogram" else ("",)
        found |= {name + ending: {"job", "instance"} for ending in endings}
    for name, labels in re.findall(r"^(\w+)\{(.*)\} ", text, re.MULTILINE):
        found[name] |= set(re.findall(r"(\w+)=", labels))
    for counter in vars(Metrics()).values():
        if isinstance(counter, Counter):
            found[counter.name + "_total"] |= set(counter.labels)
    found["gestured_shift_ratio"].add("quantity")  # says nothing before there were twenty gestures
    return found


def queries() -> dict[str, str]:
    """Every query of the dashboard and the rules, by where it stands."""
    board = json.loads((DEPLOY / "grafana" / "dashboards" / "gestured.json").read_text())
    found = {f"{panel['title']} {t['refId']}": t["expr"] for panel in board["panels"] for t in panel["targets"]}
    yaml = pytest.importorskip("yaml")
    groups = yaml.safe_load(RULES.read_text())["groups"]
    return found | {rule["alert"]: rule["expr"] for group in groups for rule in group["rules"]}


def test_every_query_asks_for_what_the_daemon_says(said: str):
    metrics = known(said)
    for where, query in queries().items():
        words = re.sub(r'"[^"]*"', "", query)
        names = {word for word in re.findall(r"[a-z_]\w*", words) if word == "up" or word.startswith("gestured_")}
        assert names and names <= set(metrics), f"{where}: {names - set(metrics)}"
        labels = set(re.findall(r"[a-z_]\w*", words)) - names - WORDS
        allowed = {"le"}.union(*(metrics[name] for name in names))
        assert labels <= allowed, f"{where}: {labels - allowed}"


def test_the_buckets_that_alerts_are_tested_with_are_the_daemons(said: str):
    buckets = r'(gestured_\w+_bucket)\{.*\b(le="[^"]+")'
    tested = set(re.findall(buckets, (RULES.parent / "gestured.rules.test.yml").read_text()))
    assert tested and tested <= set(re.findall(buckets, said))


@promtool
def test_promtool_finds_nothing_wrong_with_the_metrics(said: str):
    done = subprocess.run(["promtool", "check", "metrics"], input=said, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


@promtool
def test_prometheus_understands_every_query(tmp_path: Path):
    """promtool has no parser to call: each query becomes a recording rule."""
    rules = [
        {"record": f"q{i}", "expr": query.replace("$__rate_interval", "1m")}
        for i, query in enumerate(queries().values())
    ]
    (tmp_path / "queries.yml").write_text(json.dumps({"groups": [{"name": "dashboard", "rules": rules}]}))
    command = ["promtool", "check", "rules", str(tmp_path / "queries.yml")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
