"""From nothing to ready, and every way in which that ends early."""

import json
import os
import socket
import stat
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from gestured.core.errors import ModelError, SettingsError
from gestured.daemon.asked import open_ladder
from gestured.daemon.bound import bind_all
from gestured.daemon.explain import explain
from gestured.daemon.sockets import AddressError, UnixListener
from tests.daemon.harness import DEADLINE_S, Client, Daemon, lines_of
from tests.daemon.parts import settings_of


def run(*flags: object, env: dict[str, str] | None = None) -> tuple[int, str, str]:
    """Exit status and output of a daemon that is expected to end at once."""
    done = subprocess.run(
        [sys.executable, "-m", "gestured.daemon", *map(str, flags)],
        capture_output=True, text=True, timeout=DEADLINE_S, env=os.environ | (env or {}),
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def refused(status: int, *flags: object, env: dict[str, str] | None = None) -> str:
    """What a daemon says that ends with this status; it must be one sentence, and no traceback."""
    found, _, stderr = run(*flags, env=env)
    assert found == status, stderr
    last = stderr.strip().splitlines()[-1]
    assert last.startswith("gestured: ") and "Traceback" not in stderr
    return last


def test_the_ready_line_says_where_everything_is(start) -> None:
    daemon = start("--metrics", "127.0.0.1:0")
    assert list(daemon.ready) == ["type", "listen", "socket", "metrics", "model", "control"]
    assert daemon.ready["type"] == "ready" and daemon.ready["model"] == "tiny"
    assert not daemon.ready["listen"].endswith(":0") and not daemon.ready["metrics"].endswith(":0")
    assert Path(daemon.ready["control"]) == daemon.socket.with_suffix(".ctl")
    for path in (daemon.socket, daemon.socket.with_suffix(".ctl")):
        assert stat.S_IMODE(path.stat().st_mode) == 0o660  # for owner and group
    assert json.loads(daemon.get("/readyz")[1])["ready"] is True


def bound(*flags: object) -> dict[str, str | None]:
    """The addresses of a daemon with these flags; all that it has bound is let go. Raises AddressError."""
    found = bind_all(settings_of("--listen", "127.0.0.1:0", *flags)[0])
    try:
        return found.addresses()
    finally:
        found.close()


def test_a_socket_below_the_daemons_folder_is_found_from_any_other(tmp_path: Path) -> None:
    told = bound("--socket", os.path.relpath(tmp_path / "events.sock"))
    for name, path in (("socket", tmp_path / "events.sock"), ("control", tmp_path / "events.ctl")):
        assert told[name] == str(path.resolve())


def test_it_listens_on_ipv6_too(tmp_path: Path) -> None:
    try:
        socket.socket(socket.AF_INET6, socket.SOCK_DGRAM).bind(("::1", 0))
    except OSError as error:
        pytest.skip(f"no IPv6 here: {error}")
    assert str(bound("--socket", tmp_path / "s", "--listen", "[::1]:0")["listen"]).startswith("[::1]:")


@pytest.mark.parametrize(("key", "to"), [("listen", "127.0.0.1"), ("listen", "0.0.0.0"), ("metrics", "127.0.0.1")])
def test_an_address_that_is_taken_and_by_whom(tmp_path: Path, key: str, to: str) -> None:
    kind = socket.SOCK_DGRAM if key == "listen" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind((to, 0))
        if kind == socket.SOCK_STREAM:
            taken.listen()
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(AddressError, match=f"{key}: .*{address}.* in use: sudo ss"):
            bound("--socket", tmp_path / "s", f"--{key}", address)
    assert list(tmp_path.iterdir()) == []


def test_a_stale_socket_is_taken_over_and_anything_else_is_not(tmp_path: Path) -> None:
    path = tmp_path / "events.sock"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(path))
    assert bound("--socket", path)["socket"] == str(path)
    assert not path.exists()
    path.write_text("somebody's notes")
    with pytest.raises(AddressError, match="not a socket"):
        bound("--socket", path)
    assert path.read_text() == "somebody's notes"
    with socket.socket(socket.AF_UNIX) as alive:
        other = tmp_path / "other.sock"
        alive.bind(str(other))
        alive.listen()
        with pytest.raises(AddressError, match="another program"):
            bound("--socket", other)
        assert other.exists()
    missing = tmp_path / "no" / "such" / "folder.sock"
    with pytest.raises(AddressError, match=str(missing)):
        bound("--socket", missing)


