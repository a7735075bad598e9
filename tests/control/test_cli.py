"""gesturectl as a whole: each subcommand is there, and one does not load what only others need."""

import signal
import subprocess
import sys

import pytest

from gestured.client.stop import on_stop, stop_as_by_ctrl_c
from gestured.control.cli import SUBCOMMANDS, parser

HEAVY = ("pythonosc", "onnxruntime", "gestured.simulator", "gestured.model", "gestured.record.")
LIGHT = ("gestured.record.judge",)  # needs numpy alone, as all of core does


def named(argv: list[str]) -> tuple[str, ...]:
    """The subcommands that these arguments can reach."""
    (group,) = (action for action in parser(argv)._subparsers._group_actions)  # type: ignore[union-attr]
    return tuple(group.choices or ())


def test_the_table_names_what_its_modules_add():
    every = named([])
    assert every == tuple(name for names in SUBCOMMANDS.values() for name in names)
    for names in SUBCOMMANDS.values():
        assert all(named([name, "--json"]) == names for name in names)
    assert named(["nonsense"]) == named(["--version"]) == every


def test_a_command_that_asks_a_daemon_loads_no_simulator_and_no_model() -> None:
    code = "import sys; from gestured.control.cli import parser; [parser([word]) for word in sys.argv[1:]]"
    command = [sys.executable, "-c", f"{code}; print(*sys.modules)", "reload", "status", "listen", "gestures"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert [name for name in done.stdout.split() if name.startswith(HEAVY) and name not in LIGHT] == []


@pytest.mark.parametrize(
    ("command", "flag", "value"),
    [
        ("demo", "--seconds", "0"), ("simulate", "--seconds", "nan"), ("simulate", "--seconds", "-5"),
        ("demo", "--seconds", "nan"), ("demo", "--grid", "1x9"),
        ("enrol", "--examples", "many"),
        ("listen", "--types", "gestures"), ("listen", "--types", ""), ("listen", "--count", "one"),
        ("listen", "--count", "0"),
        ("record x.mcap", "--max-mib", "0"), ("record x.mcap", "--seconds", "-1"),
        ("replay x.npz", "--sensor", "a/b"), ("replay x.npz", "--speed", "0"),
        ("simulate", "--to", "nowhere"), ("simulate", "--to", "127.0.0.1:0"), ("simulate", "--to", "a..b:9000"),
        ("sniff", "--listen", f"{'a' * 64}:9000"), ("pad", "--listen", ".:9000"), ("simulate", "--sensor", "a/b"),
        ("simulate", "--kinds", "semaphore"), ("simulate", "--seed", "-1"), ("simulate", "--rate", "4"),
        ("simulate", "--rate", "nan"), ("simulate", "--blob", "int12"), ("simulate", "--everyday", "moon"),
        ("sniff", "--seconds", "0"), ("status", "--socket", ""), ("status", "--control", "/"),
        ("tune x.npz", "--budget", "0"), ("tune x.npz", "--budget", "nan"),
        ("inhibit --all --gate door", "--for", "0"), ("inhibit --all --gate door", "--for", "soon"),
        ("enrol knock --sensor arm", "--examples", "6"), ("enrol knock", "--sensor", "an arm"),
        ("recalibrate", "--sensor", "an arm"), ("emit swipe_left", "--sensor", "an arm"),
        ("allow arm", "--gate", "a door"),
    ],
)  # fmt: skip
def test_a_value_that_cannot_be_is_named_with_its_flag(run, command: str, flag: str, value: str) -> None:
    status, out, err = run(*command.split(), flag, value)
    assert (status, out) == (2, "")
    assert f"argument {flag}: " in err and value in err


@pytest.mark.parametrize(
    ("where", "command", "err"),
    [
        (">/dev/full", "doctor", "gesturectl: standard output cannot be written: No space left on device\n"),
        (">&-", "doctor", ""),  # it costs the words alone
        ("2>&-", "status --json", ""),  # the error is not said among the output
        ("2>/dev/full", "status", ""),
    ],
)
def test_an_output_that_takes_nothing_is_no_traceback(where: str, command: str, err: str) -> None:
    shell = ["sh", "-c", f'exec "$@" {where}', "sh", sys.executable, "-m", "gestured.control", *command.split()]
    done = subprocess.run([*shell, "--control", "/nowhere.ctl"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", err)


@pytest.mark.parametrize("handle", [stop_as_by_ctrl_c, lambda: on_stop(print)])
def test_what_nohup_started_outlives_its_terminal_and_a_blocked_stop_is_heard(handle) -> None:
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)}
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup leaves it
        handle()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGTERM) is not before[signal.SIGTERM]
        assert signal.SIGTERM not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in before.items():
            signal.signal(number, handler)
