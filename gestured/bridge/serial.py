"""`gestured-bridge serial`: the frames of a sensor on a serial line, sent to the daemon as OSC.

Of frames that came together because this host was slow, the newest KEPT are sent, so that no delay builds up; the
counter tells the daemon how many are missing. If the device is unplugged, the bridge waits for it.
"""

import argparse
import errno
import os
import select
import stat
import termios
import time
from typing import Any

from gestured.bridge.counts import Counts
from gestured.bridge.options import BridgeError, add_destination, add_metrics, need
from gestured.bridge.protocols import PROTOCOLS, looks_like
from gestured.bridge.readings import MOST_TAXELS, Reading, Unwrapped
from gestured.client.program import Commands
from gestured.client.sensor import Form, connected, sent_after_refusal
from gestured.client.stop import on_stop
from gestured.client.values import number, rows_by_columns, sensor_name
from gestured.core.frames import Frame

KEPT = 8  # the most frames that are sent of those that come at once: the newest
QUIET_S = 0.002  # a frame is over when the line is quiet for so long; a byte takes 0.1 ms at 115,200 baud
POLL_S = 0.25  # the longest wait for the line, after which the bridge looks whether it is to end
ANSWER_S = 0.25  # the longest wait for a sensor's answer, after which the request is repeated
AGAIN_S = 0.5  # from one attempt to open the device to the next
SILENT_S = 5.0  # an open line that is silent for so long is reported
JUDGED_BYTES = 4096 + 4 * MOST_TAXELS  # after so many bytes without a frame, what they look like is reported
JUDGED_TAXEL_BYTES = 64  # so many more bytes for each taxel of the grid: two of the longest lines of text


