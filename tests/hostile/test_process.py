"""What happens to the process and to what it stands on: its clock, its model, its memory, its output, its end."""

import os
import resource
import signal
from pathlib import Path

import pytest

from gestured.core.errors import ModelError
from gestured.model.opening import open_model
from tests.daemon.harness import Daemon, Hand, Sensor, lines_of
from tests.hostile import bad_models
from tests.hostile.grammar import TYPES, violations

INJECT = Path(__file__).with_name("inject")


def press(sensor: Sensor, seconds: float = 3.0) -> Sensor:
    """A touch that lasts."""
    return sensor.send([sensor.hand.frame(4.0) for _ in range(round(15 * seconds))], sensor.hand.idle(1.0))


def test_after_a_kill_the_next_daemon_takes_the_place(start) -> None:
    first = start("--clock", "sensor")
    client = first.client().subscribe(*TYPES)
    sensor = Sensor(first, "arm").begin()
    sensor.send(sensor.hand.swipe("left")[:4])
    assert client.line()["type"] == "onset"
    first.signal(signal.SIGKILL)
    assert first.wait() == -signal.SIGKILL and client.rest() == []
    assert first.socket.exists()  # nobody could remove it
    second = start("--clock", "sensor", "--socket", first.socket, "--listen", first.ready["listen"])
    again = second.client()
    assert again.hello["instance"] != client.hello["instance"] and again.hello["sensors"] == {}
    sensor.begin().perform("left")
    assert again.line()["sequence"] == 1


def injected(**settings: Path) -> dict[str, str]:
    """The environment of a daemon that INJECT changes, with these settings of it."""
    path = os.pathsep.join((str(INJECT), *filter(None, [os.environ.get("PYTHONPATH")])))
    return {"PYTHONPATH": path} | {name: str(value) for name, value in settings.items()}


def test_the_wall_clock_may_step_by_an_hour(start, tmp_path: Path) -> None:
    clock = tmp_path / "clock"
    clock.write_text("0")
    daemon = start("--clock", "sensor", env=injected(HOSTILE_CLOCK=clock))
    client = daemon.client().subscribe(*TYPES)
    sensor = Sensor(daemon, "arm").begin().perform("left")
    lines = [client.line() for _ in range(3)]
    for step in (3600.0, 0.0):  # forward, and back
        frames = sensor.hand.swipe("right")
        sensor.send(frames[:3])
        lines.append(client.line())
        clock.write_text(str(step))
        sensor.send(frames[3:], sensor.hand.idle(1.0))
        lines += [client.line() for _ in range(2)]
    assert violations(lines) == []
    gestures = [line for line in lines if line["type"] == "gesture"]
    assert [line["gesture"] for line in gestures] == ["swipe_left", "swipe_right", "swipe_right"]
    for before, after, step in zip(gestures, gestures[1:], (3600.0, -3600.0), strict=False):
        assert after["onset"] - before["onset"] == pytest.approx(step, abs=60)
        assert after["offset"] - after["onset"] == pytest.approx(6 / 15, abs=1e-3)  # no event stands on both sides


def test_a_tape_keeps_to_one_clock_when_the_wall_clock_steps_while_it_is_written(start, tmp_path: Path) -> None:
    """As it does when the machine has slept: what is recorded stands where its packets stand."""
    clock = tmp_path / "clock"
    clock.write_text("0")
    daemon = start("--clock", "sensor", "--flight-recorder", "1", env=injected(HOSTILE_CLOCK=clock))
    sensor = Sensor(daemon, "arm").begin()
    with daemon.control() as live, daemon.control() as later:
        epoch_ns = live.ask("tap")["epoch_ns"]
        clock.write_text("3600")
        sensor.perform("left")
        lines, last_ns = live.lines(), 0
        for line in lines:
            if line["type"] == "packet":
                last_ns = line["t_ns"]
            elif line["type"] == "gesture":
                break
        assert line["decided"] == pytest.approx((last_ns + epoch_ns) / 1e9, abs=60)
        assert later.ask("flight")["epoch_ns"] == epoch_ns  # it holds the same lines
    while daemon.ask("status")["taps"]:
        pass  # it has not noticed yet that the tap is gone
    with daemon.control() as alone:
        assert alone.ask("tap")["epoch_ns"] - epoch_ns == pytest.approx(3600e9, abs=60e9)


