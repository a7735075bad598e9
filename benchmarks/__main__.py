"""The table of speed: `python -m benchmarks`, or parts of it, as `python -m benchmarks --only decode recognise`."""

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable
from dataclasses import asdict
from datetime import date
from pathlib import Path

from benchmarks.timing import Row
from gestured.lab.made_of import made_of, renew
from gestured.model.shipped import shipped


def _parts(model: str) -> dict[str, Callable[[], Row | list[Row]]]:
    from benchmarks import buses, idle, inside, latency, replay, scenes, side_by_side, small, start, traffic, viewers

    return {
        "decode": inside.decode,
        "idle": idle.idle_frames,
        "datagrams": lambda: [traffic.datagrams(model, 0, 0.3), traffic.datagrams(model, 6, 0.18)],
        "latency": lambda: latency.latency(model),
        "buses": lambda: buses.buses(model),
        "sensors": lambda: [traffic.sensors(model, 1000), traffic.sensors(model, 500)],
        "small": lambda: small.small(model),
        "recognise": lambda: inside.recognise(model),
        "follow": inside.follow,
        "replay": lambda: replay.replay(model),
        "start": lambda: start.start_and_memory(model),
        "imports": start.imports,
        "further": lambda: start.further_sensors(model),
        "subscribers": inside.subscribers,
        "viewers": lambda: viewers.viewers(model),
        "ordinary": lambda: side_by_side.ordinary(model),
        "subset": lambda: scenes.subset(model),
    }


def machine() -> str:
    """One line about this machine: its processor, cores, Python and load."""
    found = [line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    name = found[0].split(":")[1].strip() if found else platform.machine()
    return f"{name}, {os.cpu_count()} cores, Python {platform.python_version()}, load {os.getloadavg()[0]:.1f}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--model", default="cnn_lstm", help="model to measure (cnn_lstm)")
    parser.add_argument("--only", nargs="+", metavar="PART", help="parts of the table")
    parser.add_argument("--scenes", action="store_true", help="the table of scenes instead")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--document", type=Path, metavar="PAGE", help="a page whose block `bench` is written")
    args = parser.parse_args()
    if args.scenes:
        from benchmarks import scenes

        print(scenes.table(args.model))
        return 0
    parts = _parts(args.model)
    unknown = set(args.only or ()) - set(parts)
    if unknown:
        parser.error(f"--only: no part {', '.join(sorted(unknown))}; there are {', '.join(parts)}")
    rows, where = [], f"{date.today()}, {machine()}; printed by `make bench`:"
    told = ["| figure | gestured | against | ratio | to reach | |", "|---|---|---|---|---|---|"]
    if not args.json:
        print(where, "", *told, sep="\n", flush=True)
    for name in args.only or parts:
        try:
            found = parts[name]()
        except ImportError as error:
            found = Row(name, f"not measured: {error}", "", "", "", None)
        for row in found if isinstance(found, list) else [found]:
            rows.append(asdict(row))
            verdict = {True: "reached", False: "not reached", None: ""}[row.reached]
            told.append(f"| {' | '.join((row.figure, row.ours, row.against, row.ratio, row.goal, verdict))} |")
            if not args.json:
                print(told[-1], flush=True)
    if args.json:
        print(json.dumps({"machine": machine(), "rows": rows}, indent=2))
    if args.document:
        code = ("gestured.core.hub", "gestured.model.model")
        line = made_of(f'make bench ARGS="--document {args.document}"', shipped().values(), code)
        renew(args.document, "bench", [line, "", where, "", *told])
    return 0


if __name__ == "__main__":
    sys.exit(main())