def add(commands: Commands) -> None:
    """Add the bridge to the command line."""
    parser = commands.add_parser(
        "serial",
        help="a serial sensor's frames to the daemon",
        description="Read a sensor on a serial line and send its frames to the daemon as OSC.",
        epilog="examples:\n  gestured-bridge serial /dev/ttyUSB0 --protocol flexitac --sensor glove --grid 16x32\n"
        "  gestured-bridge serial /dev/ttyACM0 --protocol csv --sensor armrest --grid 9x9 --baud 115200",
    )
    parser.takes("device", "DEVICE", "such as /dev/ttyUSB0, or a link in /dev/serial/by-id")
    parser.add_argument("--protocol", required=True, choices=tuple(PROTOCOLS), help="what the sensor speaks")
    parser.takes("--sensor", "NAME", "its name for the daemon", type=sensor_name, required=True)
    parser.takes("--baud", "N", "bits a second (default: as the protocol's sensors)", type=number(1, 10**9, whole=True))
    text = "rows and columns (default: 16x16 for flexitac and e256, else 9x9)"
    parser.takes("--grid", "RxC", text, type=rows_by_columns)
    add_destination(parser)
    add_metrics(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Forward frames until SIGTERM or Ctrl-C."""
    need("serial", "pyserial", "serial")
    bridge = Serial(args, Counts("serial"))
    on_stop(bridge.stop)
    bridge.work()
    return 0


class Serial:
    """The line of one serial sensor: its bytes become frames, and these go to the daemon."""

    def __init__(self, args: argparse.Namespace, counts: Counts) -> None:
        """Raises BridgeError for arguments that cannot be used, GesturedError if the daemon cannot be looked up."""
        protocol = PROTOCOLS[args.protocol]
        if protocol.fixed and args.grid not in (None, protocol.grid):
            raise BridgeError(f"--grid: {args.protocol} sensors have {'x'.join(map(str, protocol.grid))} taxels")
        self._name, self._protocol = args.protocol, protocol
        rows, columns = args.grid or protocol.grid
        self._rows, self._columns = int(rows), int(columns)
        self._device, self._baud = args.device, args.baud or protocol.baud
        self._sensor = args.sensor
        self._forms = {form: Form(args.sensor, form) for form in ("floats", "ints", "uint8", "uint16")}
        self._counts = counts
        self._to, self._socket = args.to, connected(args.to)
        self._counter, self._own = 0, Unwrapped()  # the bridge's own counter, and the sensor's
        self._stopped = False
        self._opened = False  # whether the device was ever open
        counts.serve(args.metrics)

    def stop(self) -> None:
        """Let `work` end; a signal handler may call it."""
        self._stopped = True

    def work(self) -> None:
        """Forward frames, and wait for a device that is not there. Raises BridgeError if waiting does not help."""
        while not self._stopped:
            if (port := self._open()) is not None:
                with port:
                    self._opened = True
                    self._counts.connected("device", True, f"{self._device} is open")
                    self._counts.ready(device=self._device, sensor=self._sensor, to=str(self._to))
                    reason = self._forward(port)
                if reason:
                    self._counts.connected("device", False, f"{self._device} went: {reason}; waiting for it")
            if not self._stopped:
                time.sleep(AGAIN_S)  # even if the device is still there, since opening it resets many boards

    def _open(self) -> Any:
        """The opened device; None if it is not there yet. Raises BridgeError if waiting does not help."""
        import serial

        none = f"{self._device}: is no serial device: ls -l /dev/serial/by-id shows those that are"
        try:
            if not stat.S_ISCHR(os.stat(self._device).st_mode):
                raise BridgeError(none)
            return serial.Serial(self._device, self._baud, timeout=0, write_timeout=ANSWER_S, exclusive=True)
        except ValueError:
            raise BridgeError(f"--baud {self._baud}: this device does not take it") from None
        except (OSError, termios.error) as error:  # or SerialException, an OSError, perhaps because of a termios.error
            cause = error.__context__ or error
            code = cause.errno if isinstance(cause, OSError) else cause.args[0]
            said = os.strerror(code) if code else str(error)
            if code == errno.EACCES and not self._opened:  # a new device belongs to root for a moment
                remedy = 'sudo adduser "$USER" dialout, and log in again'
                raise BridgeError(f"{self._device}: {said}: it is for members of its group ({remedy})") from None
            if code == errno.EAGAIN:
                raise BridgeError(f"{self._device}: another program has it open: end that one first") from None
            if code == errno.ENOTTY:
                raise BridgeError(none) from None
            self._counts.connected("device", False, f"{self._device} is not there: {said}; waiting for it")
            return None

    def _forward(self, port: Any) -> str | None:
        """Forward the frames of one connection; returns why it ended, None if `stop` ended it."""
        from serial import SerialTimeoutException

        protocol = self._protocol(self._rows, self._columns)
        judged: bytes | None = b""  # bytes before the first frame; None after a frame or a report
        asked = began = time.monotonic()
        due = bool(protocol.request)
        pending = False
        try:
            while not self._stopped:
                if due:
                    port.write(protocol.request)
                    asked, due = time.monotonic(), False
                readable, _, _ = select.select([port], [], [], QUIET_S if pending else POLL_S)
                data = port.read(max(1, port.in_waiting)) if readable else b""
                before = protocol.passed
                readings = protocol.push(data) if data else protocol.flush()
                pending = bool(data)
                self._send(readings)
                self._counts.add("bytes", "passed", protocol.passed - before)
                if readings:
                    judged = None
                elif judged is not None:
                    judged = self._judged(judged + data, began)
                due = bool(protocol.request) and (bool(readings) or time.monotonic() > asked + ANSWER_S)
        except SerialTimeoutException:
            return "it takes no request"
        except OSError as error:
            return error.strerror or "it was unplugged"
        return None

    def _send(self, readings: list[Reading]) -> None:
        """Send the newest KEPT of the readings to the daemon, and count all."""
        first = max(len(readings) - KEPT, 0)
        for n, reading in enumerate(readings):
            self._counter += 1
            counter = self._counter if reading.counter is None else self._own.of(reading.counter)
            if n < first:
                self._counts.add("frames", "overtaken")
                continue
            packet = self._forms[form_of(reading)].packet(Frame(0.0, reading.values), counter, reading.moment)
            try:
                heard = not sent_after_refusal(self._socket, packet)
            except OSError:  # the network is down
                heard = False
            self._counts.add("frames", "sent" if heard else "unheard")
            words = (
                f"frames go to {self._to}" if heard else f"nobody listens at {self._to}: start gestured, or name --to"
            )
            self._counts.connected("daemon", heard, words)

    def _judged(self, data: bytes, began: float) -> bytes | None:
        """Report silence, or bytes without a frame; returns None after a report, else `data`. Raises BridgeError."""
        if not data and time.monotonic() > began + SILENT_S:
            hint = "" if self._protocol.request else " (eTextile's E256 speaks only when it is asked: --protocol e256)"
            self._counts.say(f"{self._device} is open, but nothing comes{hint}")
            return None
        if len(data) < JUDGED_BYTES + JUDGED_TAXEL_BYTES * self._rows * self._columns:
            return data
        what = f"{self._device}: no {self._name} frame of {self._rows}x{self._columns} in {len(data)} bytes"
        if words := looks_like(data):
            raise BridgeError(f"{what}: these bytes look like {words}: set --protocol and --grid so")
        remedy = f"is --baud {self._baud} right, and --protocol?"
        self._counts.say(f"{what}, nor of another protocol: {remedy}")
        return None


def form_of(reading: Reading) -> str:
    """The `Form.values` in which a frame is sent: the smallest that holds it."""
    kind = reading.values.dtype
    if kind.kind == "u" and kind.itemsize <= 2:
        return f"uint{8 * kind.itemsize}"
    return "ints" if kind.kind == "i" else "floats"
