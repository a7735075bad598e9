"""The daemon, counted: how many of Python's own instructions its packets take, and which packages it has loaded.

A count says what is done, however busy the machine is. What numpy, onnxruntime and the kernel do within one instruction
is not in it, nor what timers do beside the packets. Prints the daemon's line, one for each reading of packets
([packets, whether some wait still, instructions]), and the names of all modules once it has ended.
"""

import json
import runpy
import sys
from types import FrameType
from typing import Any

from gestured.daemon.udp import Receiver

count = found = 0
read, receive = Receiver.read, Receiver._receive


def traced(frame: FrameType, event: str, _: Any) -> Any:
    """Called for each instruction of each of Python's frames."""
    global count
    if event == "opcode":
        count += 1
    elif event == "call":
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
    return traced


def counted(receiver: Receiver) -> None:
    """In the place of `Receiver.read`: all that is done with packets is done in it."""
    global count, found
    count = found = 0
    sys.settrace(traced)
    try:
        read(receiver)
    finally:
        sys.settrace(None)
        print(json.dumps([found, receiver._again is not None, count]), flush=True)


def taken(receiver: Receiver) -> Any:
    """In the place of `Receiver._receive`."""
    global found
    packets, stamps, full = receive(receiver)
    found += len(packets)
    return packets, stamps, full


setattr(Receiver, "read", counted)  # noqa: B010
setattr(Receiver, "_receive", taken)  # noqa: B010
try:
    runpy.run_module("gestured.daemon", run_name="__main__", alter_sys=True)
except SystemExit:
    pass
finally:
    print(json.dumps(sorted(sys.modules)), flush=True)
