"""`gesturectl shadow`: a candidate model beside the active one."""

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gestured.client.lines import Refused
from gestured.client.program import Commands
from gestured.client.say import say, say_json
from gestured.control.address import add_sockets, connect


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "shadow",
        help="run another model beside the active one",
        description="Have the daemon run a candidate model on the same segments as the active one. It publishes\n"
        "nothing; without MODEL, how far the two agree is printed. A restart ends it.",
        epilog="examples:\n  gesturectl shadow candidate.onnx\n  gesturectl shadow\n  gesturectl shadow --stop",
    )
    parser.add_argument("model", metavar="MODEL", nargs="?", help="a path that the daemon can read, or a shipped name")
    parser.add_argument("--stop", action="store_true", help="end it, and print what came of it")
    add_sockets(parser)
    parser.add_argument("--json", action="store_true", help="print the report as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Begin, end, or report; exit status 1 where there is nothing to report."""
    with connect(args) as control:
        if args.stop:
            report = control.ask("shadow", model=None)["shadow"]
        elif args.model is not None:
            # The daemon stands in another folder. What has neither a slash nor .onnx is a shipped model's name.
            path = Path(args.model)
            is_file = os.sep in args.model or (path.suffix == ".onnx" and path.exists())
            model = str(path.absolute()) if is_file else args.model
            try:
                report = control.ask("shadow", model=model)["shadow"]
            except Refused as error:
                hint = "; you see this file, the service sees neither /home nor /tmp: put it into /etc/gestured"
                unseen = path.is_file() and "cannot be opened" in str(error)
                raise Refused(f"{error}{hint if unseen else ''}") from error
        else:
            report = control.ask("status")["shadow"]
    if args.json:
        say_json(report)
    elif report is None:
        say("no model runs in the shadow")
    elif args.stop:
        say(f"{report['model']} runs in the shadow no longer; what came of it:", *words(report))
    elif args.model is not None:
        further = "gesturectl shadow reports, gesturectl shadow --stop ends it"
        say(f"{report['model']} runs in the shadow from now on: {further}")
    else:
        say(*words(report))
    return 1 if report is None else 0


def words(report: dict[str, Any]) -> Iterator[str]:
    """The lines of a report for a person."""
    dropped = f", {report['dropped']} dropped" if report["dropped"] else ""
    yield f"{report['model']} in the shadow: {report['segments']} segments, {report['failed']} failed{dropped}"
    if report["ended"] is not None:
        yield f"  {report['ended']}"
    if report["agreement"] is not None:
        yield (
            f"  agreement {100 * report['agreement']:.1f} %, mean confidence {report['confidence']:.2f} "
            f"(active {report['active_confidence']:.2f})"
        )
    for pair in report["disagreements"]:
        yield f"  {pair['count']:4d} x active {pair['active']}, candidate {pair['candidate']}"
