"""Sensors with few counts: gestures whose peak has 2 to 100 counts, through the whole path.

python -m experiments.coarse --document docs/numerics.md
"""

import argparse
from collections.abc import Mapping

import numpy as np

from experiments.pages import add_document, tell
from gestured.core.classifier import Classifier
from gestured.lab.stability.extremes import Series, events, labels, simulated_series
from gestured.lab.table import Table, Value
from gestured.model.opening import open_model
from gestured.model.shipped import LADDER, shipped

PEAKS = (2, 3, 4, 6, 10, 30, 100)  # counts


def with_peak(stream: Series, counts: int) -> Series:
    """A series in whole counts, scaled so that its peak above the idle sensor is so many `counts`."""
    idle = np.median(stream.frames, axis=0)
    unit = float((stream.frames - idle).max()) / counts
    return Series(stream.times, np.rint(stream.frames / unit))


def coarse_table(models: Mapping[str, Classifier], count: int) -> Table:
    """A row for each peak: shares of `count` simulated gestures that each model names rightly, and wrongly."""
    takes = list(simulated_series(count))
    changes = {"as it is": [stream for _, stream in takes]}
    changes |= {f"{peak} counts": [with_peak(stream, peak) for _, stream in takes] for peak in PEAKS}
    rows: list[tuple[Value, ...]] = []
    for title, streams in changes.items():
        cells: list[Value] = []
        for model in models.values():
            said = [labels(events(stream, model)) for stream in streams]
            right = sum(found == (kind,) for found, (kind, _) in zip(said, takes, strict=True))
            wrong = sum(any(label in model.gestures and label != kind for label in found)
                        for found, (kind, _) in zip(said, takes, strict=True))  # fmt: skip
            cells.append(f"{100 * right / count:.1f} % ({100 * wrong / count:.1f} %)")
        rows.append((title, *cells))
    return Table(
        "Few counts: gestures named rightly, and wrongly, through the whole path",
        ("peak of the gesture", *models),
        rows,
        (
            f"{count} simulated gestures of ten kinds, their counts divided and rounded to whole numbers before",
            "the front end. Rightly: one answer, the gesture that was performed; in brackets the share with any",
            "other gesture.",
        ),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--takes", type=int, default=60, help="simulated gestures (%(default)s)")
    add_document(parser, "few counts")
    args = parser.parse_args()
    table = coarse_table({name: open_model(name) for name in LADDER}, args.takes)
    tell(table, shipped().values(), "few counts", args.document)


if __name__ == "__main__":
    main()
