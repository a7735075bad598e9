"""The exposition: all numbers of the daemon in Prometheus's text format, made only when /metrics is asked for."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from gestured.core.beside.reading import STATES
from gestured.daemon.metrics import Counter, Histogram, Metrics

Status = Mapping[str, Any]  # what `status.status` returns


def exposition(metrics: Metrics, status: Status) -> bytes:
    """The text of /metrics: counters, and gauges of a status. Imports prometheus_client."""
    from prometheus_client import CollectorRegistry, generate_latest

    registry = CollectorRegistry()
    registry.register(_Collector(metrics, status))
    return generate_latest(registry)


# Figures by sensor. Sensors that share a label show one figure: the worst among them, or the sum of bad taxels.
_OF_SENSORS: tuple[tuple[str, str, Callable[[Iterable[float]], float], str], ...] = (
    ("gestured_sensor_rate_hertz", "Frames a second", min, "rate_hz"),
    ("gestured_sensor_jitter_seconds", "Interarrival jitter of packets", max, "jitter_s"),
    ("gestured_sensor_bad_taxels", "Taxels that are bridged from their neighbours", sum, "bad_taxels"),
    ("gestured_sensor_drift_ratio", "How far the baseline has gone, in units of noise", max, "drift"),
)


def _of_the_daemon(status: Status) -> Iterator[tuple[str, str, float]]:
    """Name, help and value of each figure without a label; names of counters end in `_total`."""
    sensors = status["sensors"].values()
    yield "gestured_sensors", "Sensors that were heard", sum("source" in one for one in sensors)
    yield "gestured_sensors_silent", "Sensors of which a gate is closed", sum(bool(one["closed"]) for one in sensors)
    yield "gestured_clients", "Clients of the event socket", status["output"]["subscribers"]
    yield "gestured_backlog_bytes", "Bytes that wait for slow clients", status["output"]["backlog_bytes"]
    yield "gestured_kernel_drops_total", "Packets that the kernel dropped", status["input"]["kernel_drops"]
    late = "Seconds by which the event loop runs late, or reads packets late"
    yield "gestured_loop_lag_seconds", late, status["loop_lag_s"]
    rung = "Place of the model that answers: 0 is the first, 1 its first fallback"
    yield "gestured_model_rung", rung, status["model"]["rung"]
    yield "gestured_model_failures_total", "Models put aside since the last reload", status["model"]["failures"]
    yield "gestured_start_time_seconds", "When the daemon started", status["started"]


class _Collector:
    """Reads all numbers once, for one answer to /metrics."""

    def __init__(self, metrics: Metrics, status: Status) -> None:
        self._metrics, self._status = metrics, status

    def collect(self) -> Iterator[Any]:
        from prometheus_client import core

        for metric in vars(self._metrics).values():
            if isinstance(metric, Counter):
                counter = core.CounterMetricFamily(metric.name, metric.text, labels=metric.labels)
                for labels, value in (dict.fromkeys(metric.zeros, 0) | metric.values).items():
                    counter.add_metric(labels, value)
                yield counter
            elif isinstance(metric, Histogram):
                histogram = core.HistogramMetricFamily(metric.name, metric.text, labels=metric.labels)
                empty = ([0] * (len(metric.bounds) + 1), [0.0])
                for labels, (buckets, total) in (dict(metric.values) or ({} if metric.labels else {(): empty})).items():
                    bounds = [*map(str, metric.bounds), "+Inf"]
                    cumulated = [sum(buckets[: i + 1]) for i in range(len(buckets))]
                    histogram.add_metric(labels, list(zip(bounds, cumulated, strict=True)), sum_value=total[0])
                yield histogram
        status = self._status
        for name, text, figure in _of_the_daemon(status):
            if name.endswith("_total"):
                yield core.CounterMetricFamily(name.removesuffix("_total"), text, value=figure)
            else:
                yield core.GaugeMetricFamily(name, text, value=figure)
        labelled: dict[str, list[Status]] = {}
        for name, sensor in status["sensors"].items():
            labelled.setdefault(self._metrics.sensor_label(name), []).append(sensor)
        for name, text, together, key in _OF_SENSORS:
            family = core.GaugeMetricFamily(name, text, labels=["sensor"])
            for label, sensors in labelled.items():
                family.add_metric([label], together(one[key] for one in sensors))
            yield family
        text = "1 for the state of a sensor"
        state = core.GaugeMetricFamily("gestured_sensor_state", text, labels=["sensor", "state"])
        for label, sensors in labelled.items():
            state.add_metric([label, max((one["state"] for one in sensors), key=STATES.index)], 1)
        yield state
        text = "Share of the last gestures outside of what the model was trained on"
        shift = core.GaugeMetricFamily("gestured_shift_ratio", text, labels=["quantity"])
        for quantity, share in status["shift"]["outside"].items():
            shift.add_metric([quantity], share)
        yield shift
        info = core.InfoMetricFamily("gestured_active_model", "The model that answers")
        info.add_metric([], {"model": status["model"]["active"], "version": status["version"]})
        yield info
