"""`gesturectl demo`: a daemon and a simulated sensor over UDP, and what is performed beside what is recognised."""

import argparse
import math
import queue
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import Any

from gestured.client.control import Control
from gestured.client.engine import Engine, child_of_ours
from gestured.client.lines import read_ahead
from gestured.client.pad.pad import Pad
from gestured.client.pad.server import PadServer
from gestured.client.picture import trace
from gestured.client.program import Commands
from gestured.client.say import say, say_drawn, say_json
from gestured.client.sensor import Form, Sensor
from gestured.client.stop import stop_as_by_ctrl_c
from gestured.client.subscriber import Subscriber
from gestured.client.values import number
from gestured.control.play import add_arguments, frames, performance
from gestured.control.show import Felt, Screen, as_dict, block, in_colour, in_words
from gestured.core.address import Address
from gestured.core.errors import GesturedError
from gestured.record.judge import Outcome, Performed, Tally
from gestured.simulator import Take

DEMO_SENSOR = "demo"
SLACK_S = 0.3  # a picture begins so long before the onset, and the demo ends so long after the last frame
DRAWN_AFTER_S = 0.1  # a picture ends so long after the offset
POLL_S = 0.05
BEGUN_S = 5.0  # the longest wait for the first packet of the simulated sensor
GONE_S = 3.0  # a pad counts as closed after so long without a page, since a reload of the page takes less
HEARD = ("gesture", "unknown", "provisional")  # the types of events that the demo subscribes to


def add(commands: Commands) -> None:
    """Add the subcommand to gesturectl's command line."""
    parser = commands.add_parser(
        "demo",
        help="start a daemon, and watch it recognise simulated gestures",
        description="Start a daemon with a shipped model and a simulated sensor that sends to it\n"
        "over UDP, and show what was performed beside what was recognised.",
        epilog="examples:\n  gesturectl demo --seconds 20 --speed fast\n  gesturectl demo --json --kinds double_tap",
    )
    parser.add_argument("--model", default="cnn_lstm", help="a path, or a shipped one's name (default: cnn_lstm)")
    parser.takes("--seconds", "S", "how long (default: 60)", type=number(5, 600), default=60.0)
    add_arguments(parser)
    parser.runs(run, "print outcomes and summary as JSON lines")


def run(args: argparse.Namespace) -> int:
    """Show outcomes as they come, then the summary; Ctrl-C skips to the summary."""
    stop_as_by_ctrl_c()
    take = performance(args, args.seconds, first="circle_clockwise")
    rows, columns = args.grid
    show = Show(take, args.model, args.json)
    flags = ("--flight-recorder", "4", "--touch", "true")  # for the flag and the sliders of the page
    with Engine(args.model, rows, columns, *flags) as engine:
        control = Path(engine.ready["control"])
        try:
            with (
                nullcontext("") if args.json else page(control) as address,
                Subscriber(engine.socket, types=HEARD, sensors=[DEMO_SENSOR], reconnect=False) as stream,
                show.drawn(control),
                sending(engine.listen, take) as sensor,
                nullcontext() if args.json else pad(engine, args.grid, args.rate, after=sensor) as touched,
            ):
                show.say(
                    f"The daemon listens on {engine.listen} with the model {engine.ready['model']}.",
                    f"A simulated sensor of {rows} x {columns} taxels sends OSC to it at {args.rate:g} Hz.",
                    *([f"Until the demo ends, a browser shows it at {address}"] if address else []),
                    *([f"A pad for your own finger or mouse is at {touched.page}"] if touched else []),
                    "For two seconds nobody touches it. Ctrl-C ends.",
                    "",
                )
                show.follow(sensor, stream)
                if touched is not None and touched.open:
                    show.say("", "The pad is still open: the demo ends when its page is closed, or with Ctrl-C.")
                    await_closed(touched)
        except KeyboardInterrupt:
            show.say("")
    show.conclude()
    return 0


@contextmanager
def page(control: Path) -> Iterator[str]:
    """Run `gesturectl view` as a child; gives the address of its page, which no browser is started for."""
    command = [*child_of_ours("gestured.control"), "view", "--listen", "127.0.0.1:0", "--control", str(control)]
    with Popen(command, stdin=DEVNULL, stdout=PIPE, stderr=DEVNULL, text=True) as process:
        try:
            yield process.stdout.readline().strip() if process.stdout is not None else ""
        finally:
            process.terminate()
            process.wait()  # since `Popen` waits a quarter of a second at most after Ctrl-C


def pad(engine: Engine, grid: tuple[int, int], rate_hz: float, after: Sensor) -> PadServer:
    """A pad that sends to the demo's daemon, served on any free port; a context manager.

    The pad begins after the simulated sensor, since the page of `view` shows the sensor that was heard first.
    """
    end = time.monotonic() + BEGUN_S
    while not after.sent and time.monotonic() < end:
        time.sleep(POLL_S)
    server = PadServer(Address("127.0.0.1", 0), Pad(engine.listen, "pad", grid, min(rate_hz, 200.0)), "the demo")
    return server.serve(engine.socket)


