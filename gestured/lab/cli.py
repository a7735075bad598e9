"""`gestured-lab`: train, evaluate and measure. Needs the extra [lab] (torch, scikit-learn, onnx)."""

import argparse
import io
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from gestured.client.program import INTERRUPTED, Parser, program, run
from gestured.client.say import say
from gestured.client.stop import stop_as_by_ctrl_c, stop_later
from gestured.client.values import number
from gestured.core.errors import GesturedError

CACHE = Path(".cache/lab")
MODELS = Path("models")
JOBS = number(1, 1000, whole=True)
LAB_PACKAGES = ("torch", "sklearn", "onnx", "pywt", "jinja2", "matplotlib")
FILES = {"everyday": "svg", "adapt": "out", "import": "out"}  # the flag that names a file to be written
# Flags that name a folder in which files are written.
FOLDERS = {
    "train": ("out", "cache"), "evaluate": ("models", "cache"), "adapt": ("cache",), "study": ("out", "cache"),
    "collect": ("out",),
}  # fmt: skip
KEEPS = ("train", "adapt", "evaluate", "study", "collect")  # commands that can be continued after an interruption
# The module whose `run` each command is. It is imported only for that command, since some imports take seconds, or need
# packages that others do not.
PROGRAMS = {
    "train": "gestured.lab.commands",
    "evaluate": "gestured.lab.commands",
    "adapt": "gestured.lab.adapt.command",
    "everyday": "gestured.lab.everyday.command",
    "stability": "gestured.lab.stability.command",
    "study": "gestured.lab.study.study",
    "collect": "gestured.lab.recordings.collect",
    "import": "gestured.lab.recordings.importing",
    "forget": "gestured.lab.recordings.forget",
}


def parser() -> Parser:
    """The command line; every subcommand's help has an example."""
    from gestured.core.listening import Arming
    from gestured.core.points import STRICTNESS, USUAL
    from gestured.lab.recordings.flags import add_recordings

    top, commands = program(
        "gestured-lab", "COMMAND", "Train and evaluate gestured's models.",
        "example: gestured-lab train --out models",
    )  # fmt: skip

    def add(name: str, text: str, example: str) -> Parser:
        command = commands.add_parser(
            name, help=text, description=text, epilog=f"example: {example}", formatter_class=argparse.HelpFormatter
        )
        command.add_argument("--json", action="store_true", help="print the figures as JSON")
        command.set_defaults(command=name, run=_run)
        return command

    def add_data(command: Parser) -> None:
        text = f"where finished steps are kept (default: {CACHE})"
        command.add_argument("--cache", type=Path, default=CACHE, help=text)
        command.add_argument("--jobs", type=JOBS, default=2, help="processes and threads (default: 2)")
        command.add_argument("--quick", action="store_true", help="a small run to try it; its models are worth nothing")
        text = "folder of real recordings, as docs/training.md has it (default: simulated people alone)"
        command.takes("--real", "FOLDER", text, type=Path)

    mine: dict[str, Any] = {"type": Path, "nargs": "+", "default": [], "metavar": "FILE"}
    train = add("train", "train the three models from nothing; goes on where it was interrupted",
                "gestured-lab train --out models --jobs 2")  # fmt: skip
    train.add_argument("--out", type=Path, default=MODELS, help=f"folder for the models (default: {MODELS})")
    train.add_argument("--recordings", **mine, help="recordings of your own to learn from, too")
    add_data(train)
    adapt = add("adapt", "train a shipped model further with recordings of your own, and print what that is worth; "
                "writes nothing, with exit status 1, unless it is better",
                "gestured-lab adapt recordings/*.npz --out my.onnx")  # fmt: skip
    adapt.takes("recordings", "FILE", "recordings of your own (.npz), and perhaps tapes in which nobody made a gesture "
                "(.mcap): with tapes, the model learns to be silent", type=Path, nargs="+")  # fmt: skip
    adapt.takes("--out", "MODEL", "a new file for the model (*.onnx)", type=Path, required=True)
    adapt.takes("--base", "MODEL", "cnn_lstm, lstm, or a file (default: cnn_lstm)", default="cnn_lstm")
    text = "take recordings with this name of your own as non-gestures (default: leave them out)"
    adapt.takes("--as-none", "NAME", text, action="append", default=[])
    adapt.add_argument("--force", action="store_true", help="write the model also where it is no better")
    adapt.takes("--cache", "DIR", "for simulated takes (default: gestured, in your cache folder)", type=Path)
    text = "training steps for each held-out group, without tapes (default: 200)"
    adapt.takes("--steps", "N", text, type=number(1, 10_000, whole=True), default=200)
    evaluate = add("evaluate", "print the accuracy of models on people that they have not learned from; "
                   "writes cards and manifest",
                   "gestured-lab evaluate --models models")  # fmt: skip
    evaluate.add_argument("--models", type=Path, default=MODELS, help=f"folder of the models (default: {MODELS})")
    text = "a page whose block `figures` is written anew, such as docs/figures.md, and others whose block `worst` is"
    evaluate.takes("--document", "PAGE", text, type=Path, nargs="+")
    evaluate.add_argument("--recordings", **mine, help="the recordings with which the models were trained")
    add_data(evaluate)
    everyday = add("everyday", "count false gestures in hours of everyday contact, simulated or of your own, and what "
                   "becomes of the gestures that were meant in them",
                   "gestured-lab everyday cnn_lstm --hours 10 --svg curve.svg")  # fmt: skip
    everyday.takes("model", "MODEL", "a shipped model, or a file (default: cnn_lstm)", nargs="?", default="cnn_lstm")
    text = "of simulated people, an hour each (default: 60)"
    everyday.add_argument("--hours", type=number(1, 100_000, whole=True), default=60, help=text)
    everyday.add_argument("--recordings", **mine, help="instead, hours of your own: tapes of gesturectl record, and "
                          ".npz; if they do not say what was performed, every gesture counts as false")  # fmt: skip
    everyday.takes("--arming", "GESTURE", "a gesture that arms the sensor: everybody makes it before each gesture that "
                   "is meant; without it no gesture counts", default="")  # fmt: skip
    text = f"how long a gesture keeps the sensor armed, with --arming (default: {Arming('').seconds:g} s)"
    everyday.takes("--seconds", "S", text, type=float, default=Arming("").seconds)
    everyday.add_argument("--strictness", choices=STRICTNESS, default=USUAL, help=f"operating point (default: {USUAL})")
    everyday.takes("--svg", "FILE", "draw missed against false, with every threshold", type=Path)
    text = "a page whose tables `everyday` are written anew, such as docs/everyday.md"
    everyday.takes("--document", "PAGE", text, type=Path)
    everyday.add_argument("--jobs", type=JOBS, default=2, help="processes (default: 2)")
    stability = add("stability", "measure filters, extreme and stiff inputs through the whole path, and models by "
                    "their answers",
                    "gestured-lab stability --quick")  # fmt: skip
    stability.add_argument("--quick", action="store_true", help="half a minute instead of some minutes")
    stability.takes("--document", "FILE", "a page whose tables are written anew, such as docs/numerics.md", type=Path)
    study = add("study", "compare every method of the paper, and some beyond it, under several protocols; "
                "writes its tables, its figures and study.json; goes on where it was interrupted",
                "gestured-lab study --out report/ --jobs 2")  # fmt: skip
    study.add_argument("--out", type=Path, default=Path("report"), help="folder for the report (default: report)")
    study.takes("--document", "PAGE", "a page whose block `study` is written anew, such as docs/study.md, with the "
                "picture beside it, and others whose block `choice` is, such as docs/figures.md",
                type=Path, nargs="+")  # fmt: skip
    study.takes("--foreign", "FILE", "recordings that judge, and teach nothing: of another generator "
                "(python -m experiments.foreign.recordings) or another sensor", type=Path)  # fmt: skip
    study.takes("--cluster", "ADDRESS", "compute on this Dask cluster, such as tcp://HOST:8786")
    add_data(study)
    add_recordings(add)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal that lacks some letters shows question marks
    given = sys.argv[1:] if arguments is None else arguments

    def made() -> Parser:
        from gestured.lab.made_of import command_of

        top = parser()
        top.set_defaults(words=command_of(["gestured-lab", *given]))
        return top

    return run(made, given)