def test_without_another_model_what_fails_is_cancelled_and_said(start, model: Path, tmp_path: Path) -> None:
    bad = bad_models.failing(model, tmp_path / "bad.onnx")
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", model=bad)
    client = daemon.client().subscribe(*TYPES)
    sensor = Sensor(daemon, "arm").begin()
    press(sensor)
    lines = [client.line() for _ in range(3)]
    assert (lines[1]["type"], lines[1]["reason"]) == ("cancelled", "model")
    assert daemon.get("/readyz")[0] == 503 and daemon.metric("gestured_cancelled_total", reason="model") == 1
    sensor.perform("left")
    lines += [client.line() for _ in range(3)]
    assert lines[4]["gesture"] == "swipe_left" and violations(lines) == []
    assert daemon.get("/readyz")[0] == 200


def test_a_model_that_hangs_is_ended_and_hands_over_to_the_next(start, model: Path, tmp_path: Path) -> None:
    bad = bad_models.hanging(model, tmp_path / "bad.onnx")
    flags = ("--clock", "sensor", "--stale-s", 30, "--metrics", "127.0.0.1:0")
    daemon = start("--fallback", model, *flags, model=bad)
    client = daemon.client().subscribe(*TYPES)
    sensor = Sensor(daemon, "arm").begin()
    press(sensor)
    sensor.perform("left")
    lines = client.until(lambda line: line["type"] == "release" and line["id"] == 2)
    assert violations(lines) == []
    answers = [(line["model"], line["degraded"]) for line in lines if line["type"] in ("gesture", "unknown")]
    assert answers == [("tiny", True), ("tiny", True)]
    assert daemon.get("/healthz")[0] == 200 and daemon.metric("gestured_model_failures_total") == 1
    assert daemon.metric("gestured_degraded_answers_total") == 2
    assert daemon.metric("gestured_active_model_info", model="tiny", version=client.hello["version"]) == 1
    assert client.subscribe("status").line()["state"] == "degraded"
    assert "did not answer" in daemon.stderr()


def test_the_end_does_not_wait_for_a_model_at_the_start(model: Path, tmp_path: Path) -> None:
    bad = bad_models.endless(model, tmp_path / "bad.onnx")
    daemon = Daemon(tmp_path, "--model", bad, "--listen", "127.0.0.1:0", "--socket", tmp_path / "events.sock")
    tried = trial_of(daemon)
    daemon.signal(signal.SIGTERM)
    assert (daemon.stop(), daemon.stderr()) == (0, "")
    assert not (tmp_path / "events.sock").exists()
    while alive(tried):  # one that was being started finds no input, and ends by itself
        pass