@contextmanager
def sending(to: Address, take: Take) -> Iterator[Sensor]:
    """A simulated sensor that sends a take in a thread; on exit it stops, and its thread has ended."""
    with closing(Sensor(to, Form(DEMO_SENSOR))) as sensor:
        sender = threading.Thread(target=sensor.send, args=(frames(0.0, take),), daemon=True)
        sender.start()
        try:
            yield sensor
        finally:
            sensor.stop.set()
            sender.join()


def await_closed(server: PadServer) -> None:
    """Wait until no page has shown the pad for GONE_S, or the server ends since nobody touches the pad."""
    shown = time.monotonic()
    while time.monotonic() - shown < GONE_S and not server.ended.wait(POLL_S):
        shown = time.monotonic() if server.open else shown


class Show:
    """The comparison of one take with its events, shown while it runs."""

    def __init__(self, take: Take, model: str, as_json: bool) -> None:
        self.take, self.model = take, model
        self.as_json = as_json
        self.colour = in_colour()
        self.tally, self.felt = Tally(), Felt(self.colour)
        self.screen = Screen() if sys.stdout.isatty() and not as_json else None
        self._views: queue.Queue[dict[str, Any] | None] = queue.Queue()  # what the daemon streams, for the screen

    def say(self, *lines: str) -> None:
        """Print lines for a person, unless the output is JSON."""
        if not self.as_json:
            say(*lines)

    @contextmanager
    def drawn(self, control: Path) -> Iterator[None]:
        """Show the sensor on a terminal meanwhile, as the daemon with this control socket sees it."""
        if self.screen is None:
            yield
            return
        with Control(control) as daemon, self.screen:
            daemon.ask("follow", sensors=[DEMO_SENSOR])
            self._views = read_ahead(daemon.lines())
            yield

    def follow(self, sensor: Sensor, stream: Subscriber) -> None:
        """Show the outcomes of the take while it is sent. Raises GesturedError if the daemon closes the connection."""
        heard = read_ahead((time.time(), event) for event in stream)
        ahead = list(self.take.events)
        end = sensor.moment(float(self.take.times[-1]) + SLACK_S)
        while (now := time.time()) < end:
            while ahead and sensor.moment(ahead[0].onset_s) <= now:
                event = ahead.pop(0)
                onset, offset = sensor.moment(event.onset_s), sensor.moment(event.offset_s)
                self.tally.begin(Performed(event.label, event.kind, onset, offset))
            for outcome in self.tally.settle(now):
                self._show(outcome, sensor)
            self._draw()
            try:
                item = heard.get(timeout=POLL_S)
            except queue.Empty:
                continue
            if item is None:
                raise GesturedError("the daemon closed the connection")
            arrived, message = item
            if message["type"] in HEARD and (decided := self.tally.hear(message, arrived)):
                self._show(decided, sensor)
        for outcome in self.tally.settle(math.inf):
            self._show(outcome, sensor)

    def conclude(self) -> None:
        """Print the summary, and what to do next."""
        figures = self.tally.summary()
        if self.as_json:
            say_json({"type": "summary"} | figures)
        else:
            say_drawn(in_words(figures, self.colour))
            program = Path(sys.argv[0]).absolute()  # uvx, pipx and make keep it outside of PATH
            found = [f'  export PATH="{program.parent}:$PATH"'] if program.name == "gesturectl" else []
            say(
                "",
                "Next, a daemon of your own, a sensor that somebody touches, and a listener. Open three terminals,",
                f"and begin each with {'these lines' if found else 'this line'}:",
                *found,
                "  export GESTURED_SOCKET=/tmp/gestured.sock",
                "Then run one of these in each:",
                f"  gestured --model {self.model}",
                "  gesturectl simulate --sensor armrest",
                "  gesturectl listen",
                "gesturectl view shows that sensor in a browser, and",
                "gesturectl pad makes a sensor of a mouse, a touchscreen or a telephone.",
            )

    def _draw(self) -> None:
        came = [self._views.get() for _ in range(self._views.qsize())]
        views = [line for line in came if line is not None and line["type"] == "view"]
        if self.screen is not None and views:
            self.screen.draw(self.felt.lines(views[-1]))

    def _show(self, outcome: Outcome, sensor: Sensor) -> None:
        if self.as_json:
            say_json(as_dict(outcome))
            return
        of = outcome.performed
        onset, offset = (of.onset, of.offset) if of else (outcome.event["onset"], outcome.event["offset"])  # type: ignore[index]
        times = self.take.times + sensor.epoch
        shown = (times >= onset - SLACK_S) & (times <= offset + DRAWN_AFTER_S)
        text = block(outcome, trace(self.take.frames[shown]), self.colour)
        if self.screen is not None:
            self.screen.above(text)
        else:
            say_drawn(text)
