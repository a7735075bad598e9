"""What waiting for a second tap costs and saves: simulated taps, answered with one wait after the other.

python -m experiments.taps --people 20
"""

import argparse
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from statistics import median

from experiments.pages import add_document, tell
from gestured.core.classifier import Classifier
from gestured.core.events import Gesture
from gestured.core.frames import Frame
from gestured.core.scene import DOUBLE_TAP, ONE_TAP, Scene
from gestured.core.sensor import Sensor
from gestured.lab.online import tallied
from gestured.lab.progress import progress
from gestured.lab.table import Table, Value
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import Participant, SimulatedSensor, Take, generator, session

WAITS_S = (0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6)
FIRST = 900  # participant; training used 0 to 33
SESSION_S = 120.0  # of one participant; long enough for some dozens of taps
TAPS = 100  # pairs of a single and a double tap: more than fit into a session


def takes(people: int) -> list[Take]:
    """A session of single and double taps of each new participant, on the nominal sensor."""
    kinds = [ONE_TAP, DOUBLE_TAP] * TAPS
    return [
        session(Participant(n), SimulatedSensor.nominal(day=n), generator(n, 0x7A), SESSION_S, 0.0, kinds=kinds)
        for n in range(FIRST, FIRST + people)
    ]


def read(model: Classifier, take: Take, wait_s: float) -> tuple[Counter[str], list[float]]:
    """Counts of what was performed and what was recognised, and how long right single taps waited for answers (s)."""
    rows, columns = take.frames.shape[1:]
    scene = Scene(gestures=model.gestures, grid=(rows, columns), tap_gap_s=wait_s)
    sensor = Sensor("pad", scene, model)
    found = [one for t, frame in zip(take.times, take.frames, strict=True) for one in sensor.push(Frame(t, frame))]
    found += sensor.flush(float(take.times[-1]))
    events = [{"type": "gesture"} | asdict(event) for event in found if isinstance(event, Gesture)]
    tally, outcomes = tallied(take, 0.0, events)
    counts = Counter({"missed": tally.counts["missed"]})
    waited = []
    for one in outcomes:
        if one.event is not None and one.performed is not None and one.verdict in ("right", "wrong"):
            counts[f"{one.performed.label} {one.event['gesture']}"] += 1
            if one.performed.label == one.event["gesture"] == ONE_TAP:
                waited.append(one.event["decided"] - one.event["offset"])
    counts.update(act.label for act in take.events)
    return counts, waited


def figures(model: str, people: int) -> list[tuple[Value, ...]]:
    """A row for each wait: shares of the taps performed, and the median wait of a single tap."""
    sessions, opened = takes(people), open_model(model)
    rows: list[tuple[Value, ...]] = []
    for wait_s in progress(WAITS_S, len(WAITS_S), "waits"):
        counts: Counter[str] = Counter()
        waited: list[float] = []
        for take in sessions:
            more, also = read(opened, take, wait_s)
            counts, waited = counts + more, waited + also
        single, double = max(counts[ONE_TAP], 1), max(counts[DOUBLE_TAP], 1)
        taken = ((DOUBLE_TAP, DOUBLE_TAP, double), (DOUBLE_TAP, ONE_TAP, double), (ONE_TAP, ONE_TAP, single))
        shares = (f"{counts[f'{done} {said}'] / of:.3f}" for done, said, of in taken)
        rows.append((f"{wait_s:.2f} s", *shares, f"{median(waited):.2f} s" if waited else "-"))
    return rows


HEAD = ("`tap_gap_s`", "double taps right", "read as two taps", "single taps right", "a single tap's answer after")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", help="a path, or a shipped model's name (%(default)s)")
    parser.add_argument("--people", type=int, default=20, help="participants, two minutes of taps each (%(default)s)")
    add_document(parser, "taps")
    args = parser.parse_args()
    table = Table("Taps by the time in which a second one counts", HEAD, figures(args.model, args.people))
    tell(table, [shipped().get(args.model, Path(args.model))], "taps", args.document)


if __name__ == "__main__":
    main()