def test_a_daemon_that_ends_late_leaves_the_socket_and_the_lock_of_the_one_in_its_place(tmp_path: Path) -> None:
    path = tmp_path / "events.sock"
    old = UnixListener(path)
    for file in tmp_path.iterdir():
        file.unlink()  # as where somebody has cleaned up, so that another daemon could start
    new = UnixListener(path)
    old.close()
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(path))
    with pytest.raises(AddressError, match="another gestured is using"):
        UnixListener(path)
    new.close()
    assert list(tmp_path.iterdir()) == []


def test_the_default_socket_is_the_sessions(model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flags = ("--model", model, "--listen", "127.0.0.1:0")
    with monkeypatch.context() as patch:
        for name, folder in (("RUNTIME_DIRECTORY", "/run/x"), ("XDG_RUNTIME_DIR", "/y")):
            patch.setenv(name, folder)
        assert "/run/x/events.sock" in explain(*settings_of(*flags))
    (tmp_path / "run").mkdir()
    daemon = Daemon(tmp_path, *flags, env={"XDG_RUNTIME_DIR": str(tmp_path / "run")})
    assert daemon.process.stdout is not None
    daemon.ready = json.loads(daemon.process.stdout.readline())
    assert daemon.socket == tmp_path / "run" / "gestured" / "events.sock"
    assert stat.S_IMODE(daemon.socket.parent.stat().st_mode) == 0o700
    assert daemon.client().hello["type"] == "hello"
    assert daemon.stop() == 0


@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
def test_a_daemon_whose_streams_are_closed_ends_as_asked(tmp_path: Path, closed: str) -> None:
    events = tmp_path / "e.sock"
    flags = ["--listen", "127.0.0.1:0", "--socket", str(events), "--own-gestures", str(tmp_path / "own.json")]
    command = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-m", "gestured.daemon", *flags]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        end, hello = time.monotonic() + DEADLINE_S, None
        while hello is None and time.monotonic() < end:
            with suppress(FileNotFoundError, ConnectionRefusedError):  # a socket has a path before it listens
                hello = Client(events).hello
            time.sleep(0.02)
        assert hello is not None  # its loop turns, and takes signals
        process.terminate()
        assert process.wait(DEADLINE_S) == 0
    finally:
        process.kill()
        process.wait()


def test_what_explain_says_to_a_full_disk_or_to_nobody_is_no_traceback(model: Path) -> None:
    command = [sys.executable, "-m", "gestured.daemon", "--model", str(model), "--explain"]
    full = subprocess.run(["sh", "-c", 'exec "$@" >/dev/full', "sh", *command], stderr=subprocess.PIPE, text=True)
    said = "gestured: standard output cannot be written: No space left on device\n"
    assert (full.returncode, full.stderr) == (1, said)
    reader, writer = os.pipe()
    os.close(reader)
    nobody = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert (nobody.returncode, nobody.stderr) == (0, "")


def unread(*flags: object, env: dict[str, str] | None = None) -> str:
    """What is said of flags, variables and a file that are no settings, before anything is started."""
    with pytest.raises(SettingsError) as found:
        settings_of(*flags, env=env or {})
    return str(found.value)


TWO = "a = {at = [0, 0, 1, 1]}\nb = {at = [0.4, 0, 0.6, 1]}"


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ('listen = "a\\u0000b:9000"', ("listen", "expected HOST:PORT")),
        ("modell = 'x'", ("modell", "did you mean model", "gestured.toml")),
        ("[gestures.one_tap]\nthreshold = true", ("gestures.one_tap.threshold = True", "expected a number")),
        ("[sensors.arm]\nrotate = 45", ("sensors.arm.rotate", "45", "0, 90, 180 or 270", "gestured.toml")),
        ("[gestures.one_tap]\nthreshold = 2", ("gestures.one_tap.threshold", "2", "less than or equal to 1")),
        ("[sensors.'arm rest']", ("'arm rest'", "expected a sensor's name, 1 to 64 of A-Z a-z 0-9 _ -")),
        ("[addresses]\npressure = 'x'", ("addresses", "pressure", "{sensor}")),
        ("[addresses]\ntrajectory = '/{sensor}/pressure'", ("gestured.toml): trajectory: expected an address that",)),
        ("[gestures.one_tap]\nthreshold = 0.8\ntouch = true", ("one_tap.touch", "touch above the first [table]")),
        ("[sensors.arm.arming]\nby = 'a'\nsecond = 3", ("sensors.arm.arming.second", "did you mean seconds")),
        ("[sensors.arm.zones.a]\nat = [0, 0, 1, 1]\ngesture = []", ("zones.a.gesture", "did you mean gestures?")),
        (f"[sensors.arm.zones]\n{TWO}", ("sensors.arm", "zones.a at", "zones.b at", "overlap, expected")),
        ('socket = "/tmp/\\u0000"', ("socket", "expected the path of a Unix socket")),
        ("[gestures]\nuse = 5", ("gestures.use = 5", "gestured.toml", "expected a list")),
        ("[gates]\nsocket = 5", ("gates.socket = 5", "gestured.toml", "path of a Unix socket")),
        ("[gates]\nstart = 'door'", ("gates.start = 'door'", "expected a list")),
        ("[arming]\nby = 5", ("arming.by = 5", "expected a text")),
        ("[arming]\nby = 'a'\nseconds = '3'", ("arming.seconds = '3'", "gestured.toml", "expected a number")),
        ("stale_s = '3'", ("stale_s = '3'", "gestured.toml", "expected a number")),
        ("max_sensors = '3'", ("max_sensors = '3'", "gestured.toml", "expected a whole number")),
        ("sensors.arm.mirror = 'true'", ("sensors.arm.mirror = 'true'", "expected true or false")),
        ("sensors.arm.zones.a.at = ['0', 0, 1, 1]", ("sensors.arm.zones.a.at.0 = '0'", "expected a number")),
        ("sensors.arm.zones.a.at = [0, 0, 1, 1, 1]", ("sensors.arm.zones.a.at = [", "expected four numbers")),
        ("sensors.arm.zones.a.at = [0, 0, 1, true]", ("sensors.arm.zones.a.at.3 = True", "expected a number")),
        ("sensors = 5", ("sensors = 5", "expected a table [sensors]")),
        ("max_sensors = 0", ("max_sensors", "0", "greater than or equal to 1")),
        ("listen = !", ("gestured.toml", "TOML", "line 1")),
        (
            "\ufeffgestures = []\n[gestures.one_tap]\nthreshold = 0.5",
            ("TOML", "key gestures is called use, and stands below [gestures]"),
        ),
        (
            "gates = '/g.sock'\n[gates]\nstart = ['a']",
            ("TOML", "key gates is called socket, and stands below [gates]"),
        ),
        (f"stale_s = {'1' * 5000}", ("gestured.toml", "TOML", "4300 digits")),
    ],
)
def test_a_file_that_is_not_valid(tmp_path: Path, file: str, said: tuple[str, ...]) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text(file)
    text = unread("--config", config)
    assert all(word in text for word in said), text


