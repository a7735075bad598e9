"""`gestured`: the daemon's command line."""

import argparse
import os
import signal
from collections.abc import Sequence
from typing import Any

from gestured import __version__
from gestured.core.errors import GesturedError, ModelError, SettingsError
from gestured.core.points import STRICTNESS

EXAMPLE = """\
example:
  gestured --model cnn_lstm.onnx --listen 127.0.0.1:9000 --publish osc://127.0.0.1:9001 \\
           --socket /run/gestured/events.sock --metrics 127.0.0.1:9108 --config gestured.toml

Each flag is a variable (GESTURED_MODEL=...) and a key of the TOML file (model = "...") too; flags win over
variables, these over the file. The file also takes [sensors.NAME] (grid, rotate, mirror, invert, clock, zones,
strictness, arming), [gestures.NAME] (threshold, refractory_s), [addresses] (pressure, trajectory), [arming] (by,
seconds) and [gates] (start, socket). SIGHUP reads it again.

exit status:
  0 ended as asked, 2 usage or invalid configuration, 3 a model that cannot be used and no fallback,
  4 an address or socket that cannot be bound"""

METAVARS = {
    "model": "MODEL", "fallback": "MODEL", "listen": "HOST:PORT", "publish": "osc://HOST:PORT",
    "socket": "PATH", "control": "PATH", "gates": "PATH", "metrics": "HOST:PORT", "grid": "RxC", "gestures": "A,B",
    "strictness": "|".join(STRICTNESS), "clock": "arrival|sensor",
    "allow": "CIDR", "flight_recorder": "MIB", "own_gestures": "FILE", "log_level": "LEVEL",
}  # fmt: skip
OF_TYPE: dict[object, str] = {bool: "true|false", int: "N", float: "SECONDS"}  # for keys that METAVARS does not have


def parser() -> argparse.ArgumentParser:
    """The parser of the flags: one for each setting, with the description and the default of the setting."""
    from gestured.daemon.settings import FLAGS, REPEATED, Settings

    flags = argparse.ArgumentParser(
        prog="gestured",
        description="Recognises touch gestures in pressure frames that arrive by OSC, and publishes them.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    for key in FLAGS:
        field = Settings.model_fields[key]
        text = field.description or ""
        if key in REPEATED:
            text += "; may be repeated"
        elif field.default is not None:
            text += f" (default: {str(field.default).lower() if isinstance(field.default, bool) else field.default})"
        flags.add_argument(
            "--" + key.replace("_", "-"),
            action="append" if key in REPEATED else "store",
            metavar=METAVARS.get(key) or OF_TYPE.get(field.annotation, key.upper()),
            help=text.replace("%", "%%"),
            default=argparse.SUPPRESS,
        )
    flags.add_argument("--config", metavar="FILE", help="TOML file with the same keys", default=argparse.SUPPRESS)
    flags.add_argument("--explain", action="store_true", help="say what this configuration does, and exit")
    flags.add_argument("--version", action="version", version=f"gestured {__version__}")
    return flags


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `gestured`; returns the exit status."""
    for number in range(3):  # no file that is opened later may get the number of a standard stream that is closed
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    # Until the daemon has its own handlers, a stop is no failure, and a reload has nothing to reload. Modules that take
    # long to import are imported only after this; some would turn an exception of a handler into an error of their own.
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: os._exit(0))
    # Other daemons take SIGUSR1 and SIGUSR2, for instance to reopen their logs; this one would be ended by them.
    for number in (signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(number, signal.SIG_IGN)
    # A process inherits its parent's signal mask, in which these signals may be blocked.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM, signal.SIGINT, signal.SIGHUP})
    given: dict[str, Any] = vars(parser().parse_args(arguments))
    explain = given.pop("explain")
    from gestured.daemon import log
    from gestured.daemon.merge import from_environment, load_settings

    try:
        settings, sources = load_settings(given, os.environ)
        log.configure(settings.log_level)
        for name in from_environment(os.environ)[1]:
            log.log.warning("a variable that is no setting", variable=name)
        if explain:
            from gestured.daemon.explain import explain as describe

            try:
                # Not sys.stdout, which Python would flush again at exit; and it may be unable to encode a path.
                with open(log.STDOUT, "w", errors="backslashreplace", closefd=False) as out:
                    print(describe(settings, sources), file=out)
            except BrokenPipeError:
                pass  # the reader has closed the pipe, as `head` does
            except OSError as error:
                log.print_log(f"gestured: standard output cannot be written: {error.strerror}")
                return 1
            return 0
        from gestured.daemon.start import run

        run(settings, lambda: load_settings(given, os.environ)[0])
    except GesturedError as error:
        log.print_log(f"gestured: {error}")
        return 2 if isinstance(error, SettingsError) else 3 if isinstance(error, ModelError) else 4
    finally:
        log.close()
    return 0
