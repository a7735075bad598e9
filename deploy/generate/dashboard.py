"""The Grafana dashboard: a table of panels, and the JSON that Grafana reads (schema 39, Grafana 10.4 and newer)."""

import json
from dataclasses import dataclass
from typing import Any

WIDTH = 24  # columns of Grafana's grid
SOURCE = {"type": "prometheus", "uid": "${source}"}
RATE = "[$__rate_interval]"


@dataclass(frozen=True)
class Panel:
    """One panel. `queries` are pairs of PromQL and legend; width and height are in steps of Grafana's grid."""

    title: str
    queries: tuple[tuple[str, str], ...]
    kind: str = "timeseries"
    unit: str = "short"
    width: int = 8
    height: int = 8
    stacked: bool = False
    thresholds: tuple[tuple[float | None, str], ...] = ()


GOOD_AT_ONE = ((None, "red"), (1.0, "green"))
GOOD_AT_ZERO = ((None, "green"), (1.0, "red"))


def stat(title: str, query: str, legend: str, unit: str = "short", **more: Any) -> Panel:
    """A panel with a number, for the top of the dashboard."""
    return Panel(title, ((query, legend),), "stat", unit, 4, 4, **more)


def quantiles(metric: str) -> tuple[tuple[str, str], ...]:
    """The queries for median and 95th percentile of a histogram."""
    rate = f"sum by (le) (rate({metric}_bucket{RATE}))"
    return tuple((f"histogram_quantile({q}, {rate})", name) for q, name in ((0.5, "median"), (0.95, "95 %")))


PANELS = (
    stat("Answers", 'up{job="gestured"}', "{{instance}}", thresholds=GOOD_AT_ONE),
    stat("Model", "gestured_active_model_info", "{{model}} {{version}}"),
    stat("Rung in use (0 is the best)", "gestured_model_rung", "{{instance}}", thresholds=GOOD_AT_ZERO),
    stat("Running for", "time() - gestured_start_time_seconds", "{{instance}}", "s"),
    stat("Sensors heard", "gestured_sensors", "{{instance}}"),
    stat("Subscribers", "gestured_clients", "{{instance}}"),
    Panel("Gestures a minute", ((f"60 * sum by (gesture) (rate(gestured_gestures_total{RATE}))", "{{gesture}}"),),
          stacked=True, width=12),
    Panel("Not published, a minute", (
        (f"60 * sum(rate(gestured_unknown_total{RATE}))", "unknown"),
        (f"60 * sum by (reason) (rate(gestured_cancelled_total{RATE}))", "cancelled: {{reason}}")), width=12),
    Panel("Release to event", quantiles("gestured_latency_seconds"), unit="s"),
    Panel("Inference", quantiles("gestured_inference_seconds"), unit="s"),
    Panel("Confidence of what was published", quantiles("gestured_confidence"), unit="percentunit"),
    Panel("Provisional events, a minute", (
        (f"60 * sum by (result) (rate(gestured_provisional_total{RATE}))", "{{result}}"),)),
    Panel("Provisional events that were confirmed", (
        (f'sum(rate(gestured_provisional_total{{result="confirmed"}}{RATE})) / '
         f'sum(rate(gestured_provisional_total{{result=~"confirmed|revoked"}}{RATE}))', "share"),), unit="percentunit"),
    Panel("Provisional event to answer", quantiles("gestured_provisional_lead_seconds"), unit="s"),
    Panel("Sensor state", (("gestured_sensor_state", "{{sensor}}: {{state}}"),)),
    Panel("Frames a second", (("gestured_sensor_rate_hertz", "{{sensor}}"),), unit="hertz"),
    Panel("Jitter", (("gestured_sensor_jitter_seconds", "{{sensor}}"),), unit="s"),
    Panel("Frames not used, a second", (
        (f'sum by (sensor, result) (rate(gestured_frames_total{{result!="ok"}}{RATE}))', "{{sensor}}: {{result}}"),)),
    Panel("Bad taxels", (("gestured_sensor_bad_taxels", "{{sensor}}"),)),
    Panel("Baseline drift, in units of noise", (("gestured_sensor_drift_ratio", "{{sensor}}"),)),
    Panel("Gestures outside of the training data", (("gestured_shift_ratio", "{{quantity}}"),), unit="percentunit"),
    Panel("Packets dropped, a second", (
        (f"sum by (reason) (rate(gestured_dropped_total{RATE}))", "{{reason}}"),
        (f"rate(gestured_kernel_drops_total{RATE})", "by the kernel"))),
    Panel("Loop lag", (("gestured_loop_lag_seconds", "{{instance}}"),), unit="s"),
    Panel("Subscribers' backlog", (("gestured_backlog_bytes", "{{instance}}"),), unit="bytes"),
    Panel("Subscribers in trouble, a second", (
        (f"rate(gestured_client_lines_lost_total{RATE})", "lines lost"),
        (f"sum by (reason) (rate(gestured_clients_evicted_total{RATE}))", "cut off: {{reason}}"))),
    Panel("Reloads, model failures, bugs", (
        ("sum by (result) (increase(gestured_reloads_total[1h]))", "reload {{result}}"),
        ("increase(gestured_model_failures_total[1h])", "model put aside"),
        ("increase(gestured_internal_errors_total[1h])", "bug"))),
)  # fmt: skip


def dashboard() -> str:
    """The dashboard as JSON; its panels are laid out from left to right."""
    x = y = row = 0
    panels = []
    for number, panel in enumerate(PANELS, 1):
        if x + panel.width > WIDTH:
            x, y, row = 0, y + row, 0
        panels.append(_panel(number, panel, x, y))
        x, row = x + panel.width, max(row, panel.height)
    return json.dumps(_around(panels), indent=2) + "\n"


def _panel(number: int, panel: Panel, x: int, y: int) -> dict[str, Any]:
    defaults: dict[str, Any] = {"unit": panel.unit}
    if panel.thresholds:
        steps = [{"value": value, "color": color} for value, color in panel.thresholds]
        defaults["thresholds"] = {"mode": "absolute", "steps": steps}
    if panel.stacked:
        defaults["custom"] = {"stacking": {"mode": "normal"}, "fillOpacity": 30}
    return {
        "id": number,
        "type": panel.kind,
        "title": panel.title,
        "datasource": SOURCE,
        "gridPos": {"x": x, "y": y, "w": panel.width, "h": panel.height},
        "fieldConfig": {"defaults": defaults, "overrides": []},
        "options": {"textMode": "name"} if panel.title == "Model" else {},
        "targets": [
            {"refId": chr(ord("A") + i), "datasource": SOURCE, "expr": query, "legendFormat": legend}
            for i, (query, legend) in enumerate(panel.queries)
        ],
    }


def _around(panels: list[dict[str, Any]]) -> dict[str, Any]:
    source = {"name": "source", "label": "Source", "type": "datasource", "query": "prometheus"}
    return {
        "uid": "gestured",
        "title": "gestured",
        "schemaVersion": 39,
        "refresh": "10s",
        "time": {"from": "now-1h", "to": "now"},
        "templating": {"list": [source]},
        "panels": panels,
    }