def _run(args: argparse.Namespace) -> int:
    """Run the command that was asked for."""
    try:
        module = _program(args.command)
        _check(args)
        status: int = module.run(args)
        return status
    except BrokenPipeError:  # the reader of the output has closed it, as `head` does
        return 0
    except OSError as error:
        raise GesturedError(f"{error.filename}: {error.strerror}" if error.filename else str(error)) from error
    except KeyboardInterrupt:
        kept = "; what is finished is kept" if args.command in KEEPS else ""
        say("", f"gestured-lab: interrupted{kept}", to=sys.stderr)
        return INTERRUPTED


def _program(command: str) -> ModuleType:
    """Import the module that runs a command. Raises GesturedError if a package of the extra [lab] is missing.

    A request to stop, by Ctrl-C or SIGTERM, waits for the import, since a library that is half imported would end in a
    traceback. SIGTERM alone would leave the processes behind that --jobs starts.
    """
    stop_as_by_ctrl_c()
    try:
        with stop_later():
            return import_module(PROGRAMS[command])
    except ModuleNotFoundError as error:
        package = (error.name or "").split(".")[0]
        if package not in LAB_PACKAGES:
            raise
        raise GesturedError(f"{package} is missing: pip install 'gestured[lab]', or make lab") from error


def _check(args: argparse.Namespace) -> None:
    """Raise GesturedError for files and folders with which no command can work."""
    if getattr(args, "real", None) is not None and not args.real.is_dir():
        raise GesturedError(f"--real: {args.real} is no folder")
    file = getattr(args, flag := FILES.get(args.command, ""), None)
    if file and not (os.access(file.parent, os.W_OK) and (file.is_file() or not file.exists())):
        raise GesturedError(f"--{flag}: expected a file in a folder that can be written to, found {file}")
    for flag in FOLDERS.get(args.command, ()):
        if (folder := getattr(args, flag)) is not None:
            there = next(one for one in (folder, *folder.absolute().parents) if one.exists())
            if not (there.is_dir() and os.access(there, os.R_OK | os.W_OK | os.X_OK)):
                raise GesturedError(f"--{flag}: expected a folder that can be read and written, found {folder}")