def test_the_end_does_not_wait_for_a_model_that_is_being_opened(start, model: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.onnx"
    path.write_bytes(model.read_bytes())
    daemon = start("--clock", "sensor", model=path)
    client = daemon.client()
    bad_models.endless(model, tmp_path / "bad.onnx").replace(path)
    with daemon.control() as control:
        control.socket.sendall(b'{"verb":"reload"}\n')
        tried = trial_of(daemon)
        Sensor(daemon, "arm").begin().perform("left")
        assert client.line()["gesture"] == "swipe_left"  # frames are served meanwhile
        assert alive(tried)
        assert daemon.stop() == 0
    assert not alive(tried) and "Traceback" not in daemon.stderr()


def test_a_stop_while_a_reload_waits_for_a_name_ends_as_asked(start, tmp_path: Path) -> None:
    config, asked = tmp_path / "gestured.toml", tmp_path / "asked"
    config.write_text("")
    daemon = start("--clock", "sensor", "--config", config, env=injected(HOSTILE_NAMES=asked))
    client = daemon.client()
    Sensor(daemon, "arm").begin().send(Hand().tap(), Hand().idle(0.2))
    config.write_text('publish = ["osc://hangs:9001"]')
    daemon.signal(signal.SIGHUP)
    while not asked.exists():
        pass
    assert daemon.stop() == 0
    assert client.line()["gesture"] == "one_tap" and not daemon.socket.exists()
    assert "Traceback" not in daemon.stderr() and "force" not in daemon.stderr()


def test_the_end_does_not_wait_for_an_answer_that_never_comes(start, model: Path, tmp_path: Path) -> None:
    bad = bad_models.stuck(model, tmp_path / "bad.onnx")
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", model=bad)
    press(Sensor(daemon, "arm").begin())
    while daemon.get("/healthz")[0] == 200:
        pass
    assert daemon.stop() == 1
    assert "ended by force" in daemon.stderr()


def trial_of(daemon: Daemon) -> int:
    """The process that a daemon has started to open a model, once there is one."""
    children = Path(f"/proc/{daemon.process.pid}/task/{daemon.process.pid}/children")
    if not children.exists():
        pytest.skip("this kernel does not list children")
    while True:
        assert daemon.process.poll() is None, daemon.stderr()
        for task in Path(f"/proc/{daemon.process.pid}/task").iterdir():
            try:
                found = (task / "children").read_text().split()
            except OSError:  # a thread that has ended
                continue
            if found:
                return int(found[0])


def alive(pid: int) -> bool:
    """Whether a process runs and will; one that is dead, or has been killed and waits for its turn to die, does not."""
    try:
        status = dict(line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    except OSError:
        return False
    pending = int(status["SigPnd"], 16) | int(status["ShdPnd"], 16)
    return not status["State"].startswith(("Z", "X")) and not pending & 1 << signal.SIGKILL - 1


def test_a_model_file_that_changes_under_a_running_daemon(start, model: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.onnx"
    path.write_bytes(model.read_bytes())
    daemon = start("--clock", "sensor", model=path)
    client = daemon.client()
    sensor = Sensor(daemon, "arm").begin()
    for change in (
        lambda: os.truncate(path, 100),  # in place: a file that were mapped would kill the process now
        lambda: bad_models.failing(model, tmp_path / "other.onnx").replace(path),
        path.unlink,
    ):
        change()
        sensor.perform("left")
        assert client.line()["gesture"] == "swipe_left"


def test_a_model_file_that_nests_without_end_is_refused(tmp_path: Path) -> None:
    nested = b""
    # attribute.g, node.attribute, graph.node: a loop in a loop in a loop; and model.graph around all
    for field in b"\x32\x2a\x0a" * 5000 + b"\x3a":
        size = len(nested)
        nested = bytes([field, size & 0x7F | 0x80, size >> 7 & 0x7F | 0x80, size >> 14]) + nested
    path = tmp_path / "deep.onnx"
    path.write_bytes(nested)
    with pytest.raises(ModelError, match=r"deep\.onnx: onnxruntime cannot open it"):
        open_model(path)


def test_a_destination_that_cannot_be_reached_costs_nobody_an_event(start) -> None:
    # The broadcast address is refused by our own kernel at once: no packet leaves this machine.
    daemon = start("--clock", "sensor", "--metrics", "127.0.0.1:0", "--publish", "osc://255.255.255.255:9")
    client = daemon.client()
    Sensor(daemon, "arm").begin().perform("left")
    assert client.line()["gesture"] == "swipe_left"
    assert daemon.metric("gestured_osc_messages_total", result="unreachable") >= 1
    daemon.stop()
    said = [line for line in lines_of(daemon.stderr()) if line.get("reason") == "unreachable"]
    assert len(said) == 1 and said[0]["destination"] == "255.255.255.255:9"


@pytest.mark.hostile
def test_memory_that_cannot_be_had_costs_a_sensor_its_contact_and_not_the_process(start, tmp_path: Path) -> None:
    config = tmp_path / "gestured.toml"
    config.write_text('max_sensors = 1000\ngrid = "64x64"\n[sensors.arm]\ngrid = "9x9"\n')
    daemon = start("--config", config, "--clock", "sensor", "--metrics", "127.0.0.1:0")
    client = daemon.client()
    arm = Sensor(daemon, "arm").begin().perform("left")
    assert client.line()["gesture"] == "swipe_left"
    pages = int(Path(f"/proc/{daemon.process.pid}/statm").read_text().split()[0])
    soft, hard = resource.prlimit(daemon.process.pid, resource.RLIMIT_AS)
    resource.prlimit(daemon.process.pid, resource.RLIMIT_AS, (pages * resource.getpagesize() + (8 << 20), hard))
    crowd, said, ends = [], "", ("MemoryError", "socket_error")
    while not (out := any(word in said for word in ends)) and len(crowd) < 900:
        crowd.append(Sensor(daemon, f"s{len(crowd)}"))  # one by one: the daemon would not hear a flood of them
        crowd[-1].sock.send(big(crowd[-1].name, 1))
        while not any(word in (said := daemon.stderr()) for word in (f'"{crowd[-1].name}"', *ends)):
            assert daemon.process.poll() is None, said[-2000:]
    assert out, "there was memory enough"
    resource.prlimit(daemon.process.pid, resource.RLIMIT_AS, (soft, hard))
    again, seen = daemon.client().subscribe("gesture", "status"), []
    while "gesture" not in {line["type"] for line in seen}:  # what waits is worked off first
        arm.begin().perform("left")
        seen += again.until(lambda line: line["type"] == "status")
    assert {line["gesture"] for line in seen if line["type"] == "gesture"} == {"swipe_left"}


def big(name: str, n: int) -> bytes:
    """A frame of 64 x 64."""
    import numpy as np

    from tests import encoding

    return encoding.message(f"/{name}/pressure", "ib", (n, np.full(4096, n % 7, ">u2").tobytes()))