@pytest.mark.parametrize(
    ("flags", "env", "said"),
    [
        (("--listen", "here"), {}, ("listen", "'here'", "HOST:PORT", "command line")),
        (("--listen", f"{'a' * 64}:9000"), {}, ("listen", "HOST:PORT", "1 to 63 characters")),
        (("--publish", "osc://a..b:9000"), {}, ("publish.0", "'osc://a..b:9000'", "HOST:PORT")),
        ((), {"GESTURED_STALE_S": "soon"}, ("stale_s", "'soon'", "number", "environment")),
        ((), {"GESTURED_SOCKETT": "/x"}, ("GESTURED_SOCKETT", "GESTURED_SOCKET")),
        ((), {"GESTURED_METRICS_PORT": "9108"}, ("GESTURED_METRICS_PORT", "GESTURED_METRICS")),
        (("--strictness", "lax"), {}, ("strictness", "'lax'", "'eager', 'normal' or 'strict'", "command line")),
        (("--own-gestures", "/"), {}, ("own_gestures", "'/'", "expected the path of a file")),
        (("--touch", "maybe"), {}, ("touch = 'maybe'", "expected true or false")),
        (("--max-sensors", "1.5"), {}, ("max_sensors = '1.5'", "expected a whole number")),
        (("--config", "/no/such/file"), {}, ("config", "/no/such/file")),
    ],
)
def test_flags_and_variables_that_are_not_valid(
    flags: tuple[str, ...], env: dict[str, str], said: tuple[str, ...]
) -> None:
    text = unread(*flags, env=env)
    assert all(word in text for word in said), text


