"""All counters of the daemon: plain integers, whether or not anybody asks for them.

The loop's thread counts, the HTTP thread reads copies (`exposition`). The number of series is bounded: labels that a
peer can choose, such as sensors, are counted together after the first few.
"""

import time
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from itertools import repeat

from gestured.core.events import Cancelled, Event, Gesture, Provisional, Unknown
from gestured.core.listening import DISARMED, INHIBITED

# At most 200 series, whatever arrives; a test counts them.
NAMED_SENSORS = 8  # further sensors are counted together as "other"
NAMED_MODELS = 3
NAMED_GESTURES = 12
NAMED_ZONES = 12
NAMED_GATES = 5
OTHER = "other"
# Upper bounds of histograms' buckets. A segment takes some milliseconds; an answer waits at least `release_s`.
INFERENCE_S = (0.0005, 0.001, 0.005, 0.025, 0.1)
LATENCY_S = (0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0)
LEAD_S = (0.1, 0.2, 0.3, 0.5, 0.75, 1.0)
CONFIDENCE_BUCKETS = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)


class Counter:
    """A total for each of the first `most` combinations of labels; all later ones are counted as "other"."""

    def __init__(
        self, name: str, text: str, *labels: str, most: int = 64, dated: bool = False, zeros: tuple[str, ...] = ()
    ) -> None:
        """`dated`: the counter also remembers when each combination was last counted.

        `zeros` are values of the one label that are exposed as 0 before they are counted, since Prometheus sees no
        increase from a series that is not there to its first value.
        """
        self.name, self.text, self.labels, self._most, self._dated = name, text, labels, most, dated
        self.zeros = [(value,) for value in zeros] if labels else [()]
        self.values: dict[tuple[str, ...], int] = {}
        self.last: dict[tuple[str, ...], float] = {}  # monotonic s

    def add(self, *labels: str, count: int = 1) -> None:
        """Count `count` more under these labels."""
        if labels not in self.values and len(self.values) >= self._most:
            labels = (OTHER,) * len(labels)
        self.values[labels] = self.values.get(labels, 0) + count
        if self._dated:
            self.last[labels] = time.monotonic()

    def total(self) -> int:
        """The sum over all labels."""
        return sum(list(self.values.values()))


class Histogram:
    """The number of values in each bucket, for the first `most` combinations of labels; later ones are "other"."""

    def __init__(self, name: str, text: str, bounds: Sequence[float], *labels: str, most: int = 1) -> None:
        self.name, self.text, self.bounds, self.labels, self._most = name, text, bounds, labels, most
        self.values: dict[tuple[str, ...], tuple[list[int], list[float]]] = {}

    def observe(self, value: float, *labels: str) -> None:
        """Count one value in the bucket that it falls into."""
        if labels not in self.values:
            if len(self.values) >= self._most:
                labels = (OTHER,) * len(labels)
            self.values.setdefault(labels, ([0] * (len(self.bounds) + 1), [0.0]))
        buckets, total = self.values[labels]
        buckets[bisect_left(self.bounds, value)] += 1
        total[0] += value


