"""What a sensor's rate costs: simulated sessions of the same people on the nominal sensor at one rate after the other.

python -m experiments.rates --people 40
"""

import argparse
from dataclasses import replace
from pathlib import Path

from experiments.early import Ahead, heard, share_of
from experiments.pages import add_document, tell
from gestured.core.classifier import Classifier
from gestured.lab.dataset import truths
from gestured.lab.online import NON_GESTURE_SHARE, SESSION_S
from gestured.lab.progress import progress
from gestured.lab.table import Table, Value
from gestured.model.opening import open_model
from gestured.model.shipped import shipped
from gestured.simulator import Participant, SimulatedSensor, generator, session

RATES_HZ = (6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0, 30.0, 50.0, 100.0)
FIRST = 1000  # participant; training used 0 to 33


def row(model: Classifier, rate_hz: float, people: int) -> tuple[Value, ...]:
    """Shares of the gestures that were performed at a rate."""
    found = Ahead()
    for person in range(FIRST, FIRST + people):
        sensor = replace(SimulatedSensor.nominal(day=person), rate_hz=rate_hz)
        take = session(Participant(person), sensor, generator(person, 0xE4), SESSION_S, NON_GESTURE_SHARE)
        found.add(heard(take.times, take.frames, model, foresee=False), truths(take), SESSION_S / 60)
    return f"{rate_hz:g} Hz", len(found.counted["right"]), *(share_of(found.counted[name]) for name in HEAD[2:])


HEAD = ("rate", "gestures", "right", "wrong")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="cnn_lstm", help="a path, or a shipped model's name (%(default)s)")
    parser.add_argument("--people", type=int, default=40, help="participants, a session each (%(default)s)")
    add_document(parser, "rates")
    args = parser.parse_args()
    model = open_model(args.model)
    rows = [row(model, rate, args.people) for rate in progress(RATES_HZ, len(RATES_HZ), "rates")]
    table = Table(f"By the sensor's rate, simulated, {args.people} people", HEAD, rows)
    tell(table, [shipped().get(args.model, Path(args.model))], "rates", args.document)


if __name__ == "__main__":
    main()