KUBERNETES = {  # what it sets in each container of a namespace with the services gestured and gestured-metrics
    "GESTURED_SERVICE_HOST": "10.96.0.17",
    "GESTURED_SERVICE_PORT": "9000",
    "GESTURED_SERVICE_PORT_OSC": "9000",
    "GESTURED_PORT": "udp://10.96.0.17:9000",
    "GESTURED_PORT_9000_UDP_PROTO": "udp",
    "GESTURED_METRICS_SERVICE_HOST": "10.96.0.18",
    "GESTURED_METRICS_PORT": "tcp://10.96.0.18:9108",
    "GESTURED_METRICS_PORT_9108_TCP_ADDR": "10.96.0.18",
    "KUBERNETES_PORT": "tcp://10.96.0.1:443",
}


def test_what_a_container_platform_sets_by_itself_is_passed_over(start) -> None:
    empty = {f"GESTURED_{name}": "" for name in ("LISTEN", "METRICS", "ALLOW", "STALE_S", "CONFIG", "ALOW")}
    daemon = start(env=KUBERNETES | empty | {"GESTURED_BUILT_BY": "somebody", "GESTURED_MAX_SENSORS": "3"})
    assert daemon.client().hello["type"] == "hello"
    daemon.stop()
    said = [line for line in lines_of(daemon.stderr()) if line["level"] == "warning"]
    assert [line["variable"] for line in said] == ["GESTURED_BUILT_BY"]


def test_explain_names_keys_as_the_file_has_them(model: Path, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text(
        'stale_s = 2\n[gestures]\nuse = ["one_tap"]\n[gestures.one_tap]\nthreshold = 0.9\n[sensors.arm]\nrotate = 90\n'
    )
    said = explain(*settings_of("--model", model, "--config", config))
    where = said[said.index("set by:") :].split()
    assert {"gestures.one_tap.threshold:", "sensors.arm.rotate:", "gestures.use:", "stale_s:"} <= set(where)
    assert "per_gesture" not in said


def test_gestures_in_use_are_written_alike_with_tables_of_gestures_beside_them(model: Path, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text('[gestures]\nuse = "one_tap, swipe_left"\n', "utf-8-sig")  # as some editors write it
    assert "gestures one_tap, swipe_left" in explain(*settings_of("--model", model, "--config", config))


def test_settings_that_are_not_valid_end_the_program(model: Path, tmp_path: Path) -> None:
    said = refused(2, "--model", model, "--socket", tmp_path / "s", env={"GESTURED_STALE_S": "soon"})
    assert all(word in said for word in ("stale_s", "'soon'", "number", "environment"))


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("[gestures.one_tab]\nthreshold = 0.5", "gestures: 'one_tab'"),
        ("gestures = ['wink']", "gestures: 'wink'"),
        ("sensors.a.zones.v = {at = [0, 0, 1, 1], gestures = ['one_tab']}", "sensors.a.zones.v.gestures: 'one_tab'"),
    ],
)
def test_gestures_that_the_model_does_not_know(model: Path, tmp_path: Path, text: str, wrong: str) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text(text)
    with pytest.raises(SettingsError, match=f"^{config}: {wrong} is no gesture of tiny, expected any of one_tap"):
        explain(*settings_of("--model", model, "--config", config))