class Metrics:
    """All counters of one daemon."""

    def __init__(self) -> None:
        self.frames = Counter("gestured_frames", "Frames by what became of them", "sensor", "result")
        self.dropped = Counter("gestured_dropped", "Packets and messages that were dropped", "reason", dated=True)
        text = "Time tags replaced by the arrival time"
        self.implausible = Counter("gestured_implausible_time_tags", text, dated=True)
        self.gestures = Counter("gestured_gestures", "Recognised gestures", "gesture", most=NAMED_GESTURES)
        text = "Recognised gestures by the zone they began in"
        self.zones = Counter("gestured_zone_gestures", text, "sensor", "zone", most=NAMED_ZONES)
        self.unknown = Counter("gestured_unknown", "Segments that are none of the gestures")
        text = "Segments that did not count, by the gates that were closed"
        self.suppressed = Counter("gestured_suppressed", text, "reason", "gate", most=NAMED_GATES)
        self.cancelled = Counter("gestured_cancelled", "Segments that were not answered", "reason", zeros=("model",))
        self.provisional = Counter("gestured_provisional", "Provisional events by what became of them", "result")
        text = "From a provisional event that was confirmed to its answer"
        self.lead = Histogram("gestured_provisional_lead_seconds", text, LEAD_S)
        self.internal_errors = Counter("gestured_internal_errors", "Bugs that were caught", dated=True)
        self.degraded = Counter("gestured_degraded_answers", "Segments answered by a fallback model")
        text = "Reloads of model and configuration"
        self.reloads = Counter("gestured_reloads", text, "result", dated=True, zeros=("refused",))
        self.sent = Counter("gestured_osc_messages", "OSC messages to destinations", "result", dated=True)
        self.lost_lines = Counter("gestured_client_lines_lost", "Lines that slow clients did not get", dated=True)
        self.evicted = Counter("gestured_clients_evicted", "Clients cut off or turned away", "reason", dated=True)
        text = "Time to classify a segment that was decided"
        self.inference = Histogram("gestured_inference_seconds", text, INFERENCE_S, "model", most=NAMED_MODELS)
        self.latency = Histogram("gestured_latency_seconds", "From the last touched frame to the event", LATENCY_S)
        self.confidence = Histogram("gestured_confidence", "Confidence of the published gestures", CONFIDENCE_BUCKETS)
        self.kernel_drops, self.kernel_dropped_at = 0, 0.0  # packets so far, and monotonic s when more were dropped
        self._named: dict[str, str] = {}  # the labels of the first few sensors, by name
        self._said: dict[str, float] = {}  # by sensor: s, when its last unanswered provisional event was decided

    def kernel(self, drops: int) -> None:
        """Take the number of packets that the kernel has dropped so far, and note the time if there are more."""
        if drops > self.kernel_drops:
            self.kernel_drops, self.kernel_dropped_at = drops, time.monotonic()

    def event(self, event: Event, late_s: float = 0.0) -> None:
        """Count an event that was published `late_s` after its decision, its latency and its confidence."""
        if isinstance(event, Gesture | Unknown):
            self.latency.observe(event.decided - event.offset + late_s)
            if event.degraded:
                self.degraded.add()
        if isinstance(event, Provisional):
            self.provisional.add("given")
            self._said[event.sensor] = event.decided
        elif isinstance(event, Gesture | Unknown | Cancelled) and event.provisional:
            self.provisional.add(event.provisional)
            said = self._said.pop(event.sensor, None)
            if isinstance(event, Gesture) and event.provisional == "confirmed" and said is not None:
                self.lead.observe(event.decided - said)
        if isinstance(event, Gesture):
            self.gestures.add(event.gesture)
            self.confidence.observe(event.confidence)
            if event.where is not None and event.where.zone is not None:
                self.zones.add(event.sensor, event.where.zone)
        elif isinstance(event, Unknown):
            self._unknown(event)
        elif isinstance(event, Cancelled):
            self.cancelled.add(event.reason)

    def _unknown(self, event: Unknown) -> None:
        if event.reason not in (DISARMED, INHIBITED):
            self.unknown.add()
            return
        for gate in event.gates or ("",):
            self.suppressed.add(event.reason, gate)

    def sensor_label(self, sensor: str) -> str:
        """The label of a sensor: its name for the first few sensors, "other" for all later ones."""
        if len(self._named) < NAMED_SENSORS:
            self._named.setdefault(sensor, sensor)
        return self._named.get(sensor, OTHER)

    def sensor_labels(self, sensors: Sequence[str]) -> Iterable[str]:
        """The labels of sensors, in their order."""
        if len(self._named) < NAMED_SENSORS:
            return map(self.sensor_label, sensors)
        return map(self._named.get, sensors, repeat(OTHER))  # called for each frame, so without a loop of Python
