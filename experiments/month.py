"""A sensor that nobody touches for a month, in slow waves; then a swipe.

python -m experiments.month --days 30

A frame comes every 0.9 s, since a whole second without one is silence.
"""

import argparse
from collections import Counter

import numpy as np

from gestured.core.classifier import Classifier
from gestured.core.events import Event, Gesture, Onset
from gestured.core.facts import events_of
from gestured.core.frames import Frame
from gestured.core.scene import Scene
from gestured.core.sensor import Sensor
from gestured.lab.stability.path import IDLE_LEVEL, NOISE, labels, swipes
from gestured.lab.table import Table
from gestured.model.opening import open_model


def month_table(classifier: Classifier, days: float) -> Table:
    """What comes of it, and whether the swipe is found."""
    step, swing = 0.9, 50.0
    times = np.arange(int(days * 86_400 / step)) * step + 2.0
    rng = np.random.default_rng(30)
    sensor = Sensor("stability", Scene(classifier.gestures, (9, 9)), classifier)
    for k in range(30):
        sensor.push(Frame(k / 15, IDLE_LEVEL + NOISE * rng.standard_normal((9, 9))))
    heard: Counter[type] = Counter()
    for part in np.array_split(times, max(len(times) // 10_000, 1)):
        noise = NOISE * rng.standard_normal((len(part), 9, 9))
        noise += IDLE_LEVEL + swing * np.sin(2 * np.pi * part / 86_400.0)[:, None, None]
        for t, frame in zip(part, noise, strict=True):
            heard.update(map(type, events_of(sensor.push(Frame(float(t), frame)))))
    end = float(times[-1])
    level = IDLE_LEVEL + swing * float(np.sin(2 * np.pi * end / 86_400.0))
    off = level - sensor.front_end.baseline
    after, _ = swipes(1, level=level)
    found: list[Event] = []
    for t, frame in zip(after.times + end + 0.1, after.frames, strict=True):
        found += events_of(sensor.push(Frame(float(t), frame)))
    found += events_of(sensor.flush(end + 10.0))
    return Table(
        "Running means after a long time idle",
        ("days", "frames", "contacts", "gestures", "baseline off by (noise)", "noise found / true", "then a swipe is"),
        [
            (
                days,
                len(times),
                heard[Onset],
                heard[Gesture],
                float(np.abs(off).max() / NOISE),
                sensor.front_end.noise / NOISE,
                " ".join(labels(found)),
            )
        ],
        (
            "One frame every 0.9 s; the baseline swings by 50 counts a day. The worst taxel's baseline is off",
            "by its own noise: it follows with 2 s, so that of frames so far apart it averages few.",
        ),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=float, default=30.0, help="without a touch (%(default)s)")
    print(month_table(open_model("cnn_lstm"), parser.parse_args().days))


if __name__ == "__main__":
    main()