def test_what_the_model_does_not_know_is_said_with_its_source_as_other_mistakes(model: Path, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text("[gestures.one_tap]\nthreshold = 0.5\n[arming]\nby = 'wink'")
    flags = ("--model", model, "--config", config)
    with pytest.raises(SettingsError, match="^.*/gestured.toml or environment: gestures: 'wink' is no gesture of tiny"):
        open_ladder(settings_of(*flags, env={"GESTURED_GESTURES": "wink"})[0])
    with pytest.raises(SettingsError, match="^.*/gestured.toml: arming.by = 'wink': is no gesture in use"):
        open_ladder(settings_of(*flags, "--own-gestures", tmp_path / "none.json")[0])


def test_a_reload_is_not_refused_for_a_fallback_that_is_missing(model: Path, tmp_path: Path) -> None:
    bad, missing = tmp_path / "bad.onnx", tmp_path / "missing.onnx"
    bad.write_bytes(b"damaged")
    with pytest.raises(ModelError, match="bad.onnx") as refused:
        open_ladder(settings_of("--model", bad, "--fallback", model, "--fallback", missing)[0], insist=True)
    assert "missing.onnx" not in str(refused.value)
    assert open_ladder(settings_of("--model", model, "--fallback", missing)[0], insist=True).refused


@pytest.mark.parametrize("what", ["a FIFO", "a device", "too large"])
def test_a_configuration_that_is_no_small_file(tmp_path: Path, what: str) -> None:
    path = tmp_path / "gestured.toml"
    if what == "a FIFO":
        os.mkfifo(path)
    elif what == "a device":
        path = Path("/dev/zero")
    else:
        path.touch()
        os.truncate(path, 300 << 20)
    text = unread("--config", path)
    assert f"config: {path}" in text and "expected a regular file of at most 1 MiB" in text


def test_a_limit_of_open_files_that_is_too_low(model: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gestured.daemon", "--model", model, "--listen", "127.0.0.1:0"]
    command += ["--socket", tmp_path / "s", "--metrics", "127.0.0.1:0"]
    limited = ["sh", "-c", 'ulimit -n 20; exec "$@"', "sh", *map(str, command)]
    done = subprocess.run(limited, capture_output=True, text=True, timeout=DEADLINE_S)
    assert done.returncode == 4 and done.stderr.count("\n") == 1, done.stderr
    assert "found 20" in done.stderr and "expected at least 256" in done.stderr


def test_a_model_that_cannot_be_used(tmp_path: Path) -> None:
    """In a real process; what else may be wrong with one, tests/test_models.py says."""
    path = tmp_path / "bad.onnx"
    flags = ("--listen", "127.0.0.1:0", "--socket", tmp_path / "s")
    assert str(path) in refused(3, "--model", path, *flags)
    assert not (tmp_path / "s").exists()


def test_explain_says_what_is_loaded_and_what_is_left_out(model: Path, tmp_path: Path) -> None:
    def explained(*flags: str) -> str:
        return explain(*settings_of("--model", model, *flags))

    def words(text: str) -> list[str]:
        """Without what the one process alone has: its sockets, one of which has a path that is no text."""
        return [line for line in text.splitlines() if "/" not in line and "socket" not in line]

    minimal = explained()
    status, printed, _ = run("--model", model, "--explain", env={"GESTURED_SOCKET": f"{tmp_path}/\udcff.sock"})
    assert status == 0 and words(printed) == words(minimal) and f"{tmp_path}/\\udcff.sock" in printed
    assert "HTTP: no --metrics" in minimal and "OSC output: no --publish" in minimal
    full = explained(
        "--metrics", "127.0.0.1:0", "--publish", "osc://127.0.0.1:9", "--gestures", "swipe_left,swipe_right",
        "--flight-recorder", "4",
    )  # fmt: skip
    assert "flight recorder: flight_recorder is 0" in minimal
    assert "flight recorder: the last 30 s of packets, at most 4 MiB" in full
    assert "osc://127.0.0.1:9:" in full and "no --publish" not in full
    assert "waiting for a second tap: double_tap is not in use" in full and "no --metrics" not in full
    assert "gestures: command line" in full
    assert "at 15 Hz a contact is answered 0.17 s after its last touched frame, a tap 0.57 s after it" in minimal
    assert "a contact is answered 0.17 s after its last touched frame\n" in full
