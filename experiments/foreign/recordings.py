"""Gestures of the second generator as a file of recordings, for `gestured-lab study --foreign FILE`.

    python -m experiments.foreign.recordings foreign.npz --n 20 --level nominal

Each take is of another person at another sensor. Takes that nobody can recognise are left out, as in `judge`.
"""

import argparse

import numpy as np

from experiments.foreign import GESTURES, LEVELS, take
from experiments.foreign.judge import visible
from gestured.client.values import npz
from gestured.record.arrays import write
from gestured.record.recordings import Recordings


def recordings(count: int, level: str = "nominal") -> Recordings:
    """`count` takes of each gesture as recordings, less those that nobody can recognise."""
    takes = [take(kind, seed, level) for kind in GESTURES for seed in range(count)]
    takes = [one for one in takes if visible(one)]
    return Recordings(
        frames=np.concatenate([one["frames"] for one in takes]),
        times=np.concatenate([one["times"] for one in takes]),
        offsets=np.cumsum([0, *(len(one["times"]) for one in takes)], dtype=np.int64),
        labels=np.array([one["label"] for one in takes]),
        subjects=np.arange(len(takes)),
        kinds=np.array([one["kind"] for one in takes]),
        onsets=np.array([np.searchsorted(one["times"], one["onset"]) for one in takes], np.int64),
        releases=np.array([np.searchsorted(one["times"], one["release"]) - 1 for one in takes], np.int64),
    )


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=npz, metavar="OUT", help="the .npz to write")
    parser.add_argument("--n", type=int, default=20, help="takes of each gesture (%(default)s)")
    parser.add_argument("--level", choices=LEVELS, default="nominal")
    args = parser.parse_args()
    made = recordings(args.n, args.level)
    write(args.out, made)
    print(f"{args.out}: {len(made)} gestures")


if __name__ == "__main__":
    main()
